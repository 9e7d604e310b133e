// The motion of a rectified stereo pair from tracked points (MS §3.1): the three-point algorithm in RANSAC (Fischler
// and Bolles 1981), then Levenberg-Marquardt on the reprojection error in both images, with covariance.
//
// Points are homogeneous (w = 0: at infinity) in the reference frame, poses are camera_from_reference. How far a point
// is away is itself uncertain: `sigma_w` is marginalised in every residual, so that distant points tell the rotation
// and do not bias the translation. Arrays in, numbers out; deterministic for a given generator state; safe from any
// thread.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "core/se3.h"
#include "core/stereo_camera.h"

namespace parallax {

struct StereoPoseObservation {
  Eigen::Vector4d point = {0, 0, 1, 0};             // reference frame
  double sigma_w = 0;                               // standard deviation of point.w(), the rest held
  Eigen::Vector3d pixel = Eigen::Vector3d::Zero();  // (u_left, u_right, v); u_right NaN: the left image alone
  double sigma_px = 0.3;
};

struct StereoPoseOptions {
  int max_hypotheses = 200;
  double inlier_sigmas = 5;  // agreement within RANSAC
  double miss_probability = 1e-3;
  int iterations = 12;
  double min_scale = 0.5;  // of the robust scale, in units of sigma_px
};

struct StereoPoseSummary {
  bool ok = false;  // false: fewer than 6 agree, or singular; the pose is unchanged
  int inliers = 0;
  int hypotheses = 0;
  double scale = 1;                        // robust standard deviation of the normalised residuals
  Matrix6d covariance = Matrix6d::Zero();  // of a left increment of the pose, translation first
};

// The pose that most observations agree with: of the guesses, and of hypotheses from three points each. `inlier` gets a
// 1 a observation that agrees. ok when at least 6 do.
StereoPoseSummary find_stereo_pose(const StereoCamera& camera, std::span<const StereoPoseObservation> observations,
                                   std::span<const RigidTransform> guesses, const StereoPoseOptions& options,
                                   std::mt19937_64* rng, RigidTransform* camera_from_reference,
                                   std::vector<std::uint8_t>* inlier);

// Refines in place with Tukey's kernel. `inlier` (may be null) gets a 1 for each with weight at the end.
StereoPoseSummary refine_stereo_pose(const StereoCamera& camera, std::span<const StereoPoseObservation> observations,
                                     const StereoPoseOptions& options, RigidTransform* camera_from_reference,
                                     std::vector<std::uint8_t>* inlier);

}  // namespace parallax
