// Calibrates one camera from views of a flat target: a start found by trying, robust bundle adjustment, outliers taken
// out, and what the data say about every parameter.
//
// Frames: target and camera. Residuals: predicted minus seen, pixels. Pure functions, any thread; a calibration of 20
// views takes tens of milliseconds.
#pragma once

#include <Eigen/Core>
#include <stop_token>
#include <string>
#include <vector>

#include "calib/lens.h"
#include "calib/target.h"
#include "calib/target_detection.h"
#include "core/se3.h"

namespace parallax {

struct CalibrationView {
  int frame = 0;     // of the source
  std::string name;  // for reports: a file name
  std::vector<TargetCorner> corners;
};

struct CalibrationData {
  CalibrationTarget target;
  int width = 0, height = 0;  // of the images, pixels
  std::vector<CalibrationView> views;
};

struct CalibrationOptions {
  LensModel model = LensModel::fov;
  LensFreedom freedom;
  // A corner further from where it should be than so many standard deviations (of all residuals, estimated robustly) is
  // dropped: 1 in 3000 good ones.
  double outlier_sigmas = 4;
  // Lenses of any model to start from, instead of a search: the best of them is taken. Empty: searched for.
  std::vector<CameraModel> starts;
  std::stop_token stop;
  void validate() const;
};

struct CornerResidual {
  int id = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Vector2d residual_px = Eigen::Vector2d::Zero();
  bool used = true;
};

struct ViewFit {
  int frame = 0;
  std::string name;
  RigidTransform camera_from_target;
  double rms_px = 0;  // length of the residuals in use
  int outliers = 0;
  std::vector<CornerResidual> residuals;
};

struct CameraCalibration {
  // False: `reason` says in one sentence why, and nothing else counts.
  bool ok = false;
  std::string reason;

  LensModel model = LensModel::fov;
  CameraModel camera;
  std::vector<std::string> names;  // of the parameters
  Eigen::VectorXd parameters;
  // Standard deviations: from the information matrix with the residuals' own noise (`sigma`), which trusts that corners
  // err independently; and from how much leaving single views out moves them (`sigma_views`, covariance_by_views()),
  // which also feels a bent board or blur. 0 for parameters that were held.
  Eigen::VectorXd sigma, sigma_views;
  Eigen::MatrixXd covariance, covariance_views;  // of all parameters, by the same two ways

  double noise_px = 0;  // standard deviation of a coordinate
  double rms_px = 0;    // rms length of the residuals in use (what OpenCV calls the reprojection error)
  double mean_px = 0;   // mean length, over all corners, outliers too
  double max_px = 0;    // of those in use
  int corners = 0, outliers = 0, iterations = 0;
  bool converged = false;
  std::vector<ViewFit> views;

  // The larger of the two standard deviations.
  Eigen::VectorXd cautious_sigma() const { return sigma.cwiseMax(sigma_views); }
};

// Never throws for what the views are: a refusal is in the result. Throws InputError for options that make no sense.
CameraCalibration calibrate_camera(const CalibrationData& data, const CalibrationOptions& options);

// The error on views that took no part: each is posed (by the same lens, robustly) and what remains is counted. The
// root of the mean squared length, pixels; per view in `per_view` when asked.
double held_out_error(const CameraModel& camera, const CalibrationData& held_out,
                      std::vector<double>* per_view = nullptr);

// Discs are not seen with their middle in the middle: what to subtract from the centroid seen of a disc (radius in
// metres, centre `point` on the target) to have the projection of its centre. Zero where it cannot be told.
Eigen::Vector2d disc_bias(const CameraModel& camera, const RigidTransform& camera_from_target,
                          const Eigen::Vector3d& point, double radius_m);

}  // namespace parallax
