// Calibrates with a lens model that is given, or chooses one by cross-validation; measures the error on views held out.
#pragma once

#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "calib/camera_calibration.h"

namespace parallax {

struct CalibrationRequest {
  std::optional<LensModel> model;  // nothing: chosen by cross-validated error
  LensFreedom freedom;
  double hold_out = 0.2;  // share of the views that the held-out error is measured on (0: none)
  int folds = 5;          // of the cross-validation
  double outlier_sigmas = 4;
  std::stop_token stop;
  void validate() const;  // InputError
};

struct ModelScore {
  LensModel model = LensModel::fov;
  bool ok = false;
  std::string reason;   // when not
  double error_px = 0;  // median over the views of their rms error, each by a lens fitted without it
  double excess = 0;    // median logarithm of its error by the best model's over the views, and its standard error
  double excess_error = 0;
};

struct CalibrationOutcome {
  bool ok = false;
  std::string reason;              // one sentence when not
  CameraCalibration calibration;   // from all views
  std::vector<ModelScore> scores;  // of the models that were tried; empty when the model was given
  double held_out_px = 0;          // median over the held-out views of their rms error by a lens fitted on the others
  int held_out_views = 0;
};

// k-fold cross-validation over views (every k-th view in a fold). The simplest model whose error is within one standard
// error of the best one's is chosen (Breiman's rule). Fewer than 4 views: no cross-validation, radtan4 or fov by the
// fit.
std::vector<ModelScore> score_models(const CalibrationData& data, const CalibrationRequest& request);
LensModel choose_model(const std::vector<ModelScore>& scores);

// The whole: model, calibration on all views, held-out error. Throws InputError for a request that makes no sense only.
CalibrationOutcome run_calibration(const CalibrationData& data, const CalibrationRequest& request);

}  // namespace parallax
