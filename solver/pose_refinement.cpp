#include "solver/pose_refinement.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>

#include "solver/schur_solver.h"
#include "solver/solver_kernels.h"

namespace parallax {
namespace {

using solver::kLanePadding;
using solver::kPoseSums;

// Structure of arrays, kept by the thread between calls.
struct Scratch {
  std::vector<double> values;
  std::vector<float> sample;
};

// A pivot below this part of its diagonal means that the pose is not determined.
constexpr double kSmallestPivot = 1e-11;

// Cholesky factorisation of a 6x6 matrix scaled to a unit diagonal.
class ScaledCholesky {
 public:
  bool factor(const Matrix6d& a) {
    for (int i = 0; i < 6; ++i) {
      if (!(a(i, i) > 0) || !std::isfinite(a(i, i))) return false;
      scale_[i] = 1.0 / std::sqrt(a(i, i));
    }
    for (int j = 0; j < 6; ++j)
      for (int i = j; i < 6; ++i) {
        double s = a(i, j) * scale_[i] * scale_[j];
        for (int k = 0; k < j; ++k) s -= l_(i, k) * l_(j, k);
        if (i == j) {
          if (!(s > kSmallestPivot)) return false;
          l_(j, j) = std::sqrt(s);
        } else {
          l_(i, j) = s / l_(j, j);
        }
      }
    return true;
  }
  Vector6d solve(const Vector6d& b) const {
    Vector6d x = b.cwiseProduct(scale_);
    for (int i = 0; i < 6; ++i) {
      for (int k = 0; k < i; ++k) x[i] -= l_(i, k) * x[k];
      x[i] /= l_(i, i);
    }
    for (int i = 5; i >= 0; --i) {
      for (int k = i + 1; k < 6; ++k) x[i] -= l_(k, i) * x[k];
      x[i] /= l_(i, i);
    }
    return x.cwiseProduct(scale_);
  }
  Matrix6d inverse() const {
    Matrix6d m;
    for (int i = 0; i < 6; ++i) m.col(i) = solve(Vector6d::Unit(i));
    return 0.5 * (m + m.transpose());
  }

 private:
  Matrix6d l_ = Matrix6d::Zero();
  Vector6d scale_;
};

class PoseRefiner {
 public:
  PoseRefiner(const CameraModel& camera, std::span<const PoseObservation> observations, const PoseOptions& options,
              const RigidTransform& start, Scratch& scratch)
      : options_(options),
        start_(start),
        pose_(start),
        lens_(lens_of(camera)),
        kernels_(solver::solver_kernels(lens_.lens)),
        scratch_(scratch),
        n_(static_cast<int>(observations.size())) {
    const int padded = (n_ + kLanePadding - 1) / kLanePadding * kLanePadding;
    const auto stride = static_cast<std::size_t>(padded);
    constexpr std::size_t kArrays = 6 + 3 + 12;
    if (scratch_.values.size() < kArrays * stride) scratch_.values.resize(kArrays * stride);
    double* v = scratch_.values.data();
    for (int i = 0; i < padded; ++i) {
      const bool real = i < n_;
      const PoseObservation& o = observations[static_cast<std::size_t>(real ? i : 0)];
      const bool good = real && o.point.allFinite() && o.pixel.allFinite() && o.sigma_px > 0;
      v[i] = good ? o.point.x() : 0;
      v[padded + i] = good ? o.point.y() : 0;
      v[2 * padded + i] = good ? o.point.z() : 0;
      v[3 * padded + i] = good ? o.pixel.x() : 0;
      v[4 * padded + i] = good ? o.pixel.y() : 0;
      v[5 * padded + i] = good ? 1.0 / o.sigma_px : 0;
    }
    job_.lens = lens_;
    job_.count = job_.stride = padded;
    job_.x = v;
    job_.y = v + padded;
    job_.z = v + 2 * padded;
    job_.u = v + 3 * padded;
    job_.v = v + 4 * padded;
    job_.inverse_sigma = v + 5 * padded;
    job_.ru = v + 6 * padded;
    job_.rv = v + 7 * padded;
    job_.squared = v + 8 * padded;
    job_.jacobian = v + 9 * padded;
  }

  bool run() {
    const int full_every = std::max(1, options_.full_projection_every);
    for (int k = 0; k < options_.iterations; ++k) {
      if (k % full_every == 0) project();
      estimate_sigma();
      if (!accumulate()) return false;
      const Vector6d mu = -cholesky_.solve(gradient_);
      if (!mu.allFinite()) return false;
      pose_ = RigidTransform::exp(mu) * pose_;
      // The last increment is followed by a projection anyway.
      if (k + 1 < options_.iterations && (k + 1) % full_every != 0) kernels_.pose_advance(job_, mu.data());
    }
    pose_.orthonormalise();
    project();
    estimate_sigma();
    return accumulate();
  }

  const RigidTransform& pose() const { return pose_; }

  PoseSummary summary() const {
    PoseSummary s;
    s.ok = true;
    s.sigma = sigma_;
    s.inliers = static_cast<int>(sums_[30]);
    // A^-1 B A^-1 of the M-estimator with A, B in proportion to the weighted normal matrix, by sample means.
    double variance = sigma_ * sigma_;
    if (options_.kernel != RobustKernel::none && sums_[29] > 0 && s.inliers > 3)
      variance = 0.5 * sums_[27] * sums_[28] / (sums_[29] * sums_[29]) * s.inliers / (s.inliers - 3.0);
    variance = std::max(variance, options_.min_sigma * options_.min_sigma);
    ScaledCholesky information;
    if (information.factor(data_normal_ / variance + options_.prior_information)) s.covariance = information.inverse();
    return s;
  }

  void weights(std::vector<float>* out) const {
    out->resize(static_cast<std::size_t>(n_));
    const double c2 = width_squared();
    for (int i = 0; i < n_; ++i)
      (*out)[static_cast<std::size_t>(i)] =
          job_.squared[i] < solver::kUnusedSquared
              ? static_cast<float>(kernel_weight(options_.kernel, job_.squared[i] / c2))
              : 0.f;
  }

 private:
  // Finding a lens's domain takes a while: kept while the camera stays the same.
  static const solver::LensParameters& lens_of(const CameraModel& camera) {
    static thread_local std::optional<std::pair<CameraModel, solver::LensParameters>> kept;
    if (!kept || !(kept->first == camera)) kept.emplace(camera, solver::lens_parameters(camera));
    return kept->second;
  }

  double width_squared() const {
    const double c = kernel_width(options_.kernel) * sigma_;
    return c * c;
  }

  void project() {
    for (int i = 0; i < 3; ++i) {
      for (int k = 0; k < 3; ++k) job_.pose[3 * i + k] = pose_.R(i, k);
      job_.pose[9 + i] = pose_.t[i];
    }
    kernels_.pose_project(job_);
  }

  // The median moves little from one iteration to the next: look for it among the values near the last one first.
  void estimate_sigma() {
    constexpr float kBracket = 1.3f;
    auto& sample = scratch_.sample;
    sample.resize(static_cast<std::size_t>(job_.count));
    const float low = static_cast<float>(median_) / kBracket, high = static_cast<float>(median_) * kBracket;
    std::size_t below = 0, inside = 0, usable = 0;
    if (median_ > 0) {
      for (int i = 0; i < job_.count; ++i) {
        const float s = static_cast<float>(job_.squared[i]);
        sample[inside] = s;
        inside += (s >= low) & (s <= high);
        below += s < low;
        usable += s < static_cast<float>(solver::kUnusedSquared);
      }
    }
    const std::size_t lower_rank = usable % 2 == 1 ? usable / 2 : usable / 2 - 1;
    if (usable == 0 || lower_rank < below || usable / 2 >= below + inside) {
      below = inside = 0;
      for (int i = 0; i < job_.count; ++i) {
        sample[inside] = static_cast<float>(job_.squared[i]);
        inside += job_.squared[i] < solver::kUnusedSquared;
      }
      usable = inside;
    }
    median_ = median_squared(std::span<float>(sample).first(inside), below, usable);
    sigma_ = std::max(options_.min_sigma, sigma_from_median(median_, static_cast<int>(usable)));
  }

  bool accumulate() {
    const int kind = options_.kernel == RobustKernel::tukey ? 2 : options_.kernel == RobustKernel::huber ? 1 : 0;
    kernels_.pose_normal(job_, {kind, width_squared()}, sums_);
    const double* s = sums_;
    for (int r = 0; r < 6; ++r)
      for (int c = r; c < 6; ++c) data_normal_(r, c) = data_normal_(c, r) = *s++;
    for (int r = 0; r < 6; ++r) gradient_[r] = *s++;
    if (sums_[30] < 3) return false;
    Matrix6d normal = data_normal_;
    if (!options_.prior_information.isZero(0)) {
      const Matrix6d prior = sigma_ * sigma_ * options_.prior_information;
      normal += prior;
      gradient_ += prior * (pose_ * start_.inverse()).log();
    }
    return cholesky_.factor(normal);
  }

  const PoseOptions& options_;
  const RigidTransform start_;
  RigidTransform pose_;
  const solver::LensParameters& lens_;
  const solver::SolverKernels& kernels_;
  Scratch& scratch_;
  const int n_;
  solver::PoseJob job_;
  double median_ = 0, sigma_ = 1;
  double sums_[kPoseSums] = {};
  Matrix6d data_normal_;
  Vector6d gradient_;
  ScaledCholesky cholesky_;
};

}  // namespace

PoseSummary refine_pose(const CameraModel& camera, std::span<const PoseObservation> observations,
                        const PoseOptions& options, RigidTransform* camera_from_world, std::vector<float>* weight) {
  static thread_local Scratch scratch;
  if (weight) weight->assign(observations.size(), 0.f);
  if (observations.size() < 3) return {};
  PoseRefiner refiner(camera, observations, options, *camera_from_world, scratch);
  if (!refiner.run()) return {};
  *camera_from_world = refiner.pose();
  if (weight) refiner.weights(weight);
  return refiner.summary();
}

}  // namespace parallax
