// What the views of a calibration cover, and whether that and what came of it is enough.
#include <algorithm>
#include <cmath>
#include <sstream>

#include "calib/calibration_session.h"
#include "calib/planar_pose.h"
#include "calib/view_geometry.h"
#include "core/error.h"

namespace parallax {
namespace {

constexpr double reference_width_px = 640;  // of the limits in pixels

std::string cell_name(int column, int row, int columns, int rows) {
  const bool left = 3 * column + 1 < columns, right = 3 * (columns - 1 - column) + 1 < columns;
  const bool top = 3 * row + 1 < rows, bottom = 3 * (rows - 1 - row) + 1 < rows;
  const std::string vertical = top ? "upper " : bottom ? "lower " : "";
  if (left) return vertical + "left";
  if (right) return vertical + "right";
  return top ? "upper edge" : bottom ? "lower edge" : "middle";
}

}  // namespace

int CalibrationCoverage::covered_cells() const {
  return static_cast<int>(std::count_if(cells.begin(), cells.end(), [](int n) { return n > 0; }));
}

double CalibrationCoverage::covered_share() const {
  return cells.empty() ? 0 : covered_cells() / static_cast<double>(cells.size());
}

std::string cell_in_words(int cell, int columns, int rows) {
  return cell_name(cell % columns, cell / columns, columns, rows);
}

BoardTilt tilt_of(const Eigen::Vector2d& normal_xy, double limit_rad) {
  if (normal_xy.norm() < std::sin(limit_rad)) return BoardTilt::facing;
  if (std::abs(normal_xy.x()) > std::abs(normal_xy.y())) return normal_xy.x() < 0 ? BoardTilt::left : BoardTilt::right;
  return normal_xy.y() < 0 ? BoardTilt::top : BoardTilt::bottom;
}

Eigen::Vector2d tilt_against_sight(const RigidTransform& camera_from_target, const Eigen::Vector3d& middle) {
  // The normal seen from a camera turned towards the target: what makes an edge nearer than the other.
  const Eigen::Vector3d sight = (camera_from_target * middle).normalized();
  const Eigen::Matrix3d turn = Eigen::Quaterniond::FromTwoVectors(sight, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return (turn * camera_from_target.R.col(2)).head<2>();
}

CalibrationCoverage measure_coverage(const CalibrationData& data, const CameraModel& camera,
                                     const CalibrationSessionOptions& options) {
  CalibrationCoverage out;
  out.columns = options.cell_columns;
  out.rows = options.cell_rows;
  out.cells.assign(static_cast<std::size_t>(out.columns * out.rows), 0);
  const std::vector<Eigen::Vector3d> points = target_points(data.target);
  const TargetExtent extent = target_extent(data.target);
  const Eigen::Vector3d middle(0.5 * (extent.left + extent.right), 0.5 * (extent.top + extent.bottom), 0);
  for (const auto& view : data.views) {
    ++out.views;
    std::vector<Eigen::Vector3d> seen;
    std::vector<Eigen::Vector2d> pixels;
    double low = data.width, high = 0;
    for (const auto& corner : view.corners) {
      const int column =
          std::clamp(static_cast<int>((corner.px.x() + 0.5) * out.columns / data.width), 0, out.columns - 1);
      const int row = std::clamp(static_cast<int>((corner.px.y() + 0.5) * out.rows / data.height), 0, out.rows - 1);
      ++out.cells[static_cast<std::size_t>(row * out.columns + column)];
      seen.push_back(points[static_cast<std::size_t>(corner.id)]);
      pixels.push_back(corner.px);
      low = std::min(low, corner.px.x());
      high = std::max(high, corner.px.x());
    }
    if (high - low > 0.5 * data.width) ++out.near_views;
    if (high - low < data.width / 3.0) ++out.far_views;
    RigidTransform pose;
    double rms = 0;
    if (!find_planar_pose(camera, seen, pixels, &pose, &rms)) continue;
    ++out.tilts[static_cast<std::size_t>(tilt_of(tilt_against_sight(pose, middle), options.tilt_rad))];
  }
  return out;
}

CalibrationJudgement judge_calibration(const CalibrationCoverage& coverage, const CalibrationOutcome& outcome,
                                       const CalibrationSessionOptions& options) {
  CalibrationJudgement out;
  const auto say = [&out](const std::string& text) { out.missing.push_back(text); };
  if (!outcome.ok) {
    say("The views do not give a lens: " + outcome.reason + ".");
    return out;
  }
  const auto rounded = [](double value) {
    std::ostringstream text;
    text << std::round(value * 100) / 100;
    return text.str();
  };
  if (coverage.views < options.fewest_views)
    say("Take more views: " + std::to_string(coverage.views) + " of " + std::to_string(options.fewest_views) + ".");
  if (coverage.covered_share() < options.covered_share) {
    const auto empty = std::find(coverage.cells.begin(), coverage.cells.end(), 0) - coverage.cells.begin();
    say("Cover more of the image: " + std::to_string(coverage.covered_cells()) + " of " +
        std::to_string(coverage.cells.size()) + " parts have corners; the " +
        cell_in_words(static_cast<int>(empty), coverage.columns, coverage.rows) + " has none.");
  }
  int directions = 0;
  for (std::size_t i = 1; i < coverage.tilts.size(); ++i) directions += coverage.tilts[i] > 0 ? 1 : 0;
  if (directions < 3)
    say("Tilt the board: " + std::to_string(directions) + " of 4 directions seen, at least 3 are needed.");
  const double scale = outcome.calibration.camera.width() / reference_width_px;
  if (outcome.calibration.noise_px > options.enough_noise_px * scale)
    say("The corners do not fit the lens: " + rounded(outcome.calibration.noise_px) + " px of noise, at most " +
        rounded(options.enough_noise_px * scale) + " px are good; is the board flat, and its size right?");
  const double uncertainty = projection_uncertainty(outcome.calibration).max_px;
  if (uncertainty > options.enough_uncertainty_px * scale)
    say("The lens is uncertain by up to " + rounded(uncertainty) + " px where it is known least, at most " +
        rounded(options.enough_uncertainty_px * scale) + " px are good: more views near the border and tilted ones.");
  out.enough = out.missing.empty();
  return out;
}

}  // namespace parallax
