// Structure and motion from two calibrated views: the five-point algorithm with robust sampling, the plane-induced
// homography where the scene is (nearly) planar, and the refusal that says why (PTAM §6.1).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "core/se3.h"

namespace parallax {

struct TwoViewMatch {
  Eigen::Vector2d first = Eigen::Vector2d::Zero();   // level-0 pixels in view 1
  Eigen::Vector2d second = Eigen::Vector2d::Zero();  // in view 2
};

enum class TwoViewStatus { ok, too_few_matches, rotation_only, too_little_parallax, ambiguous, inconsistent };
// One sentence a person at the desk can act on.
const char* describe(TwoViewStatus status);

struct TwoViewOptions {
  double sigma_px = 1.0;  // noise of a match, level 0
  int min_inliers = 50;
  double min_parallax_deg = 1.0;  // median angle between the two rays of the triangulated inliers
  double min_inlier_fraction = 0.6;
  int max_hypotheses = 500;
};

struct TwoViewResult {
  TwoViewStatus status = TwoViewStatus::too_few_matches;
  RigidTransform second_from_first;     // |t| = 1
  std::vector<std::uint8_t> inlier;     // per match
  std::vector<Eigen::Vector3d> points;  // per match, frame of view 1; only where inlier
  double median_parallax_deg = 0;
  double score = 0;     // robust (MSAC-like) score of the winning model in [0, 1]
  bool planar = false;  // the homography explained the matches as well as the essential matrix
};

// Deterministic for a given generator state.
TwoViewResult solve_two_view(const CameraModel& camera, std::span<const TwoViewMatch> matches,
                             const TwoViewOptions& options, std::mt19937_64* rng);

// Point from two rays, midpoint-free: minimises the angular reprojection error to first order, then one Gauss-Newton
// step in pixels. Rays are (x, y, 1) in each camera. False when the rays are parallel to within 1e-6 rad or the point
// is behind one of the cameras. The point is in the frame of camera 1.
bool triangulate(const RigidTransform& second_from_first, const Eigen::Vector3d& ray1, const Eigen::Vector3d& ray2,
                 Eigen::Vector3d* point);

}  // namespace parallax
