// Two places that look alike, verified by geometry: descriptors of map points are matched, the similarity transform is
// found by RANSAC over three point pairs (Fischler and Bolles 1981; closed form of Umeyama 1991) and refined on the
// reprojection errors of both sides; then what it predicts is matched as well, and it is refined again. What several
// transforms would explain about as well (tiles, keyboards) is refused.
//
// Frames: worlds of the two maps. Plain functions, safe from any thread while nobody writes the maps; deterministic for
// a given state of the generator. A place that is not recognised is nothing, never an error.
#pragma once

#include <optional>
#include <random>
#include <vector>

#include "core/camera_model.h"
#include "core/se3.h"
#include "map/map.h"

namespace parallax {

// The same physical point in two maps, or twice in one.
struct PointPair {
  PointId a, b;
};

struct PlaceAlignment {
  SimilarityTransform a_from_b;  // worlds of the two maps; of one map: as its points say on either side
  std::vector<PointPair> pairs;  // inliers, each point once, in order of a
  int inliers = 0;               // as many as pairs
  double sigma_px = 0;           // robust scale of the reprojection errors, level-0 pixels
};

struct PlaceAlignmentOptions {
  int window_keyframes = 4;    // besides the one: those that measure the most of its points
  int max_points = 1200;       // of a side; those of the keyframe itself come first
  int max_distance = 64;       // bits of 256 that descriptors of one point may differ by
  int guided_distance = 80;    // the same where geometry says where to look
  int ratio_percent = 85;      // nearest descriptor to the nearest of another place
  int max_hypotheses = 600;    // triples
  double inlier_sigmas = 3.0;  // a pair agrees within so many of its own standard deviations in both views
  int min_inliers = 25;        // after guided matching; fewer is no evidence
  // Probability that as many matches agree by chance, above which the first alignment is refused (a-contrario RANSAC,
  // Moisan and Stival 2004).
  double max_false_alarm = 1e-6;
  // Another transform that is supported by this part of the matches, where every point may match several, is a rival.
  double max_rival = 0.6;
  // a's metres to one of b's, where both are known (1: two sides of a loop in one metric map); else it is estimated.
  std::optional<double> fixed_scale = std::nullopt;

  // Throws InputError when a value is out of range.
  void validate() const;
};

// Points measured in `in_a`, and in the keyframes that see the same points, against the same around `in_b`. For a loop
// both maps are one object; points that both sides share are no evidence and are left out.
std::optional<PlaceAlignment> align_places(const Map& a, KeyframeId in_a, const Map& b, KeyframeId in_b,
                                           const CameraModel& camera, const PlaceAlignmentOptions& options,
                                           std::mt19937_64* rng);

}  // namespace parallax
