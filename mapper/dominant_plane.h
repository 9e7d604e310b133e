// The dominant plane of a point cloud: RANSAC over triples, refined by mean and covariance of the consensus set; the
// eigenvector of the smallest eigenvalue is the normal (PTAM §6.1).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <random>
#include <span>
#include <vector>

#include "core/se3.h"

namespace parallax {

struct DominantPlane {
  RigidTransform world_from_plane;   // plane frame: origin at the mean, z up (towards the viewer), the plane is z = 0
  std::vector<std::uint8_t> inlier;  // per point
  int inliers = 0;
  double rms_m = 0;  // distance of the inliers from the plane
};

struct PlaneOptions {
  int hypotheses = 200;
  double threshold_over_depth = 0.02;  // consensus: within this part of the viewer's median distance
  double min_inlier_fraction = 0.25;
  // The last fits take only what is within a third of the threshold: without what lies on the plane and would lift it.
  // For points that are known better than that.
  bool close_fit = false;
};

// `viewer`: a camera centre on the side that z shall point to. The x axis of the plane is the direction of
// `viewer_right` projected into it. Nothing when no plane holds min_inlier_fraction of the points.
std::optional<DominantPlane> find_dominant_plane(std::span<const Eigen::Vector3d> points, const Eigen::Vector3d& viewer,
                                                 const Eigen::Vector3d& viewer_right, const PlaneOptions& options,
                                                 std::mt19937_64* rng);

}  // namespace parallax
