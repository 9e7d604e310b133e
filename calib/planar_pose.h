// Poses of a flat target: homographies and what they become through a lens. Pure functions, safe from any thread.
//
// Frames: target (z = 0 on the target, metres) and camera.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/camera_model.h"
#include "core/se3.h"

namespace parallax {

// The homography that takes `from` to `to`, by the direct linear transform on normalised points (Hartley and Zisserman,
// algorithm 4.2). False with fewer than 4 points or when they lie on a line.
bool find_homography(std::span<const Eigen::Vector2d> from, std::span<const Eigen::Vector2d> to, Eigen::Matrix3d* h);

// The pose of a flat target from points on it and their pixels: closed form from the homography of rays (Zhang 2000,
// section 3.1), then least squares on the pixels from both tilts that look alike (Schweighofer and Pinz 2006). `rms_px`
// is over the two coordinates' length. False when too few points (6) have rays, or nothing fits.
bool find_planar_pose(const CameraModel& camera, std::span<const Eigen::Vector3d> points,
                      std::span<const Eigen::Vector2d> pixels, RigidTransform* camera_from_target, double* rms_px);

// Least squares on pixels from a start (Levenberg-Marquardt, Huber kernel of the given width in pixels; 0: none).
// Returns the rms length of the residuals, infinite when points do not project.
double refine_pose(const CameraModel& camera, std::span<const Eigen::Vector3d> points,
                   std::span<const Eigen::Vector2d> pixels, double huber_px, int iterations,
                   RigidTransform* camera_from_target);

}  // namespace parallax
