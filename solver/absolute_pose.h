// The camera pose from 2D-3D matches without a prior: three-point algorithm (Grunert 1841, in the form of Haralick et al., IJCV
// 1994) in RANSAC (Fischler and Bolles 1981), refined by iteratively re-weighted least squares.
#pragma once

#include <Eigen/Core>
#include <array>
#include <random>
#include <span>
#include <vector>

#include "solver/pose_refinement.h"

namespace parallax {

// Poses camera_from_world that put the three points (world, not on one line) onto the three rays (camera, any length, z
// forward). At most four; returns how many.
int solve_three_points(const std::array<Eigen::Vector3d, 3>& points, const std::array<Eigen::Vector3d, 3>& rays,
                       std::array<RigidTransform, 4>* poses);

struct AbsolutePoseOptions {
  int max_hypotheses = 300;
  double inlier_sigmas = 4.0;   // a match agrees within so many of its own sigma_px
  int min_inliers = 12;
};

struct AbsolutePoseSummary {
  bool ok = false;
  int inliers = 0;
};

// Deterministic for a given generator state. Thread-safe. The pose is written only when ok.
AbsolutePoseSummary solve_absolute_pose(const CameraModel& camera, std::span<const PoseObservation> matches,
                                        const AbsolutePoseOptions& options, std::mt19937_64* rng,
                                        RigidTransform* camera_from_world);

}  // namespace parallax
