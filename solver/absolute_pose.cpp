#include "solver/absolute_pose.h"

#include <Eigen/Geometry>
#include <cmath>
#include <complex>

namespace parallax {
namespace {

// Real roots of c[4] x^4 + ... + c[0] by Durand-Kerner iteration on all four at once, then Newton steps.
int real_quartic_roots(const std::array<double, 5>& c, std::array<double, 4>* roots) {
  double scale = 0;
  for (double v : c) scale = std::max(scale, std::abs(v));
  if (!(std::abs(c[4]) > 1e-14 * scale)) return 0;
  using Complex = std::complex<double>;
  const auto value = [&](Complex x) { return (((c[4] * x + c[3]) * x + c[2]) * x + c[1]) * x + c[0]; };
  std::array<Complex, 4> z = {Complex(1, 0), Complex(0.4, 0.9), Complex(-0.65, 0.72), Complex(-0.908, -0.297)};
  for (int iteration = 0; iteration < 60; ++iteration) {
    double change = 0;
    for (int i = 0; i < 4; ++i) {
      Complex product = c[4];
      for (int j = 0; j < 4; ++j)
        if (j != i) product *= z[i] - z[j];
      const Complex step = value(z[i]) / product;
      z[i] -= step;
      change = std::max(change, std::abs(step) / (1.0 + std::abs(z[i])));
    }
    if (!(change > 1e-13)) break;
  }
  int n = 0;
  for (const Complex& root : z) {
    if (!(std::abs(root.imag()) < 1e-4 * (1.0 + std::abs(root.real())))) continue;
    double x = root.real();
    for (int k = 0; k < 2; ++k) {
      const double slope = ((4 * c[4] * x + 3 * c[3]) * x + 2 * c[2]) * x + c[1];
      if (std::abs(slope) > 1e-300) x -= value(x).real() / slope;
    }
    (*roots)[n++] = x;
  }
  return n;
}

// Orthonormal frame of a triangle.
bool triad(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c, Eigen::Matrix3d* frame) {
  const Eigen::Vector3d ab = b - a, normal = ab.cross(c - a);
  if (!(normal.norm() > 1e-9 * ab.squaredNorm())) return false;
  frame->col(0) = ab.normalized();
  frame->col(2) = normal.normalized();
  frame->col(1) = frame->col(2).cross(frame->col(0));
  return true;
}

}  // namespace

int solve_three_points(const std::array<Eigen::Vector3d, 3>& points, const std::array<Eigen::Vector3d, 3>& rays,
                       std::array<RigidTransform, 4>* poses) {
  const Eigen::Vector3d f1 = rays[0].normalized(), f2 = rays[1].normalized(), f3 = rays[2].normalized();
  const double a2 = (points[1] - points[2]).squaredNorm(), b2 = (points[0] - points[2]).squaredNorm(),
               c2 = (points[0] - points[1]).squaredNorm();
  if (!(b2 > 0) || !(c2 > 0) || !(a2 > 0)) return 0;
  const double ca = f2.dot(f3), cb = f1.dot(f3), cg = f1.dot(f2);
  const double d = (a2 - c2) / b2, s = (a2 + c2) / b2, c2b = c2 / b2, a2b = a2 / b2;
  // With u = s2 / s1 and v = s3 / s1 (distances along the rays), a quartic in v.
  const std::array<double, 5> quartic = {
      (1 + d) * (1 + d) - 4 * a2b * cg * cg,
      4 * (-d * (1 + d) * cb + 2 * a2b * cg * cg * cb - (1 - s) * ca * cg),
      2 * (d * d - 1 + 2 * d * d * cb * cb + 2 * (b2 - c2) / b2 * ca * ca - 4 * s * ca * cb * cg + 2 * (b2 - a2) / b2 * cg * cg),
      4 * (d * (1 - d) * cb - (1 - s) * ca * cg + 2 * c2b * ca * ca * cb),
      (d - 1) * (d - 1) - 4 * c2b * ca * ca};
  std::array<double, 4> roots{};
  const int n_roots = real_quartic_roots(quartic, &roots);
  Eigen::Matrix3d world_frame;
  if (!triad(points[0], points[1], points[2], &world_frame)) return 0;
  int n = 0;
  for (int k = 0; k < n_roots; ++k) {
    const double v = roots[k];
    const double denominator = 2 * (cg - v * ca);
    if (!(v > 0) || std::abs(denominator) < 1e-12) continue;
    const double u = ((-1 + d) * v * v - 2 * d * cb * v + 1 + d) / denominator;
    const double length2 = 1 + v * v - 2 * v * cb;
    if (!(u > 0) || !(length2 > 0)) continue;
    const double s1 = std::sqrt(b2 / length2);
    const Eigen::Vector3d p1 = s1 * f1, p2 = u * s1 * f2, p3 = v * s1 * f3;
    Eigen::Matrix3d camera_frame;
    if (!triad(p1, p2, p3, &camera_frame)) continue;
    RigidTransform pose;
    pose.R = camera_frame * world_frame.transpose();
    pose.t = p1 - pose.R * points[0];
    (*poses)[n++] = pose;
  }
  return n;
}

AbsolutePoseSummary solve_absolute_pose(const CameraModel& camera, std::span<const PoseObservation> matches,
                                        const AbsolutePoseOptions& options, std::mt19937_64* rng,
                                        RigidTransform* camera_from_world) {
  AbsolutePoseSummary summary;
  std::vector<PoseObservation> usable;
  std::vector<Eigen::Vector3d> rays;
  for (const PoseObservation& m : matches) {
    Eigen::Vector3d ray;
    if (!camera.unproject(m.pixel, &ray)) continue;
    usable.push_back(m);
    rays.push_back(ray);
  }
  const std::size_t n = usable.size();
  if (n < static_cast<std::size_t>(std::max(4, options.min_inliers))) return summary;
  const auto inliers_of = [&](const RigidTransform& pose, std::vector<PoseObservation>* kept) {
    int count = 0;
    for (const PoseObservation& m : usable) {
      Eigen::Vector2d pixel;
      if (!camera.project(pose * m.point, &pixel)) continue;
      const double limit = options.inlier_sigmas * m.sigma_px;
      if ((pixel - m.pixel).squaredNorm() > limit * limit) continue;
      ++count;
      if (kept) kept->push_back(m);
    }
    return count;
  };
  RigidTransform best;
  int most = 0;
  // Stops once a sample of three inliers has been drawn with near certainty.
  double needed = options.max_hypotheses;
  for (int k = 0; k < options.max_hypotheses && k < needed; ++k) {
    std::array<std::size_t, 3> pick{};
    for (std::size_t i = 0; i < 3; ++i) pick[i] = static_cast<std::size_t>((*rng)() % n);
    if (pick[0] == pick[1] || pick[0] == pick[2] || pick[1] == pick[2]) continue;
    std::array<RigidTransform, 4> poses;
    const int solutions = solve_three_points({usable[pick[0]].point, usable[pick[1]].point, usable[pick[2]].point},
                                             {rays[pick[0]], rays[pick[1]], rays[pick[2]]}, &poses);
    for (int s = 0; s < solutions; ++s) {
      const int count = inliers_of(poses[s], nullptr);
      if (count <= most) continue;
      most = count;
      best = poses[s];
      const double part = static_cast<double>(most) / static_cast<double>(n);
      needed = std::log(1e-3) / std::log1p(-std::min(0.999, part * part * part));
    }
  }
  if (most < options.min_inliers) return summary;
  for (int round = 0; round < 2; ++round) {
    std::vector<PoseObservation> kept;
    inliers_of(best, &kept);
    if (!refine_pose(camera, kept, PoseOptions{}, &best).ok) return summary;
  }
  summary.inliers = inliers_of(best, nullptr);
  summary.ok = summary.inliers >= options.min_inliers;
  if (summary.ok) *camera_from_world = best;
  return summary;
}

}  // namespace parallax
