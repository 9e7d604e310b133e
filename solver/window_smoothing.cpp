#include "solver/window_smoothing.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "solver/window_system.h"

namespace parallax {
namespace {

solver::WindowSystem& scratch() {
  thread_local solver::WindowSystem system;
  return system;
}

}  // namespace

WindowSummary smooth_window(WindowProblem* problem, const WindowOptions& options, const Interruption& stop,
                            std::vector<std::uint8_t>* outlier) {
  WindowSummary summary;
  solver::WindowSystem& system = scratch();
  if (!system.load(*problem, options, problem->pose_fixed)) {
    summary.failed = true;
    return summary;
  }
  double radius = options.initial_trust_radius, cost = 0;
  bool moved = false, fresh = true;  // fresh: the state has not been linearised
  while (summary.iterations < options.max_iterations && !summary.converged) {
    if ((summary.stopped = stop.requested())) break;
    if (fresh) {
      summary.sigma = system.find_sigma();
      cost = system.cost(summary.sigma);
      if (!system.linearise(summary.sigma)) {
        summary.failed = !moved;
        break;
      }
      fresh = false;
      if ((summary.stopped = stop.requested())) break;
    }
    const DogLegStep step = system.choose_step(radius);
    const double largest = system.make_trial(step), trial = system.trial_cost(summary.sigma);
    if (!std::isfinite(largest)) {
      summary.failed = !moved;
      break;
    }
    ++summary.iterations;
    summary.dog_leg_steps += step.along_d != 0;
    const double fell = cost - trial;
    radius = dog_leg_radius(radius, step.length, step.gain > 0 ? fell / step.gain : 0);
    if (fell >= 0) {
      system.accept();
      moved = fresh = true;
      summary.converged = fell <= options.relative_cost_tolerance * cost;
    }
    // A gain that is lost in the rounding of the cost will not be found by a shorter step either.
    summary.converged |= largest < options.step_tolerance || !(step.gain > 1e-15 * cost);
  }
  if (summary.failed) return summary;
  if (fresh) summary.sigma = system.find_sigma();
  summary.initial_cost = system.first_cost(summary.sigma);
  summary.final_cost = system.cost(summary.sigma);
  system.store(problem, moved);
  if (outlier) system.find_outliers(summary.sigma, outlier);
  return summary;
}

bool window_covariance(const WindowProblem& problem, const WindowOptions& options,
                       const std::vector<std::pair<int, int>>& pairs, std::vector<Matrix6d>* covariances) {
  PARALLAX_CHECK(problem.pose_fixed.size() == problem.poses.size(), "poses and pose_fixed of different size");
  const auto first = std::find_if(problem.pose_fixed.begin(), problem.pose_fixed.end(), [](auto f) { return f != 0; });
  const int gauge = first == problem.pose_fixed.end() ? 0 : static_cast<int>(first - problem.pose_fixed.begin());
  std::vector<std::uint8_t> fixed(problem.poses.size(), 0);
  if (!fixed.empty()) fixed[static_cast<std::size_t>(gauge)] = 1;
  solver::WindowSystem& system = scratch();
  if (!system.load(problem, options, fixed)) return false;
  system.drop_outliers(system.find_sigma());
  Eigen::MatrixXd all;
  if (!system.invert(&all)) return false;
  const auto known = [&](int pose) { return pose == gauge || system.observed(pose); };
  std::vector<Matrix6d> out;
  for (const auto& [a, b] : pairs) {
    const int poses = static_cast<int>(problem.poses.size());
    PARALLAX_CHECK(a >= 0 && b >= 0 && a < poses && b < poses, "covariance of no pair of poses");
    if (!known(a) || !known(b)) return false;
    const auto block = [&](int i, int j) -> Matrix6d {
      if (i == gauge || j == gauge) return Matrix6d::Zero();
      return all.block<6, 6>(6 * system.slot(i), 6 * system.slot(j));
    };
    // exp(d_b) b_from_a exp(-d_a) = exp(d_b - Ad d_a) b_from_a.
    const RigidTransform b_from_a =
        problem.poses[static_cast<std::size_t>(b)] * problem.poses[static_cast<std::size_t>(a)].inverse();
    const Matrix6d Ad = b_from_a.adjoint(), crossed = block(b, a) * Ad.transpose();
    const Matrix6d sum = block(b, b) - crossed - crossed.transpose() + Ad * block(a, a) * Ad.transpose();
    out.push_back(0.5 * (sum + sum.transpose()));
  }
  *covariances = std::move(out);
  return true;
}

}  // namespace parallax
