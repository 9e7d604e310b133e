#include "solver/homogeneous_point.h"

#include <cmath>

namespace parallax {

Eigen::Vector4d sphere_exp(const Eigen::Vector3d& d) {
  const double squared = d.squaredNorm(), angle = 0.5 * std::sqrt(squared);
  // 1/2 sinc(angle), by its series where the quotient loses digits.
  const double factor = squared < 1e-6 ? 0.5 - squared / 48 + squared * squared / 3840 : 0.5 * std::sin(angle) / angle;
  Eigen::Vector4d q;
  q << factor * d, std::cos(angle);
  return q;
}

Eigen::Vector4d sphere_product(const Eigen::Vector4d& p, const Eigen::Vector4d& q) {
  const Eigen::Vector3d a = p.head<3>(), b = q.head<3>();
  Eigen::Vector4d out;
  out << p.w() * b + q.w() * a + a.cross(b), p.w() * q.w() - a.dot(b);
  return out;
}

Eigen::Vector4d move_on_sphere(const Eigen::Vector4d& p, const Eigen::Vector3d& d) {
  return sphere_product(p, sphere_exp(d)).normalized();
}

Matrix43d sphere_tangent(const Eigen::Vector4d& p) {
  Matrix43d tangent;
  tangent.topRows<3>() = 0.5 * (p.w() * Eigen::Matrix3d::Identity() + hat(p.head<3>()));
  tangent.bottomRows<1>() = -0.5 * p.head<3>().transpose();
  return tangent;
}

RigidTransform move_pose(const Vector6d& d, const RigidTransform& pose) {
  const Eigen::Matrix3d turn = exp_so3(d.tail<3>());
  return {turn * pose.R, turn * pose.t + d.head<3>()};
}

Eigen::Vector4d camera_point(const RigidTransform& camera_from_window, const Eigen::Vector4d& point) {
  Eigen::Vector4d out;
  out << camera_from_window.R * point.head<3>() + point.w() * camera_from_window.t, point.w();
  return out;
}

bool project_homogeneous(const StereoCamera& camera, const RigidTransform& camera_from_window,
                         const Eigen::Vector4d& point, Eigen::Vector3d* pixel, Matrix36d* d_pose,
                         Eigen::Matrix3d* d_point) {
  const Eigen::Vector4d p = camera_point(camera_from_window, point);
  if (!(std::abs(p.z()) > 1e-9 * p.norm())) return false;
  const double inverse = 1 / p.z(), fx = camera.focal_px.x(), fy = camera.focal_px.y();
  const double left = p.x() * inverse, right = (p.x() - camera.baseline_m * p.w()) * inverse, down = p.y() * inverse;
  *pixel = {fx * left + camera.centre_px.x(), fx * right + camera.centre_px.x(), fy * down + camera.centre_px.y()};
  if (!d_pose && !d_point) return true;
  // With respect to the homogeneous point in the camera's frame.
  Eigen::Matrix<double, 3, 4> d_camera;
  d_camera << fx, 0, -fx * left, 0, fx, 0, -fx * right, -fx * camera.baseline_m, 0, fy, -fy * down, 0;
  d_camera *= inverse;
  if (d_pose) {
    d_pose->leftCols<3>() = p.w() * d_camera.leftCols<3>();
    d_pose->rightCols<3>() = -d_camera.leftCols<3>() * hat(p.head<3>());
  }
  if (d_point) {
    const Matrix43d tangent = sphere_tangent(point);
    Matrix43d moved;
    moved.topRows<3>() = camera_from_window.R * tangent.topRows<3>() + camera_from_window.t * tangent.bottomRows<1>();
    moved.bottomRows<1>() = tangent.bottomRows<1>();
    *d_point = d_camera * moved;
  }
  return true;
}

}  // namespace parallax
