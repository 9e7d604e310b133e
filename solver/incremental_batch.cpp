// Batch optimisation of an incremental pose graph.
#include <algorithm>
#include <utility>
#include <vector>

#include "solver/incremental_state.h"

namespace parallax {
namespace {

using Factor = solver::IncrementalFactor;
using solver::moved;
using solver::Poses;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

}  // namespace

PoseGraphStep IncrementalPoseGraph::State::optimise(const Interruption& stop) {
  PoseGraphStep step;
  // On a copy, with a tree of its own: asked to stop, everything stays as it was.
  State work(options_);
  work.estimates_ = estimates_;
  work.factors_ = factors_;
  work.factors_of_ = factors_of_;
  work.costs_.assign(factors_.size(), 0.0);
  work.stamp_.assign(factors_.size(), 0);
  work.origins_ = estimates_;
  work.steps_.assign(estimates_.size(), Vector6d::Zero());
  work.precision_.assign(6 * estimates_.size(), 0.0);
  work.hold_element_.assign(estimates_.size(), -1);
  std::vector<int> all, everyone(estimates_.size());
  for (std::size_t i = 0; i < estimates_.size(); ++i) {
    everyone[i] = static_cast<int>(i);
    work.gauge_.add_pose();
    work.tree_->add_variable();
  }
  for (std::size_t i = 0; i < factors_.size(); ++i) {
    Factor& f = work.factors_[i];
    f.element = -1;
    f.waiting = false;
    if (!f.active) continue;
    f.element = work.tree_->add_element({f.pose, at(f.count)});
    all.push_back(static_cast<int>(i));
    work.linearise(static_cast<int>(i));
  }
  step.new_factors = static_cast<int>(new_factors_.size() + switched_.size());
  work.held_.clear();
  work.find_held({}, true);
  step.held = static_cast<int>(work.held_.size());

  double cost = work.evaluate(all);
  bool factored = false;
  std::vector<int> changed;
  for (int k = 0; k < options_.batch_iterations && !step.converged; ++k) {
    if (k > 0) {
      work.origins_ = work.estimates_;
      std::fill(work.steps_.begin(), work.steps_.end(), Vector6d::Zero());
      for (const int id : all) work.linearise(id);
      for (const int pose : work.held_) work.tree_->element(work.hold_element_[at(pose)]).row(6).setZero();
      step.relinearised += static_cast<int>(all.size());
    }
    const int last[1] = {static_cast<int>(estimates_.size()) - 1};
    const auto outcome = factored ? work.tree_->refactor(stop) : work.tree_->update(last, stop);
    if (outcome.stopped || stop.requested()) {
      step.stopped = true;
      step.cost = this->cost();
      return step;
    }
    factored = true;
    step.eliminated += outcome.variables;
    step.work += outcome.work;
    step.undetermined = std::max(step.undetermined, outcome.lost);
    ++step.iterations;
    work.tree_->solve(0, &changed);
    // The whole step when the cost allows, else the dog-leg's.
    const Poses before = work.estimates_;
    double gain = 0;
    for (const int id : all) {
      const Factor& f = work.factors_[at(id)];
      for (int i = 0; i < f.count; ++i)
        gain -= 0.5 * f.offset.dot(f.jacobian.middleCols<6>(6 * i) * Vector6d(work.tree_->solution(f.pose[i])));
    }
    // Converged: the poses stay where the factor is that of their covariances.
    step.converged = gain <= options_.batch_stop_below * cost + 1e-18;
    if (step.converged) break;
    for (const int v : changed) {
      work.steps_[at(v)] = work.tree_->solution(v);
      work.estimates_[at(v)] = moved(work.origins_[at(v)], work.steps_[at(v)]);
    }
    double after = work.evaluate(all);
    if (!(after < cost)) {
      for (const int v : changed) {
        work.steps_[at(v)].setZero();
        work.estimates_[at(v)] = before[at(v)];
      }
      step.damped = true;
      if (!work.shorten(changed, all, cost)) break;
      after = work.evaluate(all);
    }
    cost = after;
  }
  for (int v = 0; v < static_cast<int>(estimates_.size()); ++v) {
    work.estimates_[at(v)].orthonormalise();
    if (!step.converged && Vector6d(work.tree_->solution(v)) != work.steps_[at(v)]) work.behind_.push_back(v);
  }
  step.changed = static_cast<int>(changed.size());
  *this = std::move(work);
  for (const double c : costs_) step.cost += c;
  return step;
}

}  // namespace parallax
