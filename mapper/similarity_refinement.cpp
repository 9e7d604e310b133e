#include "mapper/similarity_refinement.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "solver/robust_kernel.h"

namespace parallax {
namespace {

constexpr int kRefinementIterations = 12;
constexpr double kLeastSigma = 0.5;  // of the kernel, in standard deviations of a measurement
constexpr double kStepTolerance = 1e-10;
constexpr int kParameters = 7;  // translation, rotation, logarithm of the scale

using Vector7d = Eigen::Matrix<double, kParameters, 1>;
using Matrix7d = Eigen::Matrix<double, kParameters, kParameters>;

// Two directions across a unit ray.
Eigen::Matrix<double, 3, 2> across(const Eigen::Vector3d& ray) {
  Eigen::Matrix<double, 3, 2> out;
  const Eigen::Vector3d other = std::abs(ray.x()) < 0.7 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
  out.col(0) = ray.cross(other).normalized();
  out.col(1) = ray.cross(Eigen::Vector3d(out.col(0)));
  return out;
}

// Sine of the angle between what is seen and the ray, in standard deviations.
double normalised_error(const PlacePoint& seen, const Eigen::Vector3d& in_camera) {
  const double length = in_camera.norm();
  const double cosine = seen.ray.dot(in_camera);
  if (!(cosine > 0)) return std::numeric_limits<double>::infinity();
  return seen.ray.cross(in_camera).norm() / length * seen.pixels_per_radian / seen.sigma_px;
}

struct ErrorRow {
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, kParameters> jacobian;
  bool ok = false;
};

// `d_point`: of the point in the view's world with respect to the parameters.
ErrorRow row_of(const PlacePoint& seen, const RigidTransform& camera, const Eigen::Vector3d& point,
                const Eigen::Matrix<double, 3, kParameters>& d_point) {
  ErrorRow out;
  const Eigen::Vector3d q = camera * point;
  const double length = q.norm();
  if (!(seen.ray.dot(q) > 0)) return out;
  const Eigen::Vector3d u = q / length;
  const Eigen::Matrix<double, 2, 3> basis = across(seen.ray).transpose() * (seen.pixels_per_radian / seen.sigma_px);
  out.residual = basis * u;
  const Eigen::Matrix3d d_u = (Eigen::Matrix3d::Identity() - u * u.transpose()) / length;
  out.jacobian = basis * d_u * camera.R * d_point;
  out.ok = true;
  return out;
}

}  // namespace

PairError pair_error(const PlaceView& a, const PlaceView& b, const RowPair& pair, const SimilarityTransform& a_from_b,
                     const SimilarityTransform& b_from_a) {
  const PlacePoint& pa = a.points[static_cast<std::size_t>(pair.first)];
  const PlacePoint& pb = b.points[static_cast<std::size_t>(pair.second)];
  return {normalised_error(pa, a.cameras[static_cast<std::size_t>(pa.view)] * (a_from_b * pb.position)),
          normalised_error(pb, b.cameras[static_cast<std::size_t>(pb.view)] * (b_from_a * pa.position))};
}

double refine_similarity(const PlaceView& a, const PlaceView& b, std::span<const RowPair> pairs, bool fixed_scale,
                         SimilarityTransform* a_from_b) {
  double sigma = 0;
  std::vector<ErrorRow> rows;
  std::vector<double> squared;
  for (int iteration = 0; iteration < kRefinementIterations; ++iteration) {
    rows.clear();
    squared.clear();
    const SimilarityTransform b_from_a = a_from_b->inverse();
    for (const RowPair& pair : pairs) {
      const PlacePoint& pa = a.points[static_cast<std::size_t>(pair.first)];
      const PlacePoint& pb = b.points[static_cast<std::size_t>(pair.second)];
      // a_from_b' = exp(d) a_from_b: a point x of a moves by v + w x + ds x, one of b against it.
      const auto motion = [](const Eigen::Vector3d& x) {
        Eigen::Matrix<double, 3, kParameters> out;
        out << Eigen::Matrix3d::Identity(), -hat(x), x;
        return out;
      };
      const Eigen::Vector3d moved = *a_from_b * pb.position;
      rows.push_back(row_of(pa, a.cameras[static_cast<std::size_t>(pa.view)], moved, motion(moved)));
      const Eigen::Matrix3d back = -b_from_a.s * b_from_a.R;
      rows.push_back(
          row_of(pb, b.cameras[static_cast<std::size_t>(pb.view)], b_from_a * pa.position, back * motion(pa.position)));
    }
    for (const ErrorRow& row : rows)
      if (row.ok) squared.push_back(row.residual.squaredNorm());
    if (squared.size() < 2 * kParameters) return 0;
    sigma = std::max(kLeastSigma, robust_sigma_2d(squared, kParameters));
    const double width2 = kTukeyWidth * kTukeyWidth * sigma * sigma;
    Matrix7d normal = Matrix7d::Zero();
    Vector7d right = Vector7d::Zero();
    for (const ErrorRow& row : rows) {
      if (!row.ok) continue;
      const double weight = tukey_weight(row.residual.squaredNorm() / width2);
      if (weight == 0) continue;
      normal += weight * row.jacobian.transpose() * row.jacobian;
      right -= weight * row.jacobian.transpose() * row.residual;
    }
    if (fixed_scale) {
      normal.row(6).setZero();
      normal.col(6).setZero();
      normal(6, 6) = 1;
      right[6] = 0;
    }
    const Eigen::LDLT<Matrix7d> solver(normal);
    if (solver.info() != Eigen::Success || !solver.isPositive()) return 0;
    const Vector7d step = solver.solve(right);
    if (!step.allFinite()) return 0;
    const SimilarityTransform change(std::exp(step[6]), exp_so3(step.segment<3>(3)), step.head<3>());
    *a_from_b = change * *a_from_b;
    if (step.norm() < kStepTolerance) break;
  }
  RigidTransform turn(a_from_b->R, Eigen::Vector3d::Zero());
  turn.orthonormalise();
  a_from_b->R = turn.R;
  return sigma;
}

}  // namespace parallax
