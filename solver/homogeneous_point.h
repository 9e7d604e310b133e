// Points as homogeneous four-vectors (x, y, z, w) of unit norm, and how they and unit quaternions are moved (McDonald
// et al., multi-session visual SLAM, section 4; the exponential map is Grassia's, 1998). The unit sphere of R^4 is a
// group under the quaternion product, with (x, y, z) as the vector and w as the scalar part, and covers both the points
// of projective space and the rotations twice: p and -p are one.
//
// A Euclidean point is lambda (x, y, z, 1); w = 0 is a point at infinity, a direction. Frames and units are the
// caller's. Plain functions, safe from any thread.
#pragma once

#include <Eigen/Core>

#include "core/se3.h"
#include "core/stereo_camera.h"

namespace parallax {

using Matrix43d = Eigen::Matrix<double, 4, 3>;
using Matrix36d = Eigen::Matrix<double, 3, 6>;

// exp(d) = (1/2 sinc(|d| / 2) d, cos(|d| / 2)), any d; and the product p q of quaternions stored (x, y, z, w).
Eigen::Vector4d sphere_exp(const Eigen::Vector3d& d);
Eigen::Vector4d sphere_product(const Eigen::Vector4d& p, const Eigen::Vector4d& q);

// p exp(d), brought back to unit norm; and its derivative with respect to d at zero.
Eigen::Vector4d move_on_sphere(const Eigen::Vector4d& p, const Eigen::Vector3d& d);
Matrix43d sphere_tangent(const Eigen::Vector4d& p);

// A pose moved by (v, w) from the left: exp(w) its rotation, exp(w) t + v its translation. Of the inverse, the camera's
// place in the window, that is the quaternion's update q exp(-w). Agrees with RigidTransform::exp() to first order.
RigidTransform move_pose(const Vector6d& d, const RigidTransform& pose);

// The point in the camera's frame, homogeneous as it was: (R (x, y, z) + w t, w).
Eigen::Vector4d camera_point(const RigidTransform& camera_from_window, const Eigen::Vector4d& point);

// The measurement (u_left, u_right, v) that a camera of the pair makes of a homogeneous point, whatever its sign and
// wherever it is but on the plane z = 0 of the camera: false there. Derivatives, when asked for, with respect to
// move_pose() and move_on_sphere(). At infinity the translation's part is zero and u_left = u_right.
bool project_homogeneous(const StereoCamera& camera, const RigidTransform& camera_from_window,
                         const Eigen::Vector4d& point, Eigen::Vector3d* pixel, Matrix36d* d_pose = nullptr,
                         Eigen::Matrix3d* d_point = nullptr);

}  // namespace parallax
