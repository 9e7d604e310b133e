// The camera pose from 2D-3D matches without a prior: the three-point problem (Grunert 1841) solved as the intersection
// of two conics (Finsterwalder 1903; Haralick et al., IJCV 1994) in RANSAC (Fischler and Bolles 1981), refined by
// iteratively re-weighted least squares. Frames: points in the world, pixels of level 0.
#pragma once

#include <Eigen/Core>
#include <array>
#include <random>
#include <span>
#include <vector>

#include "solver/pose_refinement.h"

namespace parallax {

// Poses camera_from_world that put the three points (world, not on one line) onto the three rays (camera, any length),
// in front of the camera along the ray. At most four, each meets the three rays to rounding; returns how many. 0 for
// triples that are degenerate (points on one line or coincident, a ray without direction, anything not finite).
int solve_three_points(const std::array<Eigen::Vector3d, 3>& points, const std::array<Eigen::Vector3d, 3>& rays,
                       std::array<RigidTransform, 4>* poses);

struct AbsolutePoseOptions {
  int max_hypotheses = 1000;
  // The matches come best first: hypotheses are made of the best ones first, of all from the middle on (after PROSAC,
  // Chum and Matas, CVPR 2005).
  bool best_first = false;
  // Empty, or for each match by what angle the image has turned between where the point was described and here
  // (radians, any number of full turns): those that one pose explains turn alike, so that hypotheses are made of three
  // that differ from the first of them by max_turn_difference at most.
  std::span<const double> turns;
  double max_turn_difference = 0.5;
  double inlier_sigmas = 4.0;  // a match agrees within so many of its own sigma_px
  int min_inliers = 12;
  // Probability that as many matches agree by chance, over all hypotheses tried, above which the pose is refused
  // (a-contrario RANSAC, Moisan and Stival, IJCV 2004; pixels of wrong matches taken as spread over the image).
  double max_false_alarm = 1e-4;
};

struct AbsolutePoseSummary {
  bool ok = false;
  int inliers = 0;
};

// Deterministic for a given generator state. Thread-safe. Matches that are not finite, or outside the lens's domain,
// are left out. The pose is written only when ok.
AbsolutePoseSummary solve_absolute_pose(const CameraModel& camera, std::span<const PoseObservation> matches,
                                        const AbsolutePoseOptions& options, std::mt19937_64* rng,
                                        RigidTransform* camera_from_world);

}  // namespace parallax
