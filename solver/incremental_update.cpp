// The incremental step: what is new enters the tree, what has left its linear model is linearised anew, and the poses
// move to the solution.
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "solver/dog_leg.h"
#include "solver/incremental_state.h"

namespace parallax {
namespace {

using Factor = solver::IncrementalFactor;
using solver::kLeastWeight;
using solver::moved;
using solver::Steps;

constexpr double kUrgent = 5;               // departures, in thresholds, that are worth another step at once
constexpr double kLargestTurn = 1.5;        // radians from its origin at which a pose gets a new one
constexpr double kLinearisationWork = 1e4;  // multiply-adds that take as long as linearising a factor

std::size_t at(int i) { return static_cast<std::size_t>(i); }

}  // namespace

// At the estimates, for steps from the origins.
void IncrementalPoseGraph::State::linearise(int id) {
  Factor& f = factors_[at(id)];
  Matrix6d d[4];
  f.linearised_at = f.residual(estimates_, d);
  const Vector6d residual = f.whitening * f.linearised_at;
  const double squared = residual.squaredNorm();
  f.weight = f.weight_of(squared);
  const double in_hessian = std::max(f.weight, kLeastWeight), root = std::sqrt(in_hessian);
  f.offset = f.weight / root * residual;
  for (int i = 0; i < f.count; ++i) {
    const Vector6d& step = steps_[at(f.pose[i])];
    Matrix6d J = root * (f.whitening * d[i]);
    if (!step.isZero(0)) {
      J = Matrix6d(J * solver::move_jacobian(step));
      f.offset -= J * step;
    }
    f.jacobian.middleCols<6>(6 * i) = J;
    for (int k = 0; k < 6; ++k) {
      double& precision = precision_[at(6 * f.pose[i] + k)];
      precision = std::max(precision, J.col(k).norm());
    }
  }
  f.departure = 0;
  costs_[at(id)] = f.active ? f.cost_of(squared) : 0;
  write_element(id);
}

void IncrementalPoseGraph::State::write_element(int id) {
  const Factor& f = factors_[at(id)];
  auto element = tree_->element(f.element);
  for (int j = 0; j < f.count; ++j) {
    const Matrix6d Jj = f.jacobian.middleCols<6>(6 * j);
    for (int i = j; i < f.count; ++i)
      element.block<6, 6>(6 * i, 6 * j).noalias() = f.jacobian.middleCols<6>(6 * i).transpose() * Jj;
    element.block<1, 6>(6 * f.count, 6 * j).noalias() = f.offset.transpose() * Jj;
  }
}

// The estimate becomes the origin; all factors of the pose are linearised anew.
void IncrementalPoseGraph::State::give_new_origin(int pose) {
  origins_[at(pose)] = estimates_[at(pose)];
  steps_[at(pose)].setZero();
  tree_->clear_solution(pose);
  for (const int id : factors_of_[at(pose)])
    if (factors_[at(id)].active && factors_[at(id)].element >= 0) {
      tree_->change(factors_[at(id)].element);
      linearise(id);
    }
  if (hold_element_[at(pose)] >= 0) hold(pose);
}

void IncrementalPoseGraph::State::hold(int pose) {
  // As stiff as what is measured there, about where it is.
  double stiffness = 0;
  for (const int id : factors_of_[at(pose)]) {
    const Factor& f = factors_[at(id)];
    if (!f.active) continue;
    for (int i = 0; i < f.count; ++i)
      if (f.pose[i] == pose)
        stiffness = std::max(stiffness, f.jacobian.middleCols<6>(6 * i).colwise().squaredNorm().maxCoeff());
  }
  if (!(stiffness > 0)) stiffness = 1;
  int& element = hold_element_[at(pose)];
  if (element < 0) {
    const int variable[1] = {pose};
    element = tree_->add_element(variable);
  }
  auto values = tree_->element(element);
  values.setZero();
  values.topRows<6>().diagonal().setConstant(stiffness);
  values.row(6) = -stiffness * steps_[at(pose)].transpose();
  tree_->change(element);
}

void IncrementalPoseGraph::State::find_held(const std::vector<int>& touched, bool rebuild) {
  const auto add = [&](const Factor& f) {
    if (!f.active) return;
    if (f.kind == Factor::Kind::prior)
      gauge_.add_prior(f.pose[0]);
    else if (f.kind == Factor::Kind::constraint)
      gauge_.add_constraint(f.pose[0], f.pose[1]);
    else
      gauge_.add_encounter(f.pose[0], f.pose[1], f.pose[2], f.pose[3]);
  };
  std::vector<int> candidates = held_;  // these first: what is held stays held
  if (rebuild) {
    gauge_.clear();
    for (const Factor& f : factors_) add(f);
    for (int i = 0; i < static_cast<int>(estimates_.size()); ++i) candidates.push_back(i);
  } else {
    candidates.insert(candidates.end(), loose_.begin(), loose_.end());
    for (const int id : touched) {
      add(factors_[at(id)]);
      candidates.insert(candidates.end(), factors_[at(id)].pose, factors_[at(id)].pose + factors_[at(id)].count);
    }
  }
  std::vector<std::uint8_t> seen(estimates_.size(), 0);
  loose_.clear();
  for (const int pose : candidates) {
    if (seen[at(pose)] || gauge_.determined(pose)) continue;
    seen[at(pose)] = 1;
    const auto& own = factors_of_[at(pose)];
    if (std::any_of(own.begin(), own.end(), [&](int id) { return factors_[at(id)].active; })) loose_.push_back(pose);
  }
  const std::vector<int> now = gauge_.to_hold(loose_);
  for (const int pose : held_)
    if (std::find(now.begin(), now.end(), pose) == now.end()) tree_->set_active(hold_element_[at(pose)], false);
  for (const int pose : now)
    if (std::find(held_.begin(), held_.end(), pose) == held_.end()) {
      if (hold_element_[at(pose)] >= 0) tree_->set_active(hold_element_[at(pose)], true);
      hold(pose);
    }
  held_ = now;
}

// What was added, switched or set since the last update enters the tree.
void IncrementalPoseGraph::State::take_in(PoseGraphStep* step, std::vector<int>* late) {
  for (const int pose : set_poses_) give_new_origin(pose);
  set_poses_.clear();
  std::vector<int> touched;
  bool rebuild = false;
  for (const int id : switched_) {
    Factor& f = factors_[at(id)];
    if (f.element < 0) {  // new, or off when the tree was made: only what is on has an element
      if (f.active) new_factors_.push_back(id);
      continue;
    }
    if (tree_->active(f.element) == f.active) continue;
    tree_->set_active(f.element, f.active);
    if (f.active) {
      linearise(id);
      touched.push_back(id);
    } else {
      costs_[at(id)] = 0;
      rebuild = true;
    }
    ++step->new_factors;
  }
  switched_.clear();
  for (const int id : new_factors_) {
    Factor& f = factors_[at(id)];
    if (!f.active || f.element >= 0) continue;
    f.element = tree_->add_element({f.pose, at(f.count)});
    linearise(id);
    touched.push_back(id);
    ++step->new_factors;
  }
  new_factors_.clear();
  if (!touched.empty() || rebuild) find_held(touched, rebuild);
  for (const int id : touched)
    late->insert(late->end(), factors_[at(id)].pose, factors_[at(id)].pose + factors_[at(id)].count);
}

void IncrementalPoseGraph::State::change_waiting(double budget, PoseGraphStep* step) {
  std::vector<int> list;
  for (const int id : waiting_) {
    Factor& f = factors_[at(id)];
    if (f.active && f.element >= 0 && f.departure > options_.relinearise_above)
      list.push_back(id);
    else
      f.waiting = false;
  }
  std::sort(list.begin(), list.end(), [&](int a, int b) {
    const double da = factors_[at(a)].departure, db = factors_[at(b)].departure;
    return da != db ? da > db : a < b;
  });
  waiting_.clear();
  double spent = 0;
  for (const int id : list) {
    Factor& f = factors_[at(id)];
    if (!tree_->is_marked(f.element) && spent > budget) {
      waiting_.push_back(id);
      continue;
    }
    spent += tree_->change(f.element) + kLinearisationWork;
    linearise(id);
    f.waiting = false;
    ++step->relinearised;
  }
}

// Costs and departures of factors at the estimates; their sum of costs.
double IncrementalPoseGraph::State::evaluate(const std::vector<int>& factors) {
  double sum = 0;
  for (const int id : factors) {
    Factor& f = factors_[at(id)];
    const Vector6d raw = f.residual(estimates_, nullptr), residual = f.whitening * raw;
    const double squared = residual.squaredNorm(), weight = f.weight_of(squared);
    Vector6d predicted = f.offset;
    for (int i = 0; i < f.count; ++i) predicted += f.jacobian.middleCols<6>(6 * i) * steps_[at(f.pose[i])];
    // Of the residual from its linear model; and of the Jacobian, which changes with the residual by half its
    // commutator.
    const Vector6d since = raw - f.linearised_at;
    f.departure = std::max({(weight / std::sqrt(std::max(f.weight, kLeastWeight)) * residual - predicted).norm(),
                            0.5 * since.tail<3>().norm(), 0.5 * f.lever * since.head<3>().norm()});
    costs_[at(id)] = f.cost_of(squared);
    sum += costs_[at(id)];
  }
  return sum;
}

// Moves the poses to the tree's solution, or as far as the cost allows.
void IncrementalPoseGraph::State::apply(std::vector<int> changed, PoseGraphStep* step) {
  changed.insert(changed.end(), behind_.begin(), behind_.end());
  std::sort(changed.begin(), changed.end());
  changed.erase(std::unique(changed.begin(), changed.end()), changed.end());
  std::vector<int> factors;
  ++stamps_;
  for (const int v : changed)
    for (const int id : factors_of_[at(v)])
      if (factors_[at(id)].active && factors_[at(id)].element >= 0 && stamp_[at(id)] != stamps_) {
        stamp_[at(id)] = stamps_;
        factors.push_back(id);
      }
  double before = 0;
  for (const int id : factors) before += costs_[at(id)];
  Steps old;
  for (const int v : changed) {
    old.push_back(steps_[at(v)]);
    steps_[at(v)] = tree_->solution(v);
    estimates_[at(v)] = moved(origins_[at(v)], steps_[at(v)]);
  }
  behind_.clear();
  // What rises by a hundredth rises for want of linearisation, and falls with the next step.
  const double after = evaluate(factors);
  bool damped = false;
  if (!(after <= 1.01 * before + 1e-3)) {
    for (std::size_t k = 0; k < changed.size(); ++k) {
      steps_[at(changed[k])] = old[k];
      estimates_[at(changed[k])] = moved(origins_[at(changed[k])], old[k]);
    }
    shorten(changed, factors, before);
    behind_ = changed;
    step->damped = damped = true;
  }
  for (const int id : factors) {
    Factor& f = factors_[at(id)];
    if (damped) f.departure = std::max(f.departure, 2 * options_.relinearise_above);
    if (f.departure <= options_.relinearise_above || f.waiting) continue;
    f.waiting = true;
    waiting_.push_back(id);
  }
  step->changed = std::max(step->changed, static_cast<int>(changed.size()));
  for (const int v : changed)
    if (steps_[at(v)].tail<3>().norm() > kLargestTurn) far_.push_back(v);
}

// Powell's dog-leg from the estimates to the tree's solution, within `poses`. False when nothing lowers the cost.
bool IncrementalPoseGraph::State::shorten(const std::vector<int>& poses, const std::vector<int>& factors,
                                          double before) {
  std::vector<int> place(estimates_.size(), -1);
  for (std::size_t k = 0; k < poses.size(); ++k) place[at(poses[k])] = static_cast<int>(k);
  const int n = 6 * static_cast<int>(poses.size());
  Eigen::VectorXd g = Eigen::VectorXd::Zero(n), scale = Eigen::VectorXd::Constant(n, 1e-12), h(n);
  const auto start = [&](int pose) { return 6 * place[at(pose)]; };
  for (const int id : factors) {
    const Factor& f = factors_[at(id)];
    Vector6d predicted = f.offset;
    for (int i = 0; i < f.count; ++i) predicted += f.jacobian.middleCols<6>(6 * i) * steps_[at(f.pose[i])];
    for (int i = 0; i < f.count; ++i) {
      if (place[at(f.pose[i])] < 0) continue;
      g.segment<6>(start(f.pose[i])) += f.jacobian.middleCols<6>(6 * i).transpose() * predicted;
      scale.segment<6>(start(f.pose[i])) += f.jacobian.middleCols<6>(6 * i).colwise().squaredNorm().transpose();
    }
  }
  Steps old;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    old.push_back(steps_[at(poses[k])]);
    h.segment<6>(6 * static_cast<int>(k)) = Vector6d(tree_->solution(poses[k])) - old.back();
  }
  const Eigen::VectorXd d = -g.cwiseQuotient(scale);
  DogLegInner in;
  in.dd = d.dot(scale.cwiseProduct(d));
  in.dh = d.dot(scale.cwiseProduct(h));
  in.hh = h.dot(scale.cwiseProduct(h));
  in.gd = g.dot(d);
  in.gh = g.dot(h);
  for (const int id : factors) {
    const Factor& f = factors_[at(id)];
    Vector6d along = Vector6d::Zero();
    for (int i = 0; i < f.count; ++i)
      if (place[at(f.pose[i])] >= 0) along += f.jacobian.middleCols<6>(6 * i) * d.segment<6>(start(f.pose[i]));
    in.d_h_d += along.squaredNorm();
  }
  double radius = 0.5 * std::sqrt(in.hh);
  constexpr int kTries = 8;
  for (int k = 0; k <= kTries; ++k) {
    const DogLegStep step = k < kTries ? dog_leg_step(in, radius) : dog_leg_blend(in, 0, 0);
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const auto first = 6 * static_cast<Eigen::Index>(i);
      steps_[at(poses[i])] = old[i] + step.along_d * d.segment<6>(first) + step.along_h * h.segment<6>(first);
      estimates_[at(poses[i])] = moved(origins_[at(poses[i])], steps_[at(poses[i])]);
    }
    if (evaluate(factors) < before && k < kTries) return true;
    radius *= 0.25;
  }
  return false;
}

PoseGraphStep IncrementalPoseGraph::State::update(const Interruption& stop) {
  PoseGraphStep step;
  std::vector<int> late;
  take_in(&step, &late);
  double left = options_.work_per_update;
  std::vector<int> changed;
  for (int k = 0; k < options_.steps_per_update; ++k) {
    if (stop.requested()) {
      step.stopped = true;
      break;
    }
    for (const int pose : far_) give_new_origin(pose);
    far_.clear();
    change_waiting(left, &step);
    if (tree_->up_to_date() && behind_.empty()) break;
    const auto outcome = tree_->update(late, stop);
    step.eliminated += outcome.variables;
    step.work += outcome.work;
    step.undetermined = std::max(step.undetermined, outcome.lost);
    if (outcome.stopped) {
      step.stopped = true;
      break;
    }
    if (k > 0) left -= outcome.work;
    ++step.iterations;
    tree_->solve(options_.propagate_above, &changed, precision_);
    apply(changed, &step);
    // What is only a little off can wait.
    const bool urgent = std::any_of(waiting_.begin(), waiting_.end(), [&](int id) {
      return factors_[at(id)].departure > kUrgent * options_.relinearise_above;
    });
    if ((!urgent && far_.empty()) || left <= 0) break;
  }
  step.waiting = static_cast<int>(waiting_.size());
  step.held = static_cast<int>(held_.size());
  for (const double c : costs_) step.cost += c;
  return step;
}

}  // namespace parallax
