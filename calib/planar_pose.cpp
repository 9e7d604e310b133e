#include "calib/planar_pose.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>
#include <limits>

#include "solver/robust_kernel.h"

namespace parallax {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// Moves the centroid to the origin and the mean distance to sqrt 2.
Eigen::Matrix3d normaliser(std::span<const Eigen::Vector2d> points) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const auto& p : points) mean += p;
  mean /= static_cast<double>(points.size());
  double distance = 0;
  for (const auto& p : points) distance += (p - mean).norm();
  const double s = distance > 0 ? std::sqrt(2.0) * static_cast<double>(points.size()) / distance : 1;
  Eigen::Matrix3d n;
  n << s, 0, -s * mean.x(), 0, s, -s * mean.y(), 0, 0, 1;
  return n;
}

// The cost of a pose: Huber on the length, outside the domain as if a hundred widths away.
double pose_cost(const CameraModel& camera, std::span<const Eigen::Vector3d> points,
                 std::span<const Eigen::Vector2d> pixels, double huber_px, const RigidTransform& pose) {
  const double c2 = huber_px > 0 ? huber_px * huber_px : 1;
  double cost = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    Eigen::Vector2d px;
    if (!camera.project(pose * points[i], &px)) {
      cost += 1e4 * c2;
      continue;
    }
    const double r2 = (px - pixels[i]).squaredNorm();
    cost += huber_px > 0 ? c2 * huber_cost(r2 / c2) : r2;
  }
  return cost;
}

}  // namespace

bool find_homography(std::span<const Eigen::Vector2d> from, std::span<const Eigen::Vector2d> to, Eigen::Matrix3d* h) {
  if (from.size() < 4 || from.size() != to.size()) return false;
  const Eigen::Matrix3d n_from = normaliser(from), n_to = normaliser(to);
  Eigen::Matrix<double, 9, 9> ata = Eigen::Matrix<double, 9, 9>::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector3d a = n_from * from[i].homogeneous();
    const Eigen::Vector3d b = n_to * to[i].homogeneous();
    Eigen::Matrix<double, 2, 9> row = Eigen::Matrix<double, 2, 9>::Zero();
    row.block<1, 3>(0, 0) = a.transpose();
    row.block<1, 3>(0, 6) = -b.x() * a.transpose();
    row.block<1, 3>(1, 3) = a.transpose();
    row.block<1, 3>(1, 6) = -b.y() * a.transpose();
    ata += row.transpose() * row;
  }
  const Eigen::JacobiSVD<Eigen::Matrix<double, 9, 9>> svd(ata, Eigen::ComputeFullV);
  if (!(svd.singularValues()(7) > 1e-12 * svd.singularValues()(0))) return false;
  const Eigen::Matrix<double, 9, 1> v = svd.matrixV().col(8);
  Eigen::Matrix3d normalised;
  normalised << v(0), v(1), v(2), v(3), v(4), v(5), v(6), v(7), v(8);
  *h = n_to.inverse() * normalised * n_from;
  return h->allFinite() && std::abs(h->determinant()) > 0;
}

double refine_pose(const CameraModel& camera, std::span<const Eigen::Vector3d> points,
                   std::span<const Eigen::Vector2d> pixels, double huber_px, int iterations,
                   RigidTransform* camera_from_target) {
  const double c2 = huber_px > 0 ? huber_px * huber_px : 1;
  double cost = pose_cost(camera, points, pixels, huber_px, *camera_from_target), lambda = 1e-4;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    Matrix6d H = Matrix6d::Zero();
    Vector6d g = Vector6d::Zero();
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d p = *camera_from_target * points[i];
      Eigen::Vector2d px;
      Eigen::Matrix<double, 2, 3> d_point;
      if (!camera.project(p, &px, &d_point)) continue;
      const Eigen::Vector2d r = px - pixels[i];
      const double w = huber_px > 0 ? huber_weight(r.squaredNorm() / c2) : 1;
      const Eigen::Matrix<double, 2, 6> J = CameraModel::pose_jacobian(d_point, p);
      H += w * J.transpose() * J;
      g += w * J.transpose() * r;
    }
    bool better = false;
    double gain = 0;
    for (int attempt = 0; attempt < 8 && !better; ++attempt) {
      Matrix6d damped = H;
      damped.diagonal() *= 1 + lambda;
      damped.diagonal().array() += 1e-12;
      const Vector6d step = damped.ldlt().solve(-g);
      if (!step.allFinite()) return infinity;
      RigidTransform candidate = RigidTransform::exp(step) * *camera_from_target;
      const double new_cost = pose_cost(camera, points, pixels, huber_px, candidate);
      better = new_cost < cost;
      lambda = better ? std::max(lambda * 0.1, 1e-9) : lambda * 10;
      if (!better) continue;
      candidate.orthonormalise();
      *camera_from_target = candidate;
      gain = cost - new_cost;
      cost = new_cost;
    }
    if (!better || gain < 1e-10 * cost) break;
  }
  double sum = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    Eigen::Vector2d px;
    if (!camera.project(*camera_from_target * points[i], &px)) return infinity;
    sum += (px - pixels[i]).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(points.size()));
}

bool find_planar_pose(const CameraModel& camera, std::span<const Eigen::Vector3d> points,
                      std::span<const Eigen::Vector2d> pixels, RigidTransform* camera_from_target, double* rms_px) {
  std::vector<Eigen::Vector2d> plane, rays;
  for (std::size_t i = 0; i < points.size(); ++i) {
    Eigen::Vector3d ray;
    // Rays beyond 80 degrees would rule the homography.
    if (!camera.unproject(pixels[i], &ray) || ray.head<2>().norm() > 5.7) continue;
    plane.push_back(points[i].head<2>());
    rays.push_back(ray.head<2>());
  }
  Eigen::Matrix3d h;
  if (plane.size() < 6 || !find_homography(plane, rays, &h)) return false;
  h /= std::sqrt(h.col(0).norm() * h.col(1).norm());
  // The target is in front: so is its point nearest to the others' middle.
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const auto& p : plane) middle += p / static_cast<double>(plane.size());
  if ((h * middle.homogeneous()).z() < 0) h = -h;
  Eigen::Matrix3d axes;
  axes << h.col(0), h.col(1), h.col(0).cross(h.col(1));
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(axes, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d R = svd.matrixU() * svd.matrixV().transpose();
  if (R.determinant() < 0) return false;
  if (!h.allFinite()) return false;

  double best = infinity;
  const Eigen::Vector3d middle3(middle.x(), middle.y(), 0);
  const RigidTransform first(R, h.col(2));
  // The other tilt: the plane's normal mirrored on the line of sight to the middle of the target.
  const Eigen::Vector3d centre = first * middle3, sight = centre.normalized(), normal = R.col(2);
  const Eigen::Vector3d mirrored = 2 * normal.dot(sight) * sight - normal;
  const Eigen::Matrix3d turn = Eigen::Quaterniond::FromTwoVectors(normal, mirrored).toRotationMatrix();
  const RigidTransform second(turn * R, centre - turn * R * middle3);
  for (RigidTransform pose : {first, second}) {
    const double rms = refine_pose(camera, points, pixels, 0, 15, &pose);
    if (!(rms < best)) continue;
    best = rms;
    *camera_from_target = pose;
  }
  *rms_px = best;
  return std::isfinite(best);
}

}  // namespace parallax
