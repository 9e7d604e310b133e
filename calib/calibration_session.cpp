#include "calib/calibration_session.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "calib/initial_lens.h"
#include "calib/planar_pose.h"
#include "calib/view_geometry.h"
#include "core/error.h"

namespace parallax {
namespace {

constexpr double reference_width_px = 640;
// Angles count as places do: a view tilted by half a radian differs as much as one half an image width away.
constexpr double roll_weight = 0.5;
constexpr double wanted_tilt_rad = 0.55;
// Views after which a lens is guessed from the views themselves.
constexpr std::size_t guess_at[] = {4, 8};

// The middle of what is printed.
Eigen::Vector3d middle_of(const CalibrationTarget& target) {
  const TargetExtent extent = target_extent(target);
  return {0.5 * (extent.left + extent.right), 0.5 * (extent.top + extent.bottom), 0};
}

}  // namespace

void CalibrationSessionOptions::validate() const {
  const auto refuse = [](const std::string& what, double found, const std::string& expected) {
    throw InputError("calibration session: " + what + ": found " + std::to_string(found) + ", expected " + expected);
  };
  if (cell_columns < 2 || cell_rows < 2) refuse("cells", std::min(cell_columns, cell_rows), "2 or more");
  if (fewest_views < 3) refuse("fewest_views", fewest_views, "3 or more");
  if (most_views < fewest_views) refuse("most_views", most_views, "fewest_views or more");
  if (!(covered_share > 0 && covered_share <= 1)) refuse("covered_share", covered_share, "a share above 0");
  if (!(still_share > 0)) refuse("still_share", still_share, "a share above 0");
  if (!(sharp_edge_px > 1)) refuse("sharp_edge_px", sharp_edge_px, "more than 1");
  if (!(new_distance > 0)) refuse("new_distance", new_distance, "more than 0");
}

CalibrationSession::CalibrationSession(const CalibrationTarget& target, int width, int height,
                                       const CalibrationSessionOptions& options)
    : target_(target), options_(options) {
  target.validate();
  options.validate();
  points_ = target_points(target);
  data_.target = target;
  data_.width = width;
  data_.height = height;
  // A moderately wide lens, until the views say better.
  const double focal = 0.85 * width;
  estimate_ =
      CameraModel(CameraModelKind::pinhole, width, height, {focal, focal}, {0.5 * (width - 1), 0.5 * (height - 1)});
  count_coverage();
}

CalibrationSession::ViewPlace CalibrationSession::place_of(const TargetDetection& detection) const {
  ViewPlace place;
  const ViewPoints view = view_points(points_, detection.corners);
  RigidTransform pose;
  double rms = 0;
  const Eigen::Vector3d middle = middle_of(target_);
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Vector2d low = view.pixels[0], high = view.pixels[0];
  for (const auto& p : view.pixels) {
    px += p / static_cast<double>(view.pixels.size());
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  place.centre = px / data_.width;
  place.size = std::sqrt((high - low).prod()) / data_.width;
  if (find_planar_pose(estimate_, view.points, view.pixels, &pose, &rms)) {
    place.tilt = tilt_against_sight(pose, middle);
    place.roll = std::atan2(pose.R(1, 0), pose.R(0, 0));
  }
  return place;
}

bool CalibrationSession::is_still(const TargetDetection& detection) const {
  if (!previous_ || previous_->corners.empty()) return false;
  // A target that looks the same when turned may have been counted the other way round.
  double least = std::numeric_limits<double>::infinity();
  for (const auto& ids : target_symmetries(target_)) {
    std::vector<double> moved;
    for (const auto& corner : detection.corners) {
      const int id = ids[static_cast<std::size_t>(corner.id)];
      const auto before = std::lower_bound(previous_->corners.begin(), previous_->corners.end(), id,
                                           [](const TargetCorner& c, int want) { return c.id < want; });
      if (before != previous_->corners.end() && before->id == id) moved.push_back((corner.px - before->px).norm());
    }
    if (moved.size() < 4) continue;
    std::nth_element(moved.begin(), moved.begin() + static_cast<std::ptrdiff_t>(moved.size() / 2), moved.end());
    least = std::min(least, moved[moved.size() / 2]);
  }
  return least < options_.still_share * data_.width;
}

bool CalibrationSession::is_new(const TargetDetection& detection, const ViewPlace& place) const {
  // Corners in two parts of the image that had none make any view welcome.
  std::vector<bool> touched(coverage_.cells.size(), false);
  for (const auto& corner : detection.corners) {
    const int column =
        std::clamp(static_cast<int>((corner.px.x() + 0.5) * coverage_.columns / data_.width), 0, coverage_.columns - 1);
    const int row =
        std::clamp(static_cast<int>((corner.px.y() + 0.5) * coverage_.rows / data_.height), 0, coverage_.rows - 1);
    touched[static_cast<std::size_t>(row * coverage_.columns + column)] = true;
  }
  int fresh = 0;
  for (std::size_t i = 0; i < touched.size(); ++i) fresh += touched[i] && coverage_.cells[i] == 0 ? 1 : 0;
  if (fresh >= 2) return true;
  const auto tilt = static_cast<std::size_t>(tilt_of(place.tilt, options_.tilt_rad));
  if (coverage_.tilts[tilt] == 0) return true;
  for (const auto& other : places_) {
    double roll = std::abs(place.roll - other.roll);
    roll = std::min(roll, 2 * std::numbers::pi - roll);
    const double distance =
        std::sqrt((place.centre - other.centre).squaredNorm() + (place.size - other.size) * (place.size - other.size) +
                  0.5 * (place.tilt - other.tilt).squaredNorm() + roll_weight * roll_weight * roll * roll);
    if (distance < options_.new_distance) return false;
  }
  return true;
}

void CalibrationSession::keep(const TargetDetection& detection, const ViewPlace& place, int frame_index) {
  data_.views.push_back({frame_index, "frame " + std::to_string(frame_index), detection.corners});
  places_.push_back(place);
  if (!estimate_given_ &&
      std::find(std::begin(guess_at), std::end(guess_at), data_.views.size()) != std::end(guess_at)) {
    std::vector<ViewPoints> views;
    for (const auto& view : data_.views) views.push_back(view_points(points_, view.corners));
    const auto guesses = guess_lenses(views, data_.width, data_.height);
    if (!guesses.empty()) estimate_ = guesses[0].camera;
  }
  count_coverage();
}

void CalibrationSession::count_coverage() { coverage_ = measure_coverage(data_, estimate_, options_); }

CalibrationFrameResult CalibrationSession::consider(const TargetDetection& detection, int frame_index) {
  CalibrationFrameResult out;
  out.detection = detection;
  if (static_cast<int>(data_.views.size()) >= options_.most_views) {
    out.verdict = FrameVerdict::full;
    out.text = "enough views are kept";
    return out;
  }
  if (detection.edge_px > options_.sharp_edge_px * std::max(1.0, data_.width / reference_width_px)) {
    out.verdict = FrameVerdict::blurred;
    out.text = "blurred: hold still, more light helps";
    return out;
  }
  const ViewPlace place = place_of(detection);
  if (!is_new(detection, place)) {
    out.verdict = FrameVerdict::seen_before;
    out.text = "seen before: " + wanted_view().text;
    return out;
  }
  keep(detection, place, frame_index);
  out.verdict = FrameVerdict::kept;
  out.text = "kept view " + std::to_string(data_.views.size());
  return out;
}

CalibrationFrameResult CalibrationSession::add_frame(const GreyImage& grey, int frame_index) {
  CalibrationFrameResult out;
  if (grey.cols != data_.width || grey.rows != data_.height) {
    out.text = "the image has another size than the first one";
    return out;
  }
  DetectionOptions detection;
  detection.thorough = false;
  auto found = detect_target(grey, target_, detection);
  if (!found) {
    previous_.reset();
    out.text = "no board in view: hold the whole board into the picture";
    return out;
  }
  const bool still = is_still(*found);
  previous_ = found;
  if (still) return consider(*found, frame_index);
  out.verdict = FrameVerdict::moving;
  out.text = "hold still";
  out.detection = std::move(found);
  return out;
}

CalibrationFrameResult CalibrationSession::add_detection(const TargetDetection& detection, int frame_index) {
  return consider(detection, frame_index);
}

void CalibrationSession::set_estimate(const CameraModel& camera) {
  if (camera.width() != data_.width || camera.height() != data_.height) return;
  estimate_ = camera;
  estimate_given_ = true;
  count_coverage();
}

bool CalibrationSession::drop_last_view() {
  if (data_.views.empty()) return false;
  data_.views.pop_back();
  places_.pop_back();
  count_coverage();
  return true;
}

double CalibrationSession::progress() const {
  const double views = std::min(1.0, coverage_.views / static_cast<double>(options_.fewest_views));
  const double cells = std::min(1.0, coverage_.covered_share() / options_.covered_share);
  int directions = 0;
  for (std::size_t i = 1; i < coverage_.tilts.size(); ++i) directions += coverage_.tilts[i] > 0 ? 1 : 0;
  const double tilts = std::min(1.0, directions / 3.0);
  if (views >= 1 && cells >= 1 && tilts >= 1) return 1;
  return std::min(0.99, (views + cells + tilts) / 3);
}

WantedView CalibrationSession::view_at(const std::string& text, const Eigen::Vector2d& centre_px, double size,
                                       BoardTilt tilt) const {
  WantedView out;
  out.text = text;
  Eigen::Vector3d sight;
  if (!estimate_.unproject(centre_px, &sight)) sight = Eigen::Vector3d::UnitZ();
  sight.normalize();
  // Facing the line of sight, then tilted: the left edge is nearer when the target turns about its y axis.
  Eigen::Matrix3d R = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), sight).toRotationMatrix();
  const double a = wanted_tilt_rad;
  Eigen::Vector3d axis = Eigen::Vector3d::Zero();
  if (tilt == BoardTilt::left) axis = {0, -a, 0};
  if (tilt == BoardTilt::right) axis = {0, a, 0};
  if (tilt == BoardTilt::top) axis = {a, 0, 0};
  if (tilt == BoardTilt::bottom) axis = {-a, 0, 0};
  R = R * exp_so3(axis);
  const TargetExtent extent = target_extent(target_);
  const Eigen::Vector3d middle = middle_of(target_);
  const double distance = extent.width() * estimate_.mean_focal_px() / (size * data_.width);
  const RigidTransform pose(R, sight * distance - R * middle);
  const Eigen::Vector2d corners[4] = {{extent.left, extent.top},
                                      {extent.right, extent.top},
                                      {extent.right, extent.bottom},
                                      {extent.left, extent.bottom}};
  constexpr int steps = 8;
  for (int side = 0; side < 4; ++side) {
    for (int i = 0; i < steps; ++i) {
      const Eigen::Vector2d p = corners[side] + (corners[(side + 1) % 4] - corners[side]) * i / steps;
      Eigen::Vector2d px;
      if (estimate_.project(pose * Eigen::Vector3d(p.x(), p.y(), 0), &px)) out.outline_px.push_back(px);
    }
  }
  for (const auto& point : points_) {
    Eigen::Vector2d px;
    if (estimate_.project(pose * point, &px)) out.inner_px.push_back(px);
  }
  return out;
}

WantedView CalibrationSession::wanted_view() const {
  const Eigen::Vector2d middle(0.5 * (data_.width - 1), 0.5 * (data_.height - 1));
  if (coverage_.views == 0)
    return view_at("Hold the board still in the middle of the picture", middle, 0.55, BoardTilt::facing);
  // Tilts and empty parts of the image take turns.
  const char* edges[] = {"", "left", "right", "upper", "lower"};
  const bool tilt_turn = coverage_.views % 2 == 1 || coverage_.covered_share() >= options_.covered_share;
  if (tilt_turn) {
    for (std::size_t i = 1; i < coverage_.tilts.size(); ++i)
      if (coverage_.tilts[i] == 0)
        return view_at(std::string("Tilt the board: bring its ") + edges[i] + " edge nearer to the camera", middle, 0.6,
                       static_cast<BoardTilt>(i));
  }
  // The emptiest cell, the corners of the image first: they are hardest to reach and say most about the lens.
  int best = -1;
  double best_score = -1;
  for (std::size_t i = 0; i < coverage_.cells.size(); ++i) {
    if (coverage_.cells[i] > 0) continue;
    const int column = static_cast<int>(i) % coverage_.columns, row = static_cast<int>(i) / coverage_.columns;
    const double x = (column + 0.5) / coverage_.columns - 0.5, y = (row + 0.5) / coverage_.rows - 0.5;
    const double score = std::hypot(x, y);
    if (score > best_score) {
      best_score = score;
      best = static_cast<int>(i);
    }
  }
  if (best >= 0) {
    const Eigen::Vector2d cell((best % coverage_.columns + 0.5) * data_.width / coverage_.columns,
                               (best / coverage_.columns + 0.5) * data_.height / coverage_.rows);
    // The board's own half reaches the cell when its middle is between the cell and the image's middle.
    return view_at(
        "Move the board to the " + cell_in_words(best, coverage_.columns, coverage_.rows) + " of the picture",
        0.55 * cell + 0.45 * middle, 0.5, BoardTilt::facing);
  }
  for (std::size_t i = 1; i < coverage_.tilts.size(); ++i)
    if (coverage_.tilts[i] == 0)
      return view_at(std::string("Tilt the board: bring its ") + edges[i] + " edge nearer to the camera", middle, 0.6,
                     static_cast<BoardTilt>(i));
  if (coverage_.near_views == 0)
    return view_at("Bring the board nearer, until it fills the picture", middle, 0.85, BoardTilt::facing);
  if (coverage_.far_views == 0) return view_at("Hold the board further away", middle, 0.28, BoardTilt::facing);
  const auto least = std::min_element(coverage_.tilts.begin() + 1, coverage_.tilts.end()) - coverage_.tilts.begin();
  return view_at(
      std::string("Another tilted view: bring its ") + edges[least] + " edge nearer, nearer to a border of the picture",
      middle + Eigen::Vector2d(0.15 * data_.width * (coverage_.views % 2 == 0 ? 1 : -1), 0), 0.6,
      static_cast<BoardTilt>(least));
}

CalibrationJudgement CalibrationSession::judge(const CalibrationOutcome& outcome) const {
  return judge_calibration(coverage_, outcome, options_);
}

}  // namespace parallax
