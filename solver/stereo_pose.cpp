#include "solver/stereo_pose.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "solver/absolute_pose.h"
#include "solver/robust_kernel.h"

namespace parallax {
namespace {

using Matrix36 = Eigen::Matrix<double, 3, 6>;

constexpr double kMinDepthOverScale = 1e-6;  // z of a homogeneous point of unit norm, in front of the camera
constexpr double kFar = 1e-3;                // w below this: too far for the three-point algorithm
constexpr int kLeastAgreeing = 6;

struct Residual {
  Eigen::Vector3d r;            // predicted minus measured
  Eigen::Matrix3d information;  // sigma and the uncertain depth
  double squared = 0;           // Mahalanobis
  int dimensions = 3;
};

// A homogeneous point projects by its first three coordinates whatever its scale; the disparity is f b w / z.
bool residual_of(const StereoCamera& camera, const StereoPoseObservation& o, const RigidTransform& pose, Residual* out,
                 Matrix36* jacobian) {
  const Eigen::Vector3d x = pose.R * o.point.head<3>() + pose.t * o.point.w();
  if (!(x.z() > kMinDepthOverScale)) return false;
  const double iz = 1 / x.z(), fx = camera.focal_px.x(), fy = camera.focal_px.y(), fb = fx * camera.baseline_m;
  const double u = fx * x.x() * iz + camera.centre_px.x(), v = fy * x.y() * iz + camera.centre_px.y();
  const double disparity = fb * o.point.w() * iz;
  const bool both = std::isfinite(o.pixel.y());
  out->r = {u - o.pixel.x(), both ? u - disparity - o.pixel.y() : 0.0, v - o.pixel.z()};
  out->dimensions = both ? 3 : 2;
  // d(u, u_right, v) / dx
  Eigen::Matrix3d d;
  d << fx * iz, 0, -fx * x.x() * iz * iz,                                            //
      both ? fx * iz : 0, 0, both ? (-fx * x.x() + fb * o.point.w()) * iz * iz : 0,  //
      0, fy * iz, -fy * x.y() * iz * iz;
  // d / dw: through the translation, and through the disparity itself.
  Eigen::Vector3d dw = d * pose.t;
  if (both) dw.y() -= fb * iz;
  const double inverse_variance = 1 / (o.sigma_px * o.sigma_px);
  const Eigen::Vector3d a = dw * (o.sigma_w / o.sigma_px);
  out->information = inverse_variance * (Eigen::Matrix3d::Identity() - a * a.transpose() / (1 + a.squaredNorm()));
  if (!both) out->information.row(1).setZero(), out->information.col(1).setZero();
  out->squared = out->r.dot(out->information * out->r);
  if (jacobian != nullptr) {
    jacobian->leftCols<3>() = d * o.point.w();
    jacobian->rightCols<3>() = -d * hat(x);
  }
  return true;
}

bool usable(const StereoPoseObservation& o) {
  return o.point.allFinite() && std::isfinite(o.pixel.x()) && std::isfinite(o.pixel.z()) && o.sigma_px > 0 &&
         o.sigma_w >= 0 && std::isfinite(o.sigma_w);
}

// Truncated squares, less is better.
double score(const StereoCamera& camera, std::span<const StereoPoseObservation> observations, double limit,
             const RigidTransform& pose, double best, int* agree) {
  double total = 0;
  *agree = 0;
  Residual residual;
  for (const StereoPoseObservation& o : observations) {
    if (usable(o) && residual_of(camera, o, pose, &residual, nullptr) && residual.squared < limit) {
      total += residual.squared;
      ++*agree;
    } else {
      total += limit;
    }
    if (total > best) return total;
  }
  return total;
}

// Of Tukey's kernel, squared: three residuals together reach further than one.
double kernel_width2(double scale) { return 1.6 * kTukeyWidth * kTukeyWidth * scale * scale; }

double robust_scale(std::vector<double>* squared_per_dimension) {
  if (squared_per_dimension->empty()) return 1;
  const auto middle = squared_per_dimension->begin() + static_cast<std::ptrdiff_t>(squared_per_dimension->size() / 2);
  std::nth_element(squared_per_dimension->begin(), middle, squared_per_dimension->end());
  // The median of a chi-squared variable with three degrees of freedom is 2.366.
  return std::sqrt(*middle * 3 / 2.366);
}

}  // namespace

StereoPoseSummary find_stereo_pose(const StereoCamera& camera, std::span<const StereoPoseObservation> observations,
                                   std::span<const RigidTransform> guesses, const StereoPoseOptions& options,
                                   std::mt19937_64* rng, RigidTransform* camera_from_reference,
                                   std::vector<std::uint8_t>* inlier) {
  StereoPoseSummary summary;
  const std::size_t n = observations.size();
  const double limit = options.inlier_sigmas * options.inlier_sigmas;
  double best = HUGE_VAL;
  RigidTransform best_pose = *camera_from_reference;
  const auto consider = [&](const RigidTransform& pose) {
    int agree = 0;
    const double value = score(camera, observations, limit, pose, best, &agree);
    if (value >= best) return;
    best = value;
    best_pose = pose;
    summary.inliers = agree;
  };
  for (const RigidTransform& guess : guesses) consider(guess);

  std::vector<std::size_t> near;
  for (std::size_t i = 0; i < n; ++i) {
    const StereoPoseObservation& o = observations[i];
    if (usable(o) && std::abs(o.point.w()) > kFar * o.point.head<3>().norm() && o.point.w() > 3 * o.sigma_w)
      near.push_back(i);
  }
  int wanted = options.max_hypotheses;
  for (int k = 0; k < wanted && near.size() >= 4; ++k) {
    std::array<Eigen::Vector3d, 3> points, rays;
    std::array<std::size_t, 3> drawn{};
    for (std::size_t j = 0; j < 3; ++j) {
      do drawn[j] = near[(*rng)() % near.size()];
      while ((j > 0 && drawn[j] == drawn[0]) || (j > 1 && drawn[j] == drawn[1]));
      const StereoPoseObservation& o = observations[drawn[j]];
      points[j] = o.point.head<3>() / o.point.w();
      rays[j] = camera.ray({o.pixel.x(), o.pixel.z()});
    }
    std::array<RigidTransform, 4> poses;
    const int found = solve_three_points(points, rays, &poses);
    for (int i = 0; i < found; ++i) consider(poses[static_cast<std::size_t>(i)]);
    ++summary.hypotheses;
    // As many as make it unlikely that three that agree were never drawn together.
    const double share = static_cast<double>(summary.inliers) / static_cast<double>(n);
    const double all_three = share * share * share;
    if (all_three >= 1) break;
    if (all_three > 0) {
      const double needed = std::log(options.miss_probability) / std::log1p(-all_three);
      wanted = std::min(options.max_hypotheses, static_cast<int>(std::ceil(std::min(needed, 1e6))));
    }
  }
  inlier->assign(n, 0);
  if (summary.inliers < kLeastAgreeing) return summary;
  *camera_from_reference = best_pose;
  summary.ok = true;
  Residual residual;
  for (std::size_t i = 0; i < n; ++i)
    (*inlier)[i] = usable(observations[i]) && residual_of(camera, observations[i], best_pose, &residual, nullptr) &&
                   residual.squared < limit;
  return summary;
}

StereoPoseSummary refine_stereo_pose(const StereoCamera& camera, std::span<const StereoPoseObservation> observations,
                                     const StereoPoseOptions& options, RigidTransform* camera_from_reference,
                                     std::vector<std::uint8_t>* inlier) {
  StereoPoseSummary summary;
  const std::size_t n = observations.size();
  std::vector<std::uint8_t> used(n);
  for (std::size_t i = 0; i < n; ++i) used[i] = usable(observations[i]);
  RigidTransform pose = *camera_from_reference;
  Residual residual;
  Matrix36 jacobian;
  std::vector<double> squared;
  double scale = 1;
  const auto find_scale = [&] {
    squared.clear();
    for (std::size_t i = 0; i < n; ++i)
      if (used[i] && residual_of(camera, observations[i], pose, &residual, nullptr))
        squared.push_back(residual.squared / residual.dimensions);
    scale = std::max(options.min_scale, robust_scale(&squared));
  };
  const auto cost_of = [&](const RigidTransform& at, Matrix6d* normal, Vector6d* gradient, int* inliers) {
    const double width2 = kernel_width2(scale);
    double cost = 0;
    if (normal != nullptr) normal->setZero(), gradient->setZero(), *inliers = 0;
    for (std::size_t i = 0; i < n; ++i) {
      if (!used[i]) continue;
      if (!residual_of(camera, observations[i], at, &residual, normal != nullptr ? &jacobian : nullptr)) {
        cost += width2 / 3;
        continue;
      }
      const double part = residual.squared / width2;
      cost += width2 * tukey_cost(part);
      const double weight = tukey_weight(part);
      if (normal == nullptr || weight <= 0) continue;
      const Eigen::Matrix<double, 6, 3> weighted = weight * jacobian.transpose() * residual.information;
      *normal += weighted * jacobian;
      *gradient += weighted * residual.r;
      ++*inliers;
    }
    return cost;
  };
  Matrix6d normal;
  Vector6d gradient;
  int inliers = 0;
  double lambda = 1e-4;
  find_scale();
  double cost = cost_of(pose, &normal, &gradient, &inliers);
  for (int iteration = 0; iteration < options.iterations; ++iteration) {
    if (inliers < kLeastAgreeing) return summary;
    Matrix6d damped = normal;
    damped.diagonal() *= 1 + lambda;
    const Vector6d step = -damped.ldlt().solve(gradient);
    if (!step.allFinite()) return summary;
    const RigidTransform next = RigidTransform::exp(step) * pose;
    const double next_cost = cost_of(next, nullptr, nullptr, nullptr);
    if (next_cost <= cost) {
      pose = next;
      lambda = std::max(1e-9, 0.1 * lambda);
      find_scale();
      cost = cost_of(pose, &normal, &gradient, &inliers);
      if (step.norm() < 1e-7) break;
    } else {
      lambda *= 10;
      if (lambda > 1e6) break;
    }
  }
  const Eigen::LDLT<Matrix6d> solver(normal);
  if (inliers < kLeastAgreeing || solver.info() != Eigen::Success || !(solver.vectorD().minCoeff() > 0)) return summary;
  pose.orthonormalise();
  // What the residuals really are decides (Huber 1981, section 6.3): inverse (sum of gradients squared) inverse.
  Matrix6d spread = Matrix6d::Zero();
  const double width2 = kernel_width2(scale);
  for (std::size_t i = 0; i < n; ++i) {
    if (!used[i] || !residual_of(camera, observations[i], pose, &residual, &jacobian)) continue;
    const Vector6d pull =
        tukey_weight(residual.squared / width2) * (jacobian.transpose() * (residual.information * residual.r));
    spread += pull * pull.transpose();
  }
  const Matrix6d inverse = solver.solve(Matrix6d::Identity());
  const double few = static_cast<double>(inliers) / std::max(1.0, inliers - 6 / 3.0);
  // Never less than the information itself allows.
  summary.covariance = few * inverse * spread * inverse + options.min_scale * options.min_scale * inverse;
  if (!summary.covariance.allFinite()) return summary;
  summary.ok = true;
  summary.inliers = inliers;
  summary.scale = scale;
  *camera_from_reference = pose;
  if (inlier != nullptr) {
    inlier->assign(n, 0);
    for (std::size_t i = 0; i < n; ++i)
      (*inlier)[i] =
          used[i] && residual_of(camera, observations[i], pose, &residual, nullptr) && residual.squared < width2;
  }
  return summary;
}

}  // namespace parallax
