// ChArUco boards: OpenCV finds the markers; each inner corner is predicted from the markers beside it and refined.
#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/aruco.hpp>

#include "calib/planar_pose.h"
#include "calib/target_detectors.h"

namespace parallax {
namespace {

struct SeenMarker {
  Eigen::Vector2i square;
  std::array<Eigen::Vector2d, 4> on_target, px;
};

}  // namespace

std::vector<TargetCorner> detect_charuco(const GreyImage& image, const CalibrationTarget& target,
                                         const DetectionOptions& options) {
  std::vector<std::vector<cv::Point2f>> quads;
  std::vector<int> ids;
  auto parameters = cv::aruco::DetectorParameters::create();
  if (!options.thorough) parameters->adaptiveThreshWinSizeStep = 20;
  parameters->minMarkerPerimeterRate = 0.02;
  cv::aruco::detectMarkers(image, cv::aruco::getPredefinedDictionary(cv::aruco::DICT_5X5_250), quads, ids, parameters);

  std::map<std::pair<int, int>, SeenMarker> seen;  // by square
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (ids[i] >= charuco_marker_count(target)) continue;
    SeenMarker marker;
    marker.on_target = charuco_marker(target, ids[i], &marker.square);
    for (std::size_t k = 0; k < 4; ++k) marker.px[k] = {quads[i][k].x, quads[i][k].y};
    seen[{marker.square.x(), marker.square.y()}] = marker;
  }

  std::vector<TargetCorner> corners;
  for (int row = 0; row < target.rows; ++row) {
    for (int column = 0; column < target.columns; ++column) {
      // The squares around the inner corner; the two white ones carry markers.
      std::vector<Eigen::Vector2d> from, to;
      for (int r = row; r <= row + 1; ++r) {
        for (int c = column; c <= column + 1; ++c) {
          const auto marker = seen.find({c, r});
          if (marker == seen.end()) continue;
          from.insert(from.end(), marker->second.on_target.begin(), marker->second.on_target.end());
          to.insert(to.end(), marker->second.px.begin(), marker->second.px.end());
        }
      }
      Eigen::Matrix3d image_from_target;
      if (from.size() < 4 || !find_homography(from, to, &image_from_target)) continue;
      const Eigen::Vector2d corner(column * target.square_m, row * target.square_m);
      const Eigen::Vector2d guess = (image_from_target * corner.homogeneous()).hnormalized();
      double side = 1e9;
      for (const Eigen::Vector2d& step :
           {Eigen::Vector2d(1, 0), Eigen::Vector2d(-1, 0), Eigen::Vector2d(0, 1), Eigen::Vector2d(0, -1)}) {
        const Eigen::Vector2d next =
            (image_from_target * (corner + target.square_m * step).homogeneous()).hnormalized();
        side = std::min(side, (next - guess).norm());
      }
      if (!guess.allFinite() || !(side > 4)) continue;
      cv::Point2f refined(static_cast<float>(guess.x()), static_cast<float>(guess.y()));
      // First in a window that surely holds the corner, then in one that stays clear of the markers, which begin an
      // eighth of a side from the edges.
      if (!refine_corner(image, std::clamp(static_cast<int>(0.3 * side), 2, 7), &refined)) continue;
      if (!refine_corner(image, std::clamp(static_cast<int>(0.14 * side), 2, 7), &refined)) continue;
      refine_crossing(image, std::clamp(0.18 * side, 2.5, 5.0), &refined);
      const Eigen::Vector2d px(refined.x, refined.y);
      if ((px - guess).norm() > 0.2 * side) continue;
      corners.push_back({row * target.columns + column, px});
    }
  }
  return corners;
}

}  // namespace parallax
