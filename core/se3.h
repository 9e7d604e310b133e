// Rigid and similarity transforms. `a_from_b * p_b` takes a point in frame b to frame a, and they chain:
// `a_from_c = a_from_b * b_from_c`. Tangent vectors are (translation, rotation), and updates are left-multiplied,
// as in PTAM Eq. 6: T' = exp(mu) T. Units: metres and radians. Plain values, safe to copy between threads.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace parallax {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

// Skew-symmetric matrix: hat(a) * b = a x b.
Eigen::Matrix3d hat(const Eigen::Vector3d& v);

// Rotation vector (radians) to matrix and back. log_so3 returns an angle in [0, pi].
Eigen::Matrix3d exp_so3(const Eigen::Vector3d& w);
Eigen::Vector3d log_so3(const Eigen::Matrix3d& R);

// An element of SE(3).
struct RigidTransform {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();

  RigidTransform() = default;
  RigidTransform(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation) : R(rotation), t(translation) {}
  RigidTransform(const Eigen::Quaterniond& q, const Eigen::Vector3d& translation)
      : R(q.normalized().toRotationMatrix()), t(translation) {}

  // Exponential map of (v, w), and its inverse.
  static RigidTransform exp(const Vector6d& mu);
  Vector6d log() const;

  RigidTransform inverse() const { return {R.transpose(), -(R.transpose() * t)}; }
  RigidTransform operator*(const RigidTransform& other) const { return {R * other.R, R * other.t + t}; }
  Eigen::Vector3d operator*(const Eigen::Vector3d& p) const { return R * p + t; }
  Eigen::Quaterniond quaternion() const { return Eigen::Quaterniond(R).normalized(); }

  // Adjoint: exp(Ad mu) T = T exp(mu).
  Matrix6d adjoint() const;

  // The nearest proper rotation replaces R; call it after long chains of products.
  void orthonormalise();

  // Angle of the rotation, in [0, pi].
  double angle() const { return log_so3(R).norm(); }
};

// An element of Sim(3): p_a = s R p_b + t.
struct SimilarityTransform {
  double s = 1.0;
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();

  SimilarityTransform() = default;
  SimilarityTransform(double scale, const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation)
      : s(scale), R(rotation), t(translation) {}
  explicit SimilarityTransform(const RigidTransform& T) : R(T.R), t(T.t) {}

  SimilarityTransform inverse() const { return {1.0 / s, R.transpose(), -(R.transpose() * t) / s}; }
  SimilarityTransform operator*(const SimilarityTransform& o) const { return {s * o.s, R * o.R, s * (R * o.t) + t}; }
  Eigen::Vector3d operator*(const Eigen::Vector3d& p) const { return s * (R * p) + t; }

  // A camera pose in the new world: for new_from_old = *this and camera_from_old, gives camera_from_new with the
  // camera's own units rescaled too, so that projections do not change.
  RigidTransform rebase(const RigidTransform& camera_from_old) const {
    const Eigen::Matrix3d rotation = camera_from_old.R * R.transpose();
    return {rotation, s * camera_from_old.t - rotation * t};
  }
};

// Least-squares alignment of point sets, columns matched: minimises sum |dst - (s R src + t)|^2 (Umeyama 1991).
// with_scale false fixes s = 1. Needs at least 3 points that are not on one line; returns false otherwise.
bool align_points(const Eigen::Matrix3Xd& src, const Eigen::Matrix3Xd& dst, bool with_scale,
                  SimilarityTransform* dst_from_src);

}  // namespace parallax
