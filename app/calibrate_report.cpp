#include "app/calibrate_report.h"

#include <cmath>
#include <iomanip>
#include <sstream>

namespace parallax {
namespace {

using Json = nlohmann::ordered_json;

// So many digits that the standard deviation has two.
std::string with_sigma(double value, double sigma) {
  std::ostringstream text;
  const int digits = sigma > 0 ? std::max(0, 1 - static_cast<int>(std::floor(std::log10(sigma)))) : 6;
  text << std::fixed << std::setprecision(std::min(digits, 9)) << std::setw(14) << value;
  if (sigma > 0) {
    text << " +- " << sigma;
  } else {
    text << "    (held)";
  }
  return text.str();
}

std::string pixels(double value) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(value < 0.0995 ? 4 : 3) << value << " px";
  return text.str();
}

void print_parameters(const std::vector<std::string>& names, const Eigen::VectorXd& values,
                      const Eigen::VectorXd& sigma, std::ostream& out) {
  for (std::size_t i = 0; i < names.size(); ++i)
    out << "  " << std::left << std::setw(6) << names[i] << std::right
        << with_sigma(values(static_cast<int>(i)), sigma(static_cast<int>(i))) << "\n";
}

Json pose_json(const RigidTransform& pose) {
  const Eigen::Quaterniond q = pose.quaternion();
  return {{"translation_m", {pose.t.x(), pose.t.y(), pose.t.z()}}, {"quaternion_xyzw", {q.x(), q.y(), q.z(), q.w()}}};
}

Json board_json(const CalibrationTarget& target) {
  Json out{{"target", to_string(target.kind)},
           {"columns", target.columns},
           {"rows", target.rows},
           {"square_m", target.square_m}};
  if (target.kind != TargetKind::chessboard) out["detail_m"] = target.detail();
  return out;
}

Json parameters_json(const std::vector<std::string>& names, const Eigen::VectorXd& values, const Eigen::VectorXd& noise,
                     const Eigen::VectorXd& views) {
  Json out;
  for (std::size_t k = 0; k < names.size(); ++k) {
    const auto i = static_cast<int>(k);
    out[names[k]] = {{"value", values(i)},
                     {"sigma", std::max(noise(i), views(i))},
                     {"sigma_of_noise", noise(i)},
                     {"sigma_between_views", views(i)}};
  }
  return out;
}

}  // namespace

void print_calibration(const CalibrateReport& report, std::ostream& out) {
  const CameraCalibration& c = report.outcome.calibration;
  out << "views: " << c.views.size() << " of " << report.views.frames << " images, " << c.corners << " corners ("
      << c.outliers << " outliers), " << c.camera.width() << "x" << c.camera.height() << "\n";
  for (const auto& score : report.outcome.scores) {
    out << "  " << std::left << std::setw(16) << to_string(score.model) << std::right;
    if (score.ok) {
      out << "cross-validated " << pixels(score.error_px) << (score.model == c.model ? "  <- chosen" : "") << "\n";
    } else {
      out << "no: " << score.reason << "\n";
    }
  }
  out << "model: " << to_string(c.model) << " (one standard deviation; pixel centres at integers)\n";
  print_parameters(c.names, c.parameters, c.cautious_sigma(), out);
  out << "residual: rms " << pixels(c.rms_px) << ", noise " << pixels(c.noise_px) << " a coordinate, largest "
      << pixels(c.max_px) << "\n";
  if (report.outcome.held_out_views > 0)
    out << "held out: " << pixels(report.outcome.held_out_px) << " on " << report.outcome.held_out_views << " views\n";
  out << "projection uncertainty: " << pixels(report.uncertainty.mean_px) << " on average, up to "
      << pixels(report.uncertainty.max_px) << "\n";
  out << "coverage: " << report.coverage.covered_cells() << " of " << report.coverage.cells.size()
      << " parts of the image; tilts: facing " << report.coverage.tilts[0] << ", left " << report.coverage.tilts[1]
      << ", right " << report.coverage.tilts[2] << ", upper " << report.coverage.tilts[3] << ", lower "
      << report.coverage.tilts[4] << " edge nearer\n";
  if (report.judgement.enough) {
    out << "enough: this calibration is good for use\n";
  } else {
    out << "not enough yet:\n";
    for (const auto& text : report.judgement.missing) out << "  " << text << "\n";
  }
}

Json calibration_json(const CalibrateReport& report) {
  const CameraCalibration& c = report.outcome.calibration;
  Json out;
  out["board"] = board_json(report.views.data.target);
  out["model"] = to_string(c.model);
  out["image"] = {{"width", c.camera.width()}, {"height", c.camera.height()}};
  out["parameters"] = parameters_json(c.names, c.parameters, c.sigma, c.sigma_views);
  out["residuals_px"] = {{"rms", c.rms_px}, {"mean", c.mean_px}, {"noise", c.noise_px}, {"max", c.max_px}};
  out["corners"] = {{"seen", c.corners}, {"outliers", c.outliers}};
  out["converged"] = c.converged;
  out["held_out"] = {{"views", report.outcome.held_out_views}, {"rms_px", report.outcome.held_out_px}};
  Json models = Json::array();
  for (const auto& score : report.outcome.scores)
    models.push_back({{"model", to_string(score.model)},
                      {"ok", score.ok},
                      {"reason", score.reason},
                      {"cross_validated_px", score.error_px},
                      {"excess", score.excess},
                      {"excess_standard_error", score.excess_error}});
  out["models_tried"] = models;
  out["uncertainty_px"] = {{"max", report.uncertainty.max_px},
                           {"mean", report.uncertainty.mean_px},
                           {"columns", report.uncertainty.columns},
                           {"rows", report.uncertainty.rows},
                           {"grid", report.uncertainty.sigma_px}};
  out["coverage"] = {{"columns", report.coverage.columns},
                     {"rows", report.coverage.rows},
                     {"corners", report.coverage.cells},
                     {"share", report.coverage.covered_share()},
                     {"tilts", report.coverage.tilts}};
  out["enough"] = report.judgement.enough;
  out["missing"] = report.judgement.missing;
  Json views = Json::array();
  for (const auto& view : c.views) {
    Json entry{{"name", view.name}, {"frame", view.frame}, {"rms_px", view.rms_px}, {"outliers", view.outliers}};
    entry["camera_from_target"] = pose_json(view.camera_from_target);
    views.push_back(entry);
  }
  out["views"] = views;
  out["unused"] = report.views.unused;
  return out;
}

void print_stereo(const StereoResult& result, const GatheredPairs& pairs, std::ostream& out) {
  out << "pairs: " << result.pairs << " of " << pairs.frames << ", " << result.corners << " corners ("
      << result.outliers << " outliers)\n";
  const auto names = lens_parameter_names(lens_model(result.calibration.left));
  out << "left camera: " << to_string(lens_model(result.calibration.left)) << "\n";
  print_parameters(names, lens_parameters(result.calibration.left), result.left_sigma, out);
  out << "right camera:\n";
  print_parameters(names, lens_parameters(result.calibration.right), result.right_sigma, out);
  const RigidTransform& T = result.calibration.right_from_left;
  out << "right from left:\n";
  const Eigen::Vector3d w = log_so3(T.R);
  const char* axes[] = {"x", "y", "z"};
  for (int i = 0; i < 3; ++i)
    out << "  t" << axes[i] << "    " << with_sigma(T.t(i) * 1e3, result.rig_sigma(i) * 1e3) << " mm\n";
  for (int i = 0; i < 3; ++i)
    out << "  r" << axes[i] << "    "
        << with_sigma(w(i) * 180 / 3.14159265358979, result.rig_sigma(3 + i) * 180 / 3.14159265358979) << " degrees\n";
  out << "baseline: " << std::fixed << std::setprecision(3) << T.t.norm() * 1e3 << " mm\n";
  out << "residual: rms " << pixels(result.rms_px) << ", noise " << pixels(result.noise_px)
      << " a coordinate; from the epipolar lines: " << pixels(result.epipolar_px) << "\n";
}

Json stereo_json(const StereoResult& result, const GatheredPairs& pairs) {
  Json out;
  out["board"] = board_json(pairs.data.target);
  const auto names = lens_parameter_names(lens_model(result.calibration.left));
  out["model"] = to_string(lens_model(result.calibration.left));
  out["left"] = parameters_json(names, lens_parameters(result.calibration.left), result.left_sigma, result.left_sigma);
  out["right"] =
      parameters_json(names, lens_parameters(result.calibration.right), result.right_sigma, result.right_sigma);
  out["right_from_left"] = pose_json(result.calibration.right_from_left);
  Json sigma = Json::array();
  for (int i = 0; i < 6; ++i) sigma.push_back(result.rig_sigma(i));
  out["right_from_left_sigma_m_rad"] = sigma;
  out["baseline_m"] = result.calibration.baseline_m();
  out["residuals_px"] = {{"rms", result.rms_px}, {"noise", result.noise_px}, {"epipolar", result.epipolar_px}};
  out["pairs"] = result.pairs;
  out["corners"] = {{"seen", result.corners}, {"outliers", result.outliers}};
  return out;
}

}  // namespace parallax
