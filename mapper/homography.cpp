#include "mapper/homography.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/check.h"

namespace parallax {

namespace {

// A triple of unit rays this close to one plane (its determinant) is a line in the image.
constexpr double kCollinear = 1e-6;

// Weights that make the fourth ray the sum of the first three: the projective frame of four points.
bool projective_frame(std::span<const Eigen::Vector3d> rays, Eigen::Matrix3d* frame) {
  Eigen::Matrix3d m;
  for (int k = 0; k < 3; ++k) m.col(k) = rays[static_cast<std::size_t>(k)].normalized();
  const double det = m.determinant();
  if (!(std::abs(det) > kCollinear)) return false;
  const Eigen::Vector3d weights = m.inverse() * rays[3].normalized();
  if (!(weights.cwiseAbs().minCoeff() * std::abs(det) > kCollinear)) return false;
  *frame = m * weights.asDiagonal();
  return true;
}

// Translation and scale that bring the rays' (x, y) to zero mean and mean distance sqrt(2).
Eigen::Matrix3d normalisation(std::span<const Eigen::Vector3d> rays) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const auto& r : rays) mean += r.hnormalized();
  mean /= static_cast<double>(rays.size());
  double distance = 0;
  for (const auto& r : rays) distance += (r.hnormalized() - mean).norm();
  distance /= static_cast<double>(rays.size());
  const double s = distance > 0 ? std::sqrt(2.0) / distance : 1.0;
  Eigen::Matrix3d T;
  T << s, 0, -s * mean.x(), 0, s, -s * mean.y(), 0, 0, 1;
  return T;
}

}  // namespace

bool fit_homography(std::span<const Eigen::Vector3d> rays1, std::span<const Eigen::Vector3d> rays2,
                    Eigen::Matrix3d* H) {
  PARALLAX_CHECK(rays1.size() == rays2.size(), "ray lists of different length");
  if (rays1.size() < 4) return false;
  Eigen::Matrix3d h;
  if (rays1.size() == 4) {
    Eigen::Matrix3d frame1, frame2;
    if (!projective_frame(rays1, &frame1) || !projective_frame(rays2, &frame2)) return false;
    h = frame2 * frame1.inverse();
  } else {
    const Eigen::Matrix3d T1 = normalisation(rays1), T2 = normalisation(rays2);
    Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
    for (std::size_t i = 0; i < rays1.size(); ++i) {
      const Eigen::Vector3d a = T1 * (rays1[i] / rays1[i].z()), b = T2 * (rays2[i] / rays2[i].z());
      Eigen::Matrix<double, 2, 9> rows;
      rows << a.transpose(), Eigen::RowVector3d::Zero(), -b.x() * a.transpose(), Eigen::RowVector3d::Zero(),
          a.transpose(), -b.y() * a.transpose();
      normal += rows.transpose() * rows;
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> eigen(normal);
    if (!(eigen.eigenvalues()(1) > 1e-10 * eigen.eigenvalues()(8))) return false;
    const Eigen::Matrix<double, 9, 1> v = eigen.eigenvectors().col(0);
    h = T2.inverse() * Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(v.data()) * T1;
  }
  const double norm = h.norm();
  if (!(norm > 0) || !std::isfinite(norm)) return false;
  h /= norm;
  int positive = 0;
  for (std::size_t i = 0; i < rays1.size(); ++i) positive += rays2[i].dot(h * rays1[i]) > 0 ? 1 : -1;
  *H = positive >= 0 ? h : Eigen::Matrix3d(-h);
  return true;
}

int decompose_homography(const Eigen::Matrix3d& H, std::array<PlanarPose, 4>* poses) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(H.transpose() * H);
  Eigen::Vector3d s2 = eigen.eigenvalues().reverse();  // squared singular values, descending
  if (!(s2(1) > 0)) return 0;
  const Eigen::Matrix3d h = H / std::sqrt(s2(1));  // the middle singular value of R + t n^T is one
  s2 /= s2(1);
  const double spread = s2(0) - s2(2);
  if (!(spread > 2e-6)) return 0;
  Eigen::Matrix3d V = eigen.eigenvectors().rowwise().reverse();
  if (V.determinant() < 0) V = -V;
  const Eigen::Vector3d v1 = V.col(0), v2 = V.col(1), v3 = V.col(2);
  const double a = std::sqrt(std::max(0.0, 1.0 - s2(2))), b = std::sqrt(std::max(0.0, s2(0) - 1.0));
  int count = 0;
  for (const double sign : {1.0, -1.0}) {
    // Directions in the plane whose length H keeps.
    const Eigen::Vector3d u = (a * v1 + sign * b * v3) / std::sqrt(spread);
    Eigen::Matrix3d U, W;
    U << v2, u, v2.cross(u);
    W << h * v2, h * u, (h * v2).cross(h * u);
    PlanarPose pose;
    pose.second_from_first.R = W * U.transpose();
    pose.second_from_first.orthonormalise();
    pose.normal = v2.cross(u).normalized();
    pose.second_from_first.t = (h - pose.second_from_first.R) * pose.normal;
    (*poses)[static_cast<std::size_t>(count++)] = pose;
    pose.normal = -pose.normal;
    pose.second_from_first.t = -pose.second_from_first.t;
    (*poses)[static_cast<std::size_t>(count++)] = pose;
  }
  return count;
}

}  // namespace parallax
