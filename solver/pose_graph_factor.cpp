#include "solver/pose_graph_factor.h"

#include <cmath>

namespace parallax::solver {
namespace {

// (1 - (theta/2) cot(theta/2)) / theta^2.
double inverse_coefficient(double theta2) {
  if (theta2 < 1e-4) return 1.0 / 12.0 + theta2 / 720.0 + theta2 * theta2 / 30240.0;
  const double theta = std::sqrt(theta2), half = 0.5 * theta;
  return (1.0 - half * std::cos(half) / std::sin(half)) / theta2;
}

Eigen::Matrix3d inverse_left_jacobian_so3(const Eigen::Vector3d& w) {
  const Eigen::Matrix3d W = hat(w);
  return Eigen::Matrix3d::Identity() - 0.5 * W + inverse_coefficient(w.squaredNorm()) * W * W;
}

Eigen::Matrix3d left_jacobian_so3(const Eigen::Vector3d& w) {
  const double theta2 = w.squaredNorm();
  double b = 0.5 - theta2 / 24.0, c = 1.0 / 6.0 - theta2 / 120.0;
  if (theta2 > 1e-6) {
    const double theta = std::sqrt(theta2), s = std::sin(0.5 * theta);
    b = 2.0 * s * s / theta2;
    c = (theta - std::sin(theta)) / (theta2 * theta);
  }
  const Eigen::Matrix3d W = hat(w);
  return Eigen::Matrix3d::Identity() + b * W + c * W * W;
}

}  // namespace

RigidTransform moved(const RigidTransform& pose, const Vector6d& d) {
  return {pose.R * exp_so3(d.tail<3>()), pose.t + pose.R * d.head<3>()};
}

Vector6d move_between(const RigidTransform& pose, const RigidTransform& to) {
  Vector6d d;
  d.head<3>() = pose.R.transpose() * (to.t - pose.t);
  d.tail<3>() = log_so3(pose.R.transpose() * to.R);
  return d;
}

Matrix6d move_jacobian(const Vector6d& d) {
  Matrix6d J = Matrix6d::Zero();
  J.topLeftCorner<3, 3>() = exp_so3(-d.tail<3>());
  J.bottomRightCorner<3, 3>() = left_jacobian_so3(-d.tail<3>());
  return J;
}

Matrix6d inverse_left_jacobian(const Vector6d& log) {
  // Barfoot, State Estimation for Robotics, 2017, Eqs. 7.86 and 7.95.
  const Eigen::Vector3d v = log.head<3>(), w = log.tail<3>();
  const double theta2 = w.squaredNorm();
  double a, b,
      c;  // (theta - sin)/theta^3, (cos - 1 + theta^2/2)/theta^4, and half of b - 3 (sin - theta + theta^3/6)/theta^5
  if (theta2 < 1e-2) {
    a = 1.0 / 6 - theta2 / 120 + theta2 * theta2 / 5040 - theta2 * theta2 * theta2 / 362880;
    b = 1.0 / 24 - theta2 / 720 + theta2 * theta2 / 40320 - theta2 * theta2 * theta2 / 3628800;
    c = 0.5 * (b - 3 * (1.0 / 120 - theta2 / 5040 + theta2 * theta2 / 362880));
  } else {
    const double theta = std::sqrt(theta2), s = std::sin(theta), k = std::cos(theta);
    a = (theta - s) / (theta2 * theta);
    b = (k - 1 + 0.5 * theta2) / (theta2 * theta2);
    c = 0.5 * (b - 3 * (s - theta + theta2 * theta / 6) / (theta2 * theta2 * theta));
  }
  const Eigen::Matrix3d V = hat(v), W = hat(w), WV = W * V, VW = V * W, WVW = WV * W;
  const Eigen::Matrix3d Q = 0.5 * V + a * (WV + VW + WVW) + b * (W * WV + VW * W - 3 * WVW) + c * (WVW * W + W * WVW);
  const Eigen::Matrix3d inverse = inverse_left_jacobian_so3(w);
  Matrix6d J = Matrix6d::Zero();
  J.topLeftCorner<3, 3>() = inverse;
  J.bottomRightCorner<3, 3>() = inverse;
  J.topRightCorner<3, 3>() = -inverse * Q * inverse;
  return J;
}

Vector6d prior_residual(const RigidTransform& frame_from_pose, const RigidTransform& pose, Matrix6d* d_pose) {
  const Vector6d e = (pose * frame_from_pose.inverse()).log();
  if (d_pose != nullptr) *d_pose = inverse_left_jacobian(-e) * frame_from_pose.adjoint();
  return e;
}

Vector6d constraint_residual(const RigidTransform& from_from_to, const RigidTransform& from, const RigidTransform& to,
                             Matrix6d* d_from, Matrix6d* d_to) {
  const Vector6d e = (from.inverse() * to * from_from_to.inverse()).log();
  if (d_from != nullptr) *d_from = -inverse_left_jacobian(e);
  if (d_to != nullptr) *d_to = inverse_left_jacobian(-e) * from_from_to.adjoint();
  return e;
}

Vector6d encounter_residual(const RigidTransform& from_from_to, const RigidTransform& anchor_from,
                            const RigidTransform& from, const RigidTransform& anchor_to, const RigidTransform& to,
                            Matrix6d* d_anchor_from, Matrix6d* d_from, Matrix6d* d_anchor_to, Matrix6d* d_to) {
  Matrix6d J_from, J_to;
  const Vector6d e = constraint_residual(from_from_to, anchor_from * from, anchor_to * to, &J_from, &J_to);
  // A local increment of the anchor is one of the pose behind it, carried over.
  if (d_anchor_from != nullptr) *d_anchor_from = J_from * from.inverse().adjoint();
  if (d_from != nullptr) *d_from = J_from;
  if (d_anchor_to != nullptr) *d_anchor_to = J_to * to.inverse().adjoint();
  if (d_to != nullptr) *d_to = J_to;
  return e;
}

}  // namespace parallax::solver
