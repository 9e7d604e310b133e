// Incremental smoothing and mapping of a graph of 3D poses (Kaess, Ranganathan and Dellaert 2008; Kaess et al. 2012),
// as the multi-session back end uses it (McDonald et al. 2012, §3.2 and §4.2): poses, constraints between them, priors,
// and encounters between sessions by way of anchor nodes. An anchor is a pose like any other (global_from_session).
//
// Poses are frame_from_pose (session_from_camera, global_from_session). Covariances of measurements are of a left
// increment (translation first, metres and radians): truth = exp(e) * measured with e ~ N(0, covariance). The cost is
// half the sum of the squared Mahalanobis norms of log(predicted * measured^-1), through the factors' robust kernels.
//
// update() does one incremental step: what was added is linearised and eliminated together with the cliques of the
// factor between it and the root, in an order that puts the newest last; only what changed is substituted back. Factors
// whose residual has left its linear model by more than `relinearise_above` standard deviations are linearised anew,
// worst first, as far as `work_per_update` reaches; the rest waits for the following updates (PoseGraphStep::waiting).
// optimise() brings everything to convergence by Powell's dog-leg.
//
// What is not determined, for lack of a prior, stays where it is: a part of the graph without one is held at one of its
// poses. A pose that no active factor reaches keeps its value.
//
// Values only; one thread at a time; const calls may run side by side. Wrong identifiers are bugs (PARALLAX_CHECK);
// measurements that are not finite, no rotation, or whose covariance is not symmetric positive definite are refused
// with -1 and leave no trace. Same calls, same bits.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>

#include "core/interruption.h"
#include "core/se3.h"
#include "solver/robust_kernel.h"

namespace parallax {

struct IncrementalPoseGraphOptions {
  // Departure of a residual from its linear model, in standard deviations, or of its Jacobian, relatively, beyond which
  // it is linearised anew.
  double relinearise_above = 0.1;
  // Change of a pose, in standard deviations of its most precise measurement, below which what depends on it is not
  // substituted back (iSAM2's alpha).
  double propagate_above = 1e-3;
  // Multiply-adds an update may spend on linearising anew, beyond what its new factors ask for.
  double work_per_update = 2e8;
  // Linear steps an update may take, while there is work left to spend.
  int steps_per_update = 3;
  // Batch optimisation: most iterations, and the relative change of the cost to stop at.
  int batch_iterations = 100;
  double batch_stop_below = 1e-12;

  void validate() const;  // throws InputError
};

// What a call of update() or optimise() did.
struct PoseGraphStep {
  double cost = 0;         // afterwards, as cost()
  int iterations = 0;      // linear systems solved
  int new_factors = 0;     // added or switched since the last call
  int relinearised = 0;    // factors, not counting new ones
  int eliminated = 0;      // poses eliminated anew
  int changed = 0;         // poses with a new value
  int waiting = 0;         // factors that should be linearised anew and wait for the next update
  int held = 0;            // poses held for want of a prior
  int undetermined = 0;    // unknowns that came out undetermined nonetheless, and stay as they are
  double work = 0;         // multiply-adds of the elimination
  bool damped = false;     // the full step would have raised the cost and was shortened (dog-leg)
  bool converged = false;  // optimise(): the tolerance was reached
  bool stopped = false;    // asked to stop; optimise() then leaves everything as it was
};

class IncrementalPoseGraph {
 public:
  explicit IncrementalPoseGraph(const IncrementalPoseGraphOptions& options = {});
  ~IncrementalPoseGraph();
  IncrementalPoseGraph(IncrementalPoseGraph&&) noexcept;
  IncrementalPoseGraph& operator=(IncrementalPoseGraph&&) noexcept;

  // Identifiers are dense from 0 and never reused. -1: refused (not finite, not a rotation).
  int add_pose(const RigidTransform& initial);
  // Of factors; poses named must be distinct (the two anchors of an encounter may be one). -1: refused.
  int add_prior(int pose, const RigidTransform& frame_from_pose, const Matrix6d& covariance);
  int add_constraint(int from, int to, const RigidTransform& from_from_to, const Matrix6d& covariance,
                     RobustKernel kernel = RobustKernel::none);
  // (anchor_from * from)^-1 * (anchor_to * to) was measured.
  int add_encounter(int anchor_from, int from, int anchor_to, int to, const RigidTransform& from_from_to,
                    const Matrix6d& covariance, RobustKernel kernel = RobustKernel::none);

  // Switches a factor off and on again (undo and redo); it keeps its identifier. Takes effect with the next update().
  void set_active(int factor, bool active);
  // A new start value, at which its factors are linearised anew by the next update(). Must be a rigid transform.
  void set_pose(int pose, const RigidTransform& estimate);

  PoseGraphStep update(const Interruption& stop = {});
  PoseGraphStep optimise(const Interruption& stop = {});

  const RigidTransform& pose(int id) const;
  int poses() const;
  int factors() const;
  bool active(int factor) const;
  // Half the sum of the squared Mahalanobis norms of the active factors, through their kernels, at the present poses.
  double cost() const;
  // Squared Mahalanobis norm at the present poses, without kernel; also of a factor that is switched off.
  double factor_error(int factor) const;

  // Covariance of a left increment of the pose in its frame: frame_from_pose = exp(e) * estimate, e ~ N(0, covariance),
  // translation first. From the factor of the last update(), so at its linearisation; robust factors count with the
  // weight they had there. False when the pose is not determined (no way from it to a prior) or was never updated.
  bool marginal(int pose, Matrix6d* covariance) const;
  // Jointly of several distinct poses, six rows each in the order given, each as in marginal().
  bool joint_marginal(std::span<const int> poses, Eigen::MatrixXd* covariance) const;
  // a^-1 * b and the covariance of its left increment: a_from_b = exp(e) * estimate. For two poses of one session; it
  // needs no prior, only a way between the two.
  bool relative_covariance(int a, int b, RigidTransform* a_from_b, Matrix6d* covariance) const;

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace parallax
