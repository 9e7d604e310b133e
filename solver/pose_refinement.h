// The camera pose from 2D-3D matches (PTAM §5.4, Eq. 8 and 9): iteratively re-weighted least squares with Tukey's
// biweight and a median-based scale; full non-linear projection and Jacobians only every fourth iteration (PTAM §6.5).
//
// Observations that are not finite, or behind the camera or outside the lens's domain, have zero weight. Safe from any
// thread (scratch memory belongs to the thread and is kept, so that a call does not allocate once it is warm).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/camera_model.h"
#include "core/se3.h"
#include "solver/robust_kernel.h"

namespace parallax {

struct PoseObservation {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  // world
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // level 0
  double sigma_px = 1.0;                            // level-0 pixels
};

struct PoseOptions {
  int iterations = 10;            // PTAM §5.4
  int full_projection_every = 4;  // PTAM §6.5
  RobustKernel kernel = RobustKernel::tukey;
  double min_sigma = 0.3;  // lower bound of the robust scale, in units of sigma_px
  // Optional Gaussian prior on the result (left increment of the starting pose): information matrix; zero: none.
  Matrix6d prior_information = Matrix6d::Zero();
};

struct PoseSummary {
  bool ok = false;   // false: fewer than 3 usable observations or a singular system; the pose is unchanged
  double sigma = 0;  // robust standard deviation of the normalised residuals at the end
  int inliers = 0;   // observations with non-zero weight at the end
  // Of the left increment: inverse of the weighted normal matrix, times the noise variance that an M-estimator of this
  // kernel sees (Huber 1981, ch. 7; sigma^2 when there is no kernel), at least min_sigma^2; prior included.
  Matrix6d covariance = Matrix6d::Zero();
};

// Refines in place. `weight`, when given, receives the final Tukey weight of each observation (0: outlier).
PoseSummary refine_pose(const CameraModel& camera, std::span<const PoseObservation> observations,
                        const PoseOptions& options, RigidTransform* camera_from_world,
                        std::vector<float>* weight = nullptr);

}  // namespace parallax
