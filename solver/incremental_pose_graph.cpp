#include "solver/incremental_pose_graph.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "core/check.h"
#include "core/error.h"
#include "solver/incremental_state.h"

namespace parallax {
namespace {

using Factor = solver::IncrementalFactor;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

bool is_rigid(const RigidTransform& T) {
  return T.R.allFinite() && T.t.allFinite() && T.t.cwiseAbs().maxCoeff() < 1e12 &&
         (T.R.transpose() * T.R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-6 && T.R.determinant() > 0;
}

// The W with W^T W = covariance^-1; false when the covariance is none.
bool find_whitening(const Matrix6d& covariance, Matrix6d* whitening) {
  if (!covariance.allFinite()) return false;
  const double largest = covariance.cwiseAbs().maxCoeff();
  if ((covariance - covariance.transpose()).cwiseAbs().maxCoeff() > 1e-6 * largest) return false;
  if (largest > 1e18 || covariance.diagonal().minCoeff() < 1e-18) return false;
  const Eigen::LLT<Matrix6d> llt(0.5 * (covariance + covariance.transpose()));
  if (llt.info() != Eigen::Success) return false;
  *whitening = llt.matrixL().solve(Matrix6d::Identity());
  return whitening->allFinite() && whitening->cwiseAbs().maxCoeff() < 1e12;
}

}  // namespace

void IncrementalPoseGraphOptions::validate() const {
  const auto require = [](bool ok, const char* text) {
    if (!ok) throw InputError(std::string("pose graph options: ") + text);
  };
  require(relinearise_above > 0, "relinearise_above must be above 0");
  require(propagate_above >= 0, "propagate_above must not be negative");
  require(work_per_update >= 0, "work_per_update must not be negative");
  require(steps_per_update >= 1, "steps_per_update must be at least 1");
  require(batch_iterations >= 1, "batch_iterations must be at least 1");
  require(batch_stop_below >= 0 && batch_stop_below < 1, "batch_stop_below must be in [0, 1)");
}

int IncrementalPoseGraph::State::add_pose(const RigidTransform& initial) {
  if (!is_rigid(initial)) return -1;
  estimates_.push_back(initial);
  origins_.push_back(initial);
  steps_.push_back(Vector6d::Zero());
  factors_of_.emplace_back();
  hold_element_.push_back(-1);
  gauge_.add_pose();
  precision_.resize(precision_.size() + 6, 0.0);
  tree_->add_variable();
  return static_cast<int>(estimates_.size()) - 1;
}

int IncrementalPoseGraph::State::add_factor(Factor f, const Matrix6d& covariance) {
  for (int i = 0; i < f.count; ++i) {
    check_pose(f.pose[i]);
    for (int j = 0; j < i; ++j) PARALLAX_CHECK(f.pose[i] != f.pose[j], "a factor's poses are distinct");
  }
  if (!is_rigid(f.measured) || !find_whitening(covariance, &f.whitening)) return -1;
  f.lever = f.whitening.topRows<3>().norm() / f.whitening.bottomRightCorner<3, 3>().norm();
  const int id = static_cast<int>(factors_.size());
  f.jacobian.setZero(6, 6 * f.count);
  for (int i = 0; i < f.count; ++i) factors_of_[at(f.pose[i])].push_back(id);
  factors_.push_back(std::move(f));
  costs_.push_back(0);
  stamp_.push_back(0);
  new_factors_.push_back(id);
  return id;
}

void IncrementalPoseGraph::State::set_active(int id, bool active) {
  Factor& f = factor(id);
  if (f.active == active) return;
  f.active = active;
  switched_.push_back(id);
}

void IncrementalPoseGraph::State::set_pose(int pose, const RigidTransform& estimate) {
  check_pose(pose);
  PARALLAX_CHECK(is_rigid(estimate), "a pose is a rigid transform");
  estimates_[at(pose)] = estimate;
  set_poses_.push_back(pose);
}

double IncrementalPoseGraph::State::cost() const {
  double sum = 0;
  for (const Factor& f : factors_)
    if (f.active) sum += f.cost_of(f.squared(estimates_));
  return sum;
}

bool IncrementalPoseGraph::State::marginal(std::span<const int> poses, bool relative, Eigen::MatrixXd* local) const {
  if (!tree_->up_to_date()) return false;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    check_pose(poses[i]);
    PARALLAX_CHECK(std::find(poses.begin(), poses.begin() + static_cast<std::ptrdiff_t>(i), poses[i]) ==
                       poses.begin() + static_cast<std::ptrdiff_t>(i),
                   "the poses are distinct");
    if (!tree_->takes_part(poses[i])) return false;
    if (!relative && !gauge_.determined(poses[i])) return false;
  }
  if (relative && !gauge_.relative_determined(poses[0], poses[1])) return false;
  *local = tree_->inverse_block(poses);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Matrix6d D = solver::move_jacobian(steps_[at(poses[i])]);
    local->middleRows<6>(6 * static_cast<int>(i)) = D * local->middleRows<6>(6 * static_cast<int>(i));
    local->middleCols<6>(6 * static_cast<int>(i)) = local->middleCols<6>(6 * static_cast<int>(i)) * D.transpose();
  }
  return local->allFinite();
}

IncrementalPoseGraph::IncrementalPoseGraph(const IncrementalPoseGraphOptions& options)
    : state_(std::make_unique<State>(options)) {}
IncrementalPoseGraph::~IncrementalPoseGraph() = default;
IncrementalPoseGraph::IncrementalPoseGraph(IncrementalPoseGraph&&) noexcept = default;
IncrementalPoseGraph& IncrementalPoseGraph::operator=(IncrementalPoseGraph&&) noexcept = default;

int IncrementalPoseGraph::add_pose(const RigidTransform& initial) { return state_->add_pose(initial); }

int IncrementalPoseGraph::add_prior(int pose, const RigidTransform& frame_from_pose, const Matrix6d& covariance) {
  Factor f;
  f.kind = Factor::Kind::prior;
  f.count = 1;
  f.pose[0] = pose;
  f.measured = frame_from_pose;
  return state_->add_factor(std::move(f), covariance);
}

int IncrementalPoseGraph::add_constraint(int from, int to, const RigidTransform& from_from_to,
                                         const Matrix6d& covariance, RobustKernel kernel) {
  Factor f;
  f.kind = Factor::Kind::constraint;
  f.count = 2;
  f.pose[0] = from;
  f.pose[1] = to;
  f.measured = from_from_to;
  f.robust = kernel;
  return state_->add_factor(std::move(f), covariance);
}

int IncrementalPoseGraph::add_encounter(int anchor_from, int from, int anchor_to, int to,
                                        const RigidTransform& from_from_to, const Matrix6d& covariance,
                                        RobustKernel kernel) {
  // Within one session its anchor cancels.
  if (anchor_from == anchor_to) {
    state_->check_pose(anchor_from);
    return add_constraint(from, to, from_from_to, covariance, kernel);
  }
  Factor f;
  f.kind = Factor::Kind::encounter;
  f.count = 4;
  f.pose[0] = anchor_from;
  f.pose[1] = from;
  f.pose[2] = anchor_to;
  f.pose[3] = to;
  f.measured = from_from_to;
  f.robust = kernel;
  return state_->add_factor(std::move(f), covariance);
}

void IncrementalPoseGraph::set_active(int factor, bool active) { state_->set_active(factor, active); }
void IncrementalPoseGraph::set_pose(int pose, const RigidTransform& estimate) { state_->set_pose(pose, estimate); }
PoseGraphStep IncrementalPoseGraph::update(const Interruption& stop) { return state_->update(stop); }
PoseGraphStep IncrementalPoseGraph::optimise(const Interruption& stop) { return state_->optimise(stop); }

const RigidTransform& IncrementalPoseGraph::pose(int id) const {
  state_->check_pose(id);
  return state_->estimates_[at(id)];
}
int IncrementalPoseGraph::poses() const { return static_cast<int>(state_->estimates_.size()); }
int IncrementalPoseGraph::factors() const { return static_cast<int>(state_->factors_.size()); }
bool IncrementalPoseGraph::active(int factor) const { return state_->factor(factor).active; }
double IncrementalPoseGraph::cost() const { return state_->cost(); }
double IncrementalPoseGraph::factor_error(int factor) const {
  return state_->factor(factor).squared(state_->estimates_);
}

bool IncrementalPoseGraph::marginal(int pose, Matrix6d* covariance) const {
  const int one[1] = {pose};
  Eigen::MatrixXd joint;
  if (!joint_marginal(one, &joint)) return false;
  *covariance = joint;
  return true;
}

bool IncrementalPoseGraph::joint_marginal(std::span<const int> poses, Eigen::MatrixXd* covariance) const {
  if (!state_->marginal(poses, false, covariance)) return false;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Matrix6d adjoint = pose(poses[i]).adjoint();
    const int first = 6 * static_cast<int>(i);
    covariance->middleRows<6>(first) = adjoint * covariance->middleRows<6>(first);
    covariance->middleCols<6>(first) = covariance->middleCols<6>(first) * adjoint.transpose();
  }
  *covariance = (0.5 * (*covariance + covariance->transpose())).eval();
  return true;
}

bool IncrementalPoseGraph::relative_covariance(int a, int b, RigidTransform* a_from_b, Matrix6d* covariance) const {
  const int both[2] = {a, b};
  Eigen::MatrixXd local;
  if (!state_->marginal(both, true, &local)) return false;
  *a_from_b = pose(a).inverse() * pose(b);
  // a^-1 b moves by exp(-d_a) on the left and exp(d_b) on the right.
  Eigen::Matrix<double, 6, 12> J;
  J << -Matrix6d::Identity(), a_from_b->adjoint();
  const Matrix6d result = J * local * J.transpose();
  *covariance = 0.5 * (result + result.transpose());
  return true;
}

}  // namespace parallax
