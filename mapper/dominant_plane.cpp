#include "mapper/dominant_plane.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace parallax {

namespace {

struct Plane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double offset = 0;  // normal . x = offset
  double distance(const Eigen::Vector3d& p) const { return normal.dot(p) - offset; }
};

// Truncated squared distances, abandoned once they exceed `limit`.
double msac_cost(const Plane& plane, std::span<const Eigen::Vector3d> points, double threshold, double limit) {
  const double truncation = threshold * threshold;
  double cost = 0;
  for (const auto& p : points) {
    const double d = plane.distance(p);
    cost += std::min(d * d, truncation);
    if (cost >= limit) break;
  }
  return cost;
}

// A triple is too thin to give a normal when its area is below this part of its longest side squared.
constexpr double kThinTriangle = 0.02;
// A consensus set is a line when its second standard deviation is below this part of the first.
constexpr double kLine = 0.02;
// The last fits take points within this part of the consensus threshold.
constexpr double kClose = 1.0 / 3.0;
constexpr int kClosePasses = 3;

// Mean and covariance of the points within the threshold: the eigenvector of the smallest eigenvalue is the normal.
// False, and nothing changes, when they are too few or lie on a line.
bool refit(std::span<const Eigen::Vector3d> points, double threshold, Plane* plane, Eigen::Vector3d* centre) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  int count = 0;
  for (const auto& p : points)
    if (std::abs(plane->distance(p)) < threshold) {
      mean += p;
      ++count;
    }
  if (count < 3) return false;
  mean /= count;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const auto& p : points)
    if (std::abs(plane->distance(p)) < threshold) covariance += (p - mean) * (p - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(covariance / count);
  const Eigen::Vector3d variances = eigen.eigenvalues();
  if (!(variances(1) > kLine * kLine * variances(2))) return false;
  plane->normal = eigen.eigenvectors().col(0);
  plane->offset = plane->normal.dot(mean);
  *centre = mean;
  return true;
}

}  // namespace

std::optional<DominantPlane> find_dominant_plane(std::span<const Eigen::Vector3d> all_points,
                                                 const Eigen::Vector3d& viewer, const Eigen::Vector3d& viewer_right,
                                                 const PlaneOptions& options, std::mt19937_64* rng) {
  std::vector<Eigen::Vector3d> points;  // the finite ones
  std::vector<double> distances;
  points.reserve(all_points.size());
  for (const auto& p : all_points)
    if (p.allFinite()) {
      points.push_back(p);
      distances.push_back((p - viewer).norm());
    }
  if (points.size() < 3) return std::nullopt;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  const double threshold = options.threshold_over_depth * *middle;
  if (!(threshold > 0)) return std::nullopt;

  Plane best;
  double best_cost = INFINITY;
  const std::uint64_t n = points.size();
  for (int hypothesis = 0; hypothesis < options.hypotheses; ++hypothesis) {
    const std::uint64_t i = (*rng)() % n, j = (*rng)() % n, k = (*rng)() % n;
    const Eigen::Vector3d a = points[j] - points[i], b = points[k] - points[i];
    Plane plane;
    plane.normal = a.cross(b);
    const double area = plane.normal.norm();
    const double side2 = std::max({a.squaredNorm(), b.squaredNorm(), (a - b).squaredNorm()});
    if (!(area > kThinTriangle * side2)) continue;
    plane.normal /= area;
    plane.offset = plane.normal.dot(points[i]);
    const double cost = msac_cost(plane, points, threshold, best_cost);
    if (cost < best_cost) {
      best_cost = cost;
      best = plane;
    }
  }
  if (!std::isfinite(best_cost)) return std::nullopt;

  // Twice, since the first fit gathers points that the triple's own plane missed.
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (int pass = 0; pass < 2; ++pass)
    if (!refit(points, threshold, &best, &mean)) return std::nullopt;
  for (int pass = 0; options.close_fit && pass < kClosePasses; ++pass)
    if (!refit(points, kClose * threshold, &best, &mean)) break;
  if (best.distance(viewer) < 0) {
    best.normal = -best.normal;
    best.offset = -best.offset;
  }

  DominantPlane out;
  out.inlier.assign(all_points.size(), 0);
  double sum = 0;
  for (std::size_t i = 0; i < all_points.size(); ++i) {
    const double d = best.distance(all_points[i]);
    if (!(std::abs(d) < threshold)) continue;
    out.inlier[i] = 1;
    ++out.inliers;
    sum += d * d;
  }
  if (out.inliers < 3 || out.inliers < options.min_inlier_fraction * static_cast<double>(all_points.size()))
    return std::nullopt;
  out.rms_m = std::sqrt(sum / out.inliers);

  Eigen::Vector3d x = viewer_right - best.normal.dot(viewer_right) * best.normal;
  x = x.norm() > 1e-9 * viewer_right.norm() ? x.normalized() : best.normal.unitOrthogonal();
  out.world_from_plane.R.col(0) = x;
  out.world_from_plane.R.col(1) = best.normal.cross(x);
  out.world_from_plane.R.col(2) = best.normal;
  out.world_from_plane.t = mean;
  return out;
}

}  // namespace parallax
