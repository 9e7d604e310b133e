#include "mapper/triangulation.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>

#include "mapper/two_view.h"

namespace parallax {

namespace {

// Rays closer to parallel than this give no depth.
constexpr double kParallelRad = 1e-6;

// Squared reprojection error on the planes z = 1 and, when asked for, its Gauss-Newton system. Infinite behind a
// camera.
double reprojection(const RigidTransform& second_from_first, const Eigen::Vector3d& ray1, const Eigen::Vector3d& ray2,
                    const Eigen::Vector3d& point, Eigen::Matrix3d* normal, Eigen::Vector3d* gradient) {
  const Eigen::Vector3d second = second_from_first * point;
  if (!(point.z() > 0) || !(second.z() > 0)) return INFINITY;
  const double w1 = 1.0 / point.z(), w2 = 1.0 / second.z();
  const Eigen::Vector2d u1 = point.head<2>() * w1, u2 = second.head<2>() * w2;
  const Eigen::Vector2d r1 = u1 - ray1.head<2>(), r2 = u2 - ray2.head<2>();
  if (normal != nullptr) {
    Eigen::Matrix<double, 2, 3> j1, j2;
    j1 << w1, 0, -w1 * u1.x(), 0, w1, -w1 * u1.y();
    j2 << w2, 0, -w2 * u2.x(), 0, w2, -w2 * u2.y();
    j2 = (j2 * second_from_first.R).eval();
    *normal = j1.transpose() * j1 + j2.transpose() * j2;
    *gradient = j1.transpose() * r1 + j2.transpose() * r2;
  }
  return r1.squaredNorm() + r2.squaredNorm();
}

}  // namespace

double parallax_angle(const RigidTransform& second_from_first, const Eigen::Vector3d& ray1,
                      const Eigen::Vector3d& ray2) {
  const Eigen::Vector3d a = second_from_first.R * ray1;
  return std::atan2(a.cross(ray2).norm(), a.dot(ray2));
}

bool ray_depths(const RigidTransform& second_from_first, const Eigen::Vector3d& ray1, const Eigen::Vector3d& ray2,
                double* depth1, double* depth2) {
  // depth2 ray2 = depth1 R ray1 + t in the least-squares sense.
  const Eigen::Vector3d a = second_from_first.R * ray1;
  const Eigen::Vector3d normal = a.cross(ray2);
  const double n2 = normal.squaredNorm();
  if (!(n2 > kParallelRad * kParallelRad * a.squaredNorm() * ray2.squaredNorm())) return false;
  *depth1 = -second_from_first.t.cross(ray2).dot(normal) / n2;
  *depth2 = -second_from_first.t.cross(a).dot(normal) / n2;
  return true;
}

bool triangulate(const RigidTransform& second_from_first, const Eigen::Vector3d& ray1, const Eigen::Vector3d& ray2,
                 Eigen::Vector3d* point) {
  Eigen::Vector3d a = (second_from_first.R * ray1).normalized(), b = ray2.normalized();
  const double baseline = second_from_first.t.norm();
  if (!(baseline > 0) || !(a.cross(b).norm() > kParallelRad)) return false;
  // The plane through the baseline that is nearest to both rays: among the normals perpendicular to t, the one that
  // minimises (n a)^2 + (n b)^2, the smaller eigenvector of a 2x2 matrix.
  const Eigen::Vector3d axis = second_from_first.t / baseline;
  const Eigen::Vector3d e1 = axis.unitOrthogonal(), e2 = axis.cross(e1);
  const double a1 = e1.dot(a), a2 = e2.dot(a), b1 = e1.dot(b), b2 = e2.dot(b);
  const double m11 = a1 * a1 + b1 * b1, m22 = a2 * a2 + b2 * b2, m12 = a1 * a2 + b1 * b2;
  const double angle = 0.5 * std::atan2(2.0 * m12, m11 - m22);  // of the larger eigenvector
  const Eigen::Vector3d n = -std::sin(angle) * e1 + std::cos(angle) * e2;
  a -= n.dot(a) * n;
  b -= n.dot(b) * n;
  // Both rays now lie in that plane and meet.
  const Eigen::Vector3d cross = a.cross(b);
  const double cross2 = cross.squaredNorm();
  if (!(cross2 > kParallelRad * kParallelRad)) return false;
  const double range = -second_from_first.t.cross(b).dot(cross) / cross2;  // along a, from camera 1
  Eigen::Vector3d x = second_from_first.R.transpose() * (range * a);

  Eigen::Matrix3d normal;
  Eigen::Vector3d gradient;
  const double before = reprojection(second_from_first, ray1, ray2, x, &normal, &gradient);
  if (!std::isfinite(before)) return false;
  const Eigen::Vector3d refined = x - normal.ldlt().solve(gradient);
  if (refined.allFinite() && reprojection(second_from_first, ray1, ray2, refined, nullptr, nullptr) <= before)
    x = refined;
  *point = x;
  return true;
}

}  // namespace parallax
