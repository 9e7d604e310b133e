// The plane-induced homography between two calibrated views: fit (normalised DLT; Hartley and Zisserman, Multiple View
// Geometry, §4.4), and decomposition into rotation, translation over plane distance, and plane normal (Faugeras and
// Lustman 1988, in the form of Ma, Soatto, Kosecka and Sastry, An Invitation to 3-D Vision, §5.3.3).
//
// Everything is in rays (x, y, 1), not pixels: ray2 ~ H ray1, H = R + (t / d) n^T for the plane n . X = d, d > 0, of
// view 1. Plain functions on plain values; safe from any thread.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

#include "core/se3.h"

namespace parallax {

// Least-squares homography of four or more ray pairs (exact for four), Frobenius norm 1, signed so that most ray pairs
// have ray2 . (H ray1) > 0. False with fewer than four pairs or when three of four (or all but one) are in line.
bool fit_homography(std::span<const Eigen::Vector3d> rays1, std::span<const Eigen::Vector3d> rays2, Eigen::Matrix3d* H);

struct PlanarPose {
  RigidTransform second_from_first;                   // t is in units of the plane's distance from camera 1
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // unit, frame of view 1: n . X = 1 in the same units
};

// The poses that give this homography (its sign as fit_homography() leaves it): two, each with (t, n) and (-t, -n), in
// that order; none when H is (to within 1e-6 of its scale) a pure rotation. Depth signs decide among them: see
// plane_in_front().
int decompose_homography(const Eigen::Matrix3d& H, std::array<PlanarPose, 4>* poses);

// True when the plane lies in front of camera 1 along the ray: the cheirality test of a decomposition.
inline bool plane_in_front(const PlanarPose& pose, const Eigen::Vector3d& ray1) { return pose.normal.dot(ray1) > 0; }

}  // namespace parallax
