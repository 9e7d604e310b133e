// The linear algebra of WindowSystem: points eliminated, the reduced camera system solved densely (a window has some
// twenty poses), the two directions of the dog-leg and the products it needs.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "solver/relative_pose_prior.h"
#include "solver/window_system.h"

namespace parallax::solver {
namespace {

using PoseBlock = Eigen::Map<Eigen::Matrix<double, 6, 8, Eigen::RowMajor>>;

// Two poses' block of the lower triangle in `reduced`.
std::size_t block_offset(std::size_t row, std::size_t column) {
  return (row * (row + 1) / 2 + column) * kWindowBlockStride;
}

}  // namespace

void WindowSystem::reduce(const KernelParameters& kernel) {
  std::fill(pose_blocks_.begin(), pose_blocks_.end(), 0.0);
  std::fill(reduced_.begin(), reduced_.end(), 0.0);
  WindowJob work = job(state_);
  work.kernel = kernel;
  window_kernels().linearise(work);
  add_priors();
  assemble();
}

void WindowSystem::add_priors() {
  prior_blocks_.clear();
  for (const RelativePosePrior& prior : problem_->priors) {
    Matrix6d d_a, d_b;
    const Vector6d e = prior_residual(prior, pose_of(state_, prior.a), pose_of(state_, prior.b), &d_a, &d_b);
    const int a = slot(prior.a), b = slot(prior.b);
    const auto add = [&](int at, const Matrix6d& j) {
      if (at < 0) return;
      PoseBlock block(pose_blocks_.data() + kWindowBlockStride * at);
      const Matrix6d weighted = j.transpose() * prior.information;
      block.leftCols<6>() += weighted * j;
      block.col(6) += weighted * e;
    };
    add(a, d_a);
    add(b, d_b);
    if (a < 0 || b < 0) continue;
    const Matrix6d block = d_b.transpose() * prior.information * d_a;
    if (b > a) {
      prior_blocks_.push_back({b, a, block});
    } else {
      prior_blocks_.push_back({a, b, block.transpose()});
    }
  }
}

void WindowSystem::assemble() {
  const std::size_t slots = pose_at_.size();
  const auto n = static_cast<Eigen::Index>(6 * slots);
  matrix_.resize(n, n);
  right_.resize(n);
  for (std::size_t row = 0; row < slots; ++row)
    for (std::size_t column = 0; column <= row; ++column) {
      const PoseBlock block(reduced_.data() + block_offset(row, column));
      const auto i = static_cast<Eigen::Index>(6 * row), j = static_cast<Eigen::Index>(6 * column);
      matrix_.block<6, 6>(i, j) = block.leftCols<6>();
      if (row != column) continue;
      const PoseBlock own(pose_blocks_.data() + kWindowBlockStride * row);
      matrix_.block<6, 6>(i, i) += own.leftCols<6>();
      right_.segment<6>(i) = -own.col(6) - block.col(6);
    }
  for (const PriorBlock& prior : prior_blocks_) matrix_.block<6, 6>(6 * prior.row, 6 * prior.column) += prior.block;
}

// Cholesky's factors in factor_; with a little on the diagonal, more each time, when a pivot is lost in the rounding of
// what it started from: a frame that nothing holds, a pose that sees points at infinity alone.
bool WindowSystem::factor() {
  const Eigen::Index n = matrix_.rows();
  Eigen::VectorXd own(n);
  for (Eigen::Index i = 0; i < n; ++i)
    own[i] = pose_blocks_[static_cast<std::size_t>(i / 6 * kWindowBlockStride + i % 6 * 9)];
  if (!own.allFinite() || !right_.allFinite()) return false;
  const double largest = n > 0 ? own.maxCoeff() : 0;
  if (n > 0 && !(largest > 0)) own.setOnes();  // nothing pulls at any pose: they stay
  own = own.cwiseMax(1e-4 * largest);
  for (double ridge = 0; ridge<1; ridge = ridge> 0 ? 100 * ridge : 1e-9) {
    factor_ = matrix_;
    factor_.diagonal() += ridge * own;
    Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(factor_);
    if (llt.info() == Eigen::Success && (factor_.diagonal().array().square() > 1e-13 * own.array()).all()) {
      ridge_ = ridge;
      return true;
    }
  }
  return false;
}

bool WindowSystem::linearise(double sigma) {
  const double width = window_kernel_width(options_.kernel) * sigma;
  const int kind = options_.kernel == RobustKernel::huber ? 1 : options_.kernel == RobustKernel::tukey ? 2 : 0;
  reduce({kind, width * width});
  return factor() && find_gauss_newton();
}

bool WindowSystem::find_gauss_newton() {
  const std::size_t slots = pose_at_.size(), points = state_.points.size();
  if (slots > 0) {
    factor_.triangularView<Eigen::Lower>().solveInPlace(right_);
    factor_.triangularView<Eigen::Lower>().transpose().solveInPlace(right_);
  }
  newton_.assign(8 * slots, 0.0);
  newton_white_.resize(3 * points);
  descent_found_ = false;
  inner_ = {};
  for (std::size_t slot = 0; slot < slots; ++slot) {
    const Vector6d h = right_.segment<6>(static_cast<Eigen::Index>(6 * slot));
    std::copy(h.data(), h.data() + 6, newton_.begin() + static_cast<std::ptrdiff_t>(8 * slot));
    const PoseBlock own(pose_blocks_.data() + kWindowBlockStride * slot);
    inner_.hh += h.dot(own.leftCols<6>() * h);
    inner_.gh += own.col(6).dot(h);
  }
  window_kernels().substitute(job(state_), newton_.data(), newton_white_.data());
  for (std::size_t i = 0; i < points; ++i)
    for (std::size_t c = 0; c < 3; ++c) {
      const double y = newton_white_[3 * i + c];
      inner_.hh += y * y;
      inner_.gh += point_data_[i * kWindowPointStride + 6 + c] * y;
    }
  return std::isfinite(inner_.hh) && std::isfinite(inner_.gh);
}

// Steepest descent in the norm of the diagonal blocks M: d = -M^-1 g, d^T H d = g^T M^-1 g + what couples blocks,
// twice.
void WindowSystem::find_descent() {
  const std::size_t slots = pose_at_.size(), points = state_.points.size();
  descent_.assign(8 * slots, 0.0);
  descent_white_.resize(3 * points);
  double squared = 0, coupled = 0;
  const double floor = 1e-12 * (slots > 0 ? *std::max_element(pose_blocks_.begin(), pose_blocks_.end()) : 0);
  for (std::size_t slot = 0; slot < slots; ++slot) {
    const PoseBlock own(pose_blocks_.data() + kWindowBlockStride * slot);
    Matrix6d block = own.leftCols<6>();
    const Vector6d scale = block.diagonal();
    block.diagonal() += std::max(ridge_, 1e-12) * scale + Vector6d::Constant(floor);
    const Vector6d d = -block.ldlt().solve(Vector6d(own.col(6)));
    if (!d.allFinite()) continue;
    std::copy(d.data(), d.data() + 6, descent_.begin() + static_cast<std::ptrdiff_t>(8 * slot));
    squared -= own.col(6).dot(d);
  }
  for (const PriorBlock& prior : prior_blocks_)
    coupled += Eigen::Map<const Vector6d>(descent_.data() + 8 * prior.row)
                   .dot(prior.block * Eigen::Map<const Vector6d>(descent_.data() + 8 * prior.column));
  window_kernels().substitute(job(state_), descent_.data(), descent_white_.data());
  for (std::size_t i = 0; i < points; ++i)
    for (std::size_t c = 0; c < 3; ++c) {
      const double gradient = point_data_[i * kWindowPointStride + 6 + c];
      squared += gradient * gradient;
      coupled += (descent_white_[3 * i + c] + gradient) * gradient;
      descent_white_[3 * i + c] = -gradient;
    }
  inner_.dd = squared;
  inner_.gd = -squared;
  inner_.dh = -inner_.gh;
  inner_.d_h_d = squared + 2 * coupled;
  descent_found_ = true;
}

DogLegStep WindowSystem::choose_step(double radius) {
  if (inner_.hh > radius * radius && !descent_found_) find_descent();
  if (descent_.size() != newton_.size()) descent_.assign(newton_.size(), 0.0);
  if (descent_white_.size() != newton_white_.size()) descent_white_.assign(newton_white_.size(), 0.0);
  return dog_leg_step(inner_, radius);
}

bool WindowSystem::invert(Eigen::MatrixXd* covariance) {
  reduce({0, 1});
  const Eigen::Index n = matrix_.rows();
  Eigen::MatrixXd full = matrix_.selfadjointView<Eigen::Lower>();
  Eigen::VectorXd own(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    own[i] = pose_blocks_[static_cast<std::size_t>(i / 6 * kWindowBlockStride + i % 6 * 9)];
    if (!(own.segment(i / 6 * 6, i % 6 + 1).array() == 0).all() || i % 6 != 5) continue;
    full.block<6, 6>(i - 5, i - 5).setIdentity();  // nothing is known of it: observed() says so
    own.segment<6>(i - 5).setOnes();
  }
  // The frames of the two halves of a pose differ: scaled to a unit diagonal before its pivots are judged.
  const Eigen::VectorXd scale = full.diagonal().cwiseSqrt().cwiseInverse();
  if (!scale.allFinite()) return false;
  full = scale.asDiagonal() * full * scale.asDiagonal();
  const Eigen::LLT<Eigen::MatrixXd> llt(full);
  if (llt.info() != Eigen::Success) return false;
  if (!(llt.matrixLLT().diagonal().array().square() > 1e-13).all()) return false;
  *covariance = scale.asDiagonal() * llt.solve(Eigen::MatrixXd::Identity(n, n)) * scale.asDiagonal();
  return covariance->allFinite();
}

bool WindowSystem::observed(int pose) const {
  const int at = slot(pose);
  if (at < 0) return false;
  const double* block = pose_blocks_.data() + kWindowBlockStride * at;
  return std::any_of(block, block + kWindowBlockStride, [](double x) { return x != 0; });
}

}  // namespace parallax::solver
