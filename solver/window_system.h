// The linearised window: what smooth_window() and window_covariance() share. Sorts the observations, keeps the current
// and a trial state, eliminates the points and solves the reduced camera system. Internal to solver/; one object is one
// thread's, and its memory is kept from one window to the next.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "solver/dog_leg.h"
#include "solver/window_kernels.h"
#include "solver/window_smoothing.h"

namespace parallax::solver {

class WindowSystem {
 public:
  // Takes over a problem with the poses of `fixed` held. False: what smooth_window() calls failed.
  bool load(const WindowProblem& problem, const WindowOptions& options, const std::vector<std::uint8_t>& fixed);
  // Writes the state back: poses that are adjusted, and the points that are observed. Unless `moved`, their sign only.
  void store(WindowProblem* problem, bool moved) const;

  // The kernel's scale at the current state, by the options; and the cost of the current, first and trial state there.
  double find_sigma();
  double cost(double sigma) const { return cost_of(state_, sigma); }
  double first_cost(double sigma) const { return cost_of(first_, sigma); }
  double trial_cost(double sigma) const { return cost_of(trial_, sigma); }

  // Linearises at the current state and finds the Gauss-Newton step. False: nothing that is finite and definite.
  bool linearise(double sigma);
  // The step for a radius, and the trial state it leads to. Returns the largest change (metres, radians, tangent).
  DogLegStep choose_step(double radius);
  double make_trial(const DogLegStep& step);
  void accept();

  // 1 for each observation of the problem that is behind its camera or beyond the outliers' bound at the state.
  void find_outliers(double sigma, std::vector<std::uint8_t>* outlier) const;

  // Leaves out what find_outliers() says; then the inverse of the reduced camera system, rows in the order of slots.
  void drop_outliers(double sigma);
  bool invert(Eigen::MatrixXd* covariance);
  int slot(int pose) const { return slot_[static_cast<std::size_t>(pose)]; }  // -1: held, or nothing is known of it
  bool observed(int pose) const;                                              // after invert()

 private:
  struct State {
    std::vector<double> poses;                // kWindowPoseStride each
    std::vector<Eigen::Vector4d> quaternion;  // of the poses
    std::vector<Eigen::Vector4d> points;
    std::vector<double> squared;
    double prior_cost = 0;
  };
  struct PriorBlock {
    int row = 0, column = 0;  // slots, row above column
    Matrix6d block;
  };

  bool valid(const WindowProblem& problem, const WindowOptions& options) const;
  void sort_observations();
  void assign_slots(const std::vector<std::uint8_t>& fixed);
  bool load_state();
  bool behind(int point, int observation) const;
  WindowJob job(State& state);
  void evaluate(State* state);
  double cost_of(const State& state, double sigma) const;
  RigidTransform pose_of(const State& state, int pose) const;
  void reduce(const KernelParameters& kernel);
  void add_priors();
  void assemble();
  bool factor();
  bool find_gauss_newton();
  void find_descent();

  const WindowProblem* problem_ = nullptr;
  WindowOptions options_;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();  // of the frame inside, in the window's
  std::vector<int> slot_;                             // of a pose
  std::vector<int> pose_at_;                          // of a slot
  std::vector<int> order_, by_pose_;                  // the problem's observations, sorted
  std::vector<std::int32_t> count_, observation_begin_, edge_begin_, edge_slot_;
  std::vector<WindowObservation> observations_;
  State state_, trial_, first_;
  std::vector<double> values_;
  // Of the last linearisation.
  std::vector<double> edges_, point_data_, pose_blocks_, reduced_;
  std::vector<PriorBlock> prior_blocks_;
  Eigen::MatrixXd matrix_, factor_;
  Eigen::VectorXd right_;
  double ridge_ = 0;
  std::vector<double> newton_, newton_white_, descent_, descent_white_, step_;  // poses (eight each), points (three)
  DogLegInner inner_;
  bool descent_found_ = false;
};

}  // namespace parallax::solver
