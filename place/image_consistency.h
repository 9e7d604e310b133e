// Whether two images can show one place: their features are matched by descriptor, and the matches asked for an
// epipolar geometry that they agree with. Nothing is known of the lens or of any map; where there is a map, its points
// say more.
//
// Plain functions, safe from any thread.
#pragma once

#include <Eigen/Core>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "place/place_features.h"

namespace parallax {

struct ImageConsistencyOptions {
  int max_distance = 70;       // bits of 256
  double ratio = 0.85;         // nearest descriptor to the second nearest, one-to-one
  double tolerance_px = 2.5;   // from the epipolar line, pixels of level 0 times the feature's scale
  double first_tolerance = 2;  // so many times that for the weak-perspective model that is tried first
  int rounds = 400;            // of RANSAC
};

struct ImageConsistency {
  int matches = 0;  // by descriptor
  int inliers = 0;  // that agree with one epipolar geometry
};

// One-to-one matches (index in a, index in b).
std::vector<std::pair<int, int>> match_place_features(std::span<const PlaceFeature> a, std::span<const PlaceFeature> b,
                                                      const ImageConsistencyOptions& options);

// The normalised eight-point algorithm (Hartley 1997): F with b^T F a = 0 for pixels (x, y, 1), of rank two. False with
// fewer than eight pairs or where they do not determine it.
bool solve_fundamental(std::span<const std::pair<Eigen::Vector2d, Eigen::Vector2d>> pairs, Eigen::Matrix3d* b_F_a);

// RANSAC over four matches with the affine epipolar constraint, then the eight-point algorithm on what agrees with the
// best, twice. The same rng state gives the same answer.
ImageConsistency check_image_consistency(std::span<const PlaceFeature> a, std::span<const PlaceFeature> b,
                                         const ImageConsistencyOptions& options, std::mt19937_64* rng);

}  // namespace parallax
