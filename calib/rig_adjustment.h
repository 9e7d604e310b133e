// Bundle adjustment of a calibration: lenses, the places of the cameras in their rig, and the pose of the target in
// each view, from points of the target seen in pixels. Levenberg-Marquardt with analytic Jacobians; the views' poses
// are eliminated (Schur complement), since there are many of them and few of everything else.
//
// Frames: target, rig (= camera 0) and camera. One thread; no global state.
#pragma once

#include <Eigen/Core>
#include <stop_token>
#include <vector>

#include "calib/lens.h"
#include "core/camera_model.h"
#include "core/se3.h"

namespace parallax {

struct RigObservation {
  int view = 0, camera = 0;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  // target frame
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  bool used = true;  // false: an outlier, or held out
};

struct RigProblem {
  std::vector<CameraModel> cameras;
  std::vector<Eigen::MatrixXd> freedom;         // lens_freedom_map for each camera; no columns: the lens is fixed
  std::vector<RigidTransform> camera_from_rig;  // the first is the identity and stays
  std::vector<RigidTransform> rig_from_target;  // a view each
  std::vector<RigObservation> observations;
};

struct RigAdjustmentOptions {
  int max_iterations = 50;
  double huber_px = 0;               // width of Huber's kernel; 0: plain least squares
  double relative_decrease = 1e-12;  // of the cost, below which it has converged
  std::stop_token stop;
};

struct RigAdjustmentSummary {
  double cost = 0;  // sum of kernel costs (squared pixels)
  int iterations = 0;
  bool converged = false, stopped = false;
};

// Changes cameras, camera_from_rig and rig_from_target in place. Points that do not project count as far away.
RigAdjustmentSummary adjust_rig(RigProblem* problem, const RigAdjustmentOptions& options);

// What the observations in use say about the shared parameters (free lens parameters of all cameras, then six for each
// further camera's place: a left increment, translation first), with the views' poses taken out: for residuals of one
// pixel. `view_gradients` (a column a view) is what each view alone pulls at the solution, `view_information` each
// view's share of the information.
struct RigInformation {
  Eigen::MatrixXd information;
  Eigen::MatrixXd view_gradients;
  std::vector<Eigen::MatrixXd> view_information;
};
RigInformation rig_information(const RigProblem& problem);

// Covariance of the shared parameters by how much they move when one view after another is left out: the jackknife
// (Efron 1982), one Gauss-Newton step a view. It also feels what the corners of a view have in common (a bent board,
// blur), and unlike the sandwich estimator it does not come out too small for few views of which one has much weight
// (Bell and McCaffrey 2002). Where the views without one of them determine nothing, the sandwich it is.
Eigen::MatrixXd covariance_by_views(const RigInformation& information);

// The residual (predicted minus seen) of an observation; false when it does not project.
bool rig_residual(const RigProblem& problem, const RigObservation& observation, Eigen::Vector2d* residual);

}  // namespace parallax
