#include "core/se3.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "core/check.h"

namespace parallax {

Eigen::Matrix3d hat(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

namespace {

// sin(a)/a, (1-cos a)/a^2, (a - sin a)/a^3 with series near zero.
struct Coefficients {
  double a, b, c;
};

Coefficients rodrigues_coefficients(double theta2) {
  if (theta2 < 1e-8) {
    return {1.0 - theta2 / 6.0, 0.5 - theta2 / 24.0, 1.0 / 6.0 - theta2 / 120.0};
  }
  const double theta = std::sqrt(theta2);
  const double s = std::sin(theta), half = std::sin(0.5 * theta);
  return {s / theta, 2.0 * half * half / theta2, (theta - s) / (theta2 * theta)};
}

}  // namespace

Eigen::Matrix3d exp_so3(const Eigen::Vector3d& w) {
  const auto k = rodrigues_coefficients(w.squaredNorm());
  const Eigen::Matrix3d W = hat(w);
  return Eigen::Matrix3d::Identity() + k.a * W + k.b * W * W;
}

Eigen::Vector3d log_so3(const Eigen::Matrix3d& R) {
  // Through the quaternion: well conditioned at every angle, pi included.
  Eigen::Quaterniond q(R);
  q.normalize();
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  const double n = q.vec().norm();
  if (n < 1e-10) return 2.0 * q.vec();
  return q.vec() * (2.0 * std::atan2(n, q.w()) / n);
}

RigidTransform RigidTransform::exp(const Vector6d& mu) {
  const Eigen::Vector3d v = mu.head<3>(), w = mu.tail<3>();
  const auto k = rodrigues_coefficients(w.squaredNorm());
  const Eigen::Matrix3d W = hat(w), W2 = W * W;
  RigidTransform out;
  out.R = Eigen::Matrix3d::Identity() + k.a * W + k.b * W2;
  out.t = v + k.b * (W * v) + k.c * (W2 * v);
  return out;
}

Vector6d RigidTransform::log() const {
  const Eigen::Vector3d w = log_so3(R);
  const double theta2 = w.squaredNorm();
  double d = 1.0 / 12.0 + theta2 / 720.0;
  if (theta2 > 1e-6) {
    const double theta = std::sqrt(theta2), half = 0.5 * theta;
    d = (1.0 - half * std::cos(half) / std::sin(half)) / theta2;
  }
  const Eigen::Matrix3d W = hat(w);
  Vector6d out;
  out.head<3>() = t - 0.5 * (W * t) + d * (W * (W * t));
  out.tail<3>() = w;
  return out;
}

Matrix6d RigidTransform::adjoint() const {
  Matrix6d m;
  m.topLeftCorner<3, 3>() = R;
  m.topRightCorner<3, 3>() = hat(t) * R;
  m.bottomLeftCorner<3, 3>().setZero();
  m.bottomRightCorner<3, 3>() = R;
  return m;
}

void RigidTransform::orthonormalise() { R = Eigen::Quaterniond(R).normalized().toRotationMatrix(); }

bool align_points(const Eigen::Matrix3Xd& src, const Eigen::Matrix3Xd& dst, bool with_scale,
                  SimilarityTransform* dst_from_src) {
  PARALLAX_CHECK(src.cols() == dst.cols(), "point sets of different size");
  const auto n = src.cols();
  if (n < 3) return false;
  const Eigen::Vector3d mean_src = src.rowwise().mean(), mean_dst = dst.rowwise().mean();
  const Eigen::Matrix3Xd a = src.colwise() - mean_src, b = dst.colwise() - mean_dst;
  const double variance = a.squaredNorm() / static_cast<double>(n);
  if (!(variance > 0)) return false;
  const Eigen::Matrix3d covariance = b * a.transpose() / static_cast<double>(n);
  Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d d = svd.singularValues();
  if (!(d(1) > 1e-12 * d(0)) || !d.allFinite()) return false;
  Eigen::Vector3d sign(1, 1, 1);
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) sign(2) = -1;
  dst_from_src->R = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  dst_from_src->s = with_scale ? d.dot(sign) / variance : 1.0;
  dst_from_src->t = mean_dst - dst_from_src->s * (dst_from_src->R * mean_src);
  return true;
}

}  // namespace parallax
