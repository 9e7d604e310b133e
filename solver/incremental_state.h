// What an incremental pose graph holds (incremental_pose_graph.h), and the steps it is made of. Internal to solver/.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <memory>
#include <span>
#include <vector>

#include "core/check.h"
#include "solver/incremental_gauge.h"
#include "solver/incremental_pose_graph.h"
#include "solver/pose_graph_factor.h"
#include "solver/sparse_elimination.h"

namespace parallax {
namespace solver {

using Poses = std::vector<RigidTransform, Eigen::aligned_allocator<RigidTransform>>;
using Steps = std::vector<Vector6d, Eigen::aligned_allocator<Vector6d>>;

// Of a robust kernel in the Hessian, so that nothing becomes singular.
inline constexpr double kLeastWeight = 1e-6;

struct IncrementalFactor {
  enum class Kind { prior, constraint, encounter } kind = Kind::prior;
  int count = 0;  // poses
  int pose[4] = {-1, -1, -1, -1};
  RigidTransform measured;
  Matrix6d whitening = Matrix6d::Identity();
  RobustKernel robust = RobustKernel::none;
  bool active = true;

  // As linearised: residual(steps from the origins) = offset + jacobian * steps, whitened and weighted.
  int element = -1;
  bool waiting = false;
  double weight = 1, departure = 0;
  double lever = 1;  // standard deviation of the rotation over that of the translation, roughly
  Vector6d linearised_at = Vector6d::Zero();  // the residual, not whitened
  Vector6d offset = Vector6d::Zero();
  Eigen::Matrix<double, 6, Eigen::Dynamic> jacobian;

  // Residual at the poses, not whitened; d: four Jacobians or null.
  Vector6d residual(const Poses& poses, Matrix6d* d) const {
    const auto x = [&](int i) -> const RigidTransform& { return poses[static_cast<std::size_t>(pose[i])]; };
    switch (kind) {
      case Kind::prior:
        return prior_residual(measured, x(0), d);
      case Kind::constraint:
        return constraint_residual(measured, x(0), x(1), d, d == nullptr ? nullptr : d + 1);
      case Kind::encounter:
        break;
    }
    if (d == nullptr) return encounter_residual(measured, x(0), x(1), x(2), x(3), nullptr, nullptr, nullptr, nullptr);
    return encounter_residual(measured, x(0), x(1), x(2), x(3), d, d + 1, d + 2, d + 3);
  }
  double squared(const Poses& poses) const { return (whitening * residual(poses, nullptr)).squaredNorm(); }
  double cost_of(double squared) const {
    const double c = kernel_width(robust);
    return 0.5 * c * c * kernel_cost(robust, squared / (c * c));
  }
  double weight_of(double squared) const {
    const double c = kernel_width(robust);
    return kernel_weight(robust, squared / (c * c));
  }
};

}  // namespace solver

class IncrementalPoseGraph::State {
 public:
  explicit State(const IncrementalPoseGraphOptions& options) : options_(options) { options_.validate(); }

  int add_pose(const RigidTransform& initial);
  int add_factor(solver::IncrementalFactor factor, const Matrix6d& covariance);
  void set_active(int factor, bool active);
  void set_pose(int pose, const RigidTransform& estimate);
  PoseGraphStep update(const Interruption& stop);
  PoseGraphStep optimise(const Interruption& stop);
  double cost() const;
  bool marginal(std::span<const int> poses, bool relative, Eigen::MatrixXd* local) const;

  void check_pose(int id) const { PARALLAX_CHECK(id >= 0 && id < static_cast<int>(estimates_.size()), "no such pose"); }
  solver::IncrementalFactor& factor(int id) {
    PARALLAX_CHECK(id >= 0 && id < static_cast<int>(factors_.size()), "no such factor");
    return factors_[static_cast<std::size_t>(id)];
  }

  IncrementalPoseGraphOptions options_;
  solver::Poses estimates_;
  std::vector<solver::IncrementalFactor> factors_;

 private:
  void take_in(PoseGraphStep* step, std::vector<int>* late);
  void find_held(const std::vector<int>& touched, bool rebuild);
  void hold(int pose);
  void linearise(int factor);
  void write_element(int factor);
  void give_new_origin(int pose);
  void change_waiting(double budget, PoseGraphStep* step);
  void apply(std::vector<int> changed, PoseGraphStep* step);
  bool shorten(const std::vector<int>& poses, const std::vector<int>& factors, double before);
  double evaluate(const std::vector<int>& factors);

  solver::Poses origins_;
  solver::Steps steps_;        // estimates_ = moved(origins_, steps_)
  std::vector<double> costs_;  // of a factor at the estimates; 0 when it takes no part
  std::vector<std::vector<int>> factors_of_;
  std::unique_ptr<solver::SparseElimination> tree_ = std::make_unique<solver::SparseElimination>(6);
  solver::IncrementalGauge gauge_;
  std::vector<int> hold_element_;  // of a pose; -1: never held
  std::vector<int> held_, loose_;  // poses held; poses that are not determined
  std::vector<double> precision_;  // of a pose's six unknowns: the greatest that a factor gives it
  std::vector<int> new_factors_, switched_, set_poses_, waiting_;
  std::vector<int> behind_;  // poses that are not at the tree's solution
  std::vector<int> far_;     // poses that have turned far from their origins
  std::vector<int> stamp_;   // scratch, a factor
  int stamps_ = 0;
};

}  // namespace parallax
