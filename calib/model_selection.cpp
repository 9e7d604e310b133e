#include "calib/model_selection.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/initial_lens.h"
#include "core/error.h"

namespace parallax {
namespace {

// By the number of parameters.
constexpr LensModel candidates[] = {LensModel::pinhole,        LensModel::fov,     LensModel::radtan4,
                                    LensModel::kannala_brandt, LensModel::radtan5, LensModel::radtan8};

CalibrationOptions options_of(const CalibrationRequest& request, LensModel model) {
  CalibrationOptions options;
  options.model = model;
  options.freedom = request.freedom;
  options.outlier_sigmas = request.outlier_sigmas;
  options.stop = request.stop;
  return options;
}

// Errors that differ by less are equal for any use.
constexpr double equal_share = 0.01;
// A simpler lens may not be worse than this in the median view, however much the views disagree.
constexpr double tolerable_ratio = 1.5;

// Of normally distributed values: the standard deviation over the median absolute deviation, and the standard error of
// the median over that of the mean.
constexpr double deviation_per_mad = 1.4826, median_error = 1.2533;
constexpr double smallest_error_px = 1e-4, largest_error_px = 1e4;

struct Split {
  CalibrationData fit, held;
};

// Every k-th view from `phase` on is held out.
Split split(const CalibrationData& data, int k, int phase) {
  Split out;
  out.fit = out.held = {data.target, data.width, data.height, {}};
  for (std::size_t i = 0; i < data.views.size(); ++i)
    (static_cast<int>(i) % k == phase ? out.held : out.fit).views.push_back(data.views[i]);
  return out;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}

// Errors of all views, each by a lens fitted without it; empty with a reason when a fold fails.
std::vector<double> cross_validated(const CalibrationData& data, const CalibrationRequest& request, LensModel model,
                                    const std::vector<CameraModel>& starts, std::string* reason) {
  const int folds = std::min(request.folds, static_cast<int>(data.views.size()));
  CalibrationOptions options = options_of(request, model);
  options.starts = starts;
  const CameraCalibration whole = calibrate_camera(data, options);
  if (!whole.ok) {
    *reason = whole.reason;
    return {};
  }
  options.starts = {whole.camera};  // where a fold begins; where it ends is for its own views to say
  std::vector<double> errors(data.views.size(), 0.0);
  for (int fold = 0; fold < folds; ++fold) {
    const Split parts = split(data, folds, fold);
    const CameraCalibration fitted = calibrate_camera(parts.fit, options);
    if (!fitted.ok) {
      *reason = fitted.reason;
      return {};
    }
    std::vector<double> fold_errors;
    (void)held_out_error(fitted.camera, parts.held, &fold_errors);
    fold_errors.resize(parts.held.views.size(), std::numeric_limits<double>::infinity());
    for (std::size_t i = 0; i < fold_errors.size(); ++i)
      errors[i * static_cast<std::size_t>(folds) + static_cast<std::size_t>(fold)] = fold_errors[i];
  }
  return errors;
}

}  // namespace

void CalibrationRequest::validate() const {
  if (!(hold_out >= 0 && hold_out <= 0.5))
    throw InputError("hold-out: found " + std::to_string(hold_out) + ", expected a share from 0 to 0.5");
  if (folds < 2) throw InputError("folds: found " + std::to_string(folds) + ", expected 2 or more");
}

std::vector<ModelScore> score_models(const CalibrationData& data, const CalibrationRequest& request) {
  request.validate();
  std::vector<ModelScore> scores;
  std::vector<std::vector<double>> errors;
  const std::vector<Eigen::Vector3d> points = target_points(data.target);
  std::vector<ViewPoints> views;
  for (const auto& view : data.views) views.push_back(view_points(points, view.corners));
  std::vector<CameraModel> starts;
  for (const auto& guess : guess_lenses(views, data.width, data.height)) starts.push_back(guess.camera);
  for (const LensModel model : candidates) {
    ModelScore score;
    score.model = model;
    errors.push_back(cross_validated(data, request, model, starts, &score.reason));
    score.ok = !errors.back().empty();
    score.error_px = score.ok ? median(errors.back()) : 0;
    if (score.ok && !std::isfinite(score.error_px)) {
      score.ok = false;
      score.error_px = 0;
      score.reason = "half of the views are outside what the lens can show";
    }
    scores.push_back(score);
  }
  std::size_t best = scores.size();
  for (std::size_t i = 0; i < scores.size(); ++i)
    if (scores[i].ok && (best == scores.size() || scores[i].error_px < scores[best].error_px)) best = i;
  for (std::size_t i = 0; best < scores.size() && i < scores.size(); ++i) {
    if (!scores[i].ok) continue;
    // View by view against the best one, as logarithms of the ratio. The median: in a fold without the views that
    // reach a corner of the image a flexible lens may get one of them wholly wrong, which says nothing of the others.
    std::vector<double> ratios;
    for (std::size_t v = 0; v < errors[i].size(); ++v) {
      const double a = std::min(errors[i][v], largest_error_px), b = std::min(errors[best][v], largest_error_px);
      ratios.push_back(std::log(std::max(a, smallest_error_px) / std::max(b, smallest_error_px)));
    }
    scores[i].excess = median(ratios);
    for (double& ratio : ratios) ratio = std::abs(ratio - scores[i].excess);
    scores[i].excess_error =
        median_error * deviation_per_mad * median(ratios) / std::sqrt(static_cast<double>(ratios.size()));
  }
  return scores;
}

LensModel choose_model(const std::vector<ModelScore>& scores) {
  double best_px = std::numeric_limits<double>::infinity();
  for (const auto& score : scores)
    if (score.ok) best_px = std::min(best_px, score.error_px);
  for (const auto& score : scores) {  // simplest first
    if (score.ok && score.excess <= std::max(score.excess_error, equal_share) &&
        score.error_px <= tolerable_ratio * best_px)
      return score.model;
  }
  return LensModel::radtan4;
}

CalibrationOutcome run_calibration(const CalibrationData& data, const CalibrationRequest& request) {
  request.validate();
  CalibrationOutcome out;
  LensModel model = request.model.value_or(LensModel::radtan4);
  if (!request.model) {
    if (data.views.size() >= 4) {
      out.scores = score_models(data, request);
      if (request.stop.stop_requested()) {
        out.reason = "stopped";
        return out;
      }
      model = choose_model(out.scores);
    }
  }
  out.calibration = calibrate_camera(data, options_of(request, model));
  out.ok = out.calibration.ok;
  out.reason = out.calibration.reason;
  if (!out.ok || request.hold_out <= 0) return out;
  const int every = std::max(2, static_cast<int>(std::lround(1 / request.hold_out)));
  const Split parts = split(data, every, every / 2);
  if (parts.held.views.empty() || parts.fit.views.size() < 3) return out;
  CalibrationOptions options = options_of(request, model);
  options.starts = {out.calibration.camera};
  const CameraCalibration fitted = calibrate_camera(parts.fit, options);
  if (!fitted.ok) return out;
  std::vector<double> errors;
  (void)held_out_error(fitted.camera, parts.held, &errors);
  out.held_out_px = median(errors);
  out.held_out_views = static_cast<int>(parts.held.views.size());
  return out;
}

}  // namespace parallax
