// Grids of separate black squares (Zhang 2000): dark quadrilaterals, put in order by growing the grid from neighbour to
// neighbour, their corners refined.
#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>
#include <queue>

#include "calib/planar_pose.h"
#include "calib/target_detectors.h"

namespace parallax {
namespace {

struct Quad {
  std::array<Eigen::Vector2d, 4> corner;  // clockwise in the image
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
};

std::vector<Quad> dark_quads(const GreyImage& image, int block) {
  cv::Mat1b black;
  cv::adaptiveThreshold(image, black, 255, cv::ADAPTIVE_THRESH_MEAN_C, cv::THRESH_BINARY_INV, block, 10);
  std::vector<std::vector<cv::Point>> contours;
  cv::findContours(black, contours, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
  std::vector<Quad> quads;
  for (const auto& contour : contours) {
    const double area = cv::contourArea(contour), perimeter = cv::arcLength(contour, true);
    if (area < 30 || area > 0.05 * static_cast<double>(image.total())) continue;
    std::vector<cv::Point> outline;
    cv::approxPolyDP(contour, outline, 0.08 * perimeter, true);
    if (outline.size() != 4 || !cv::isContourConvex(outline)) continue;
    if (area < 0.02 * perimeter * perimeter) continue;  // a square: 0.0625
    Quad quad;
    const bool clockwise = cv::contourArea(outline, true) > 0;  // with y down
    for (std::size_t i = 0; i < 4; ++i) {
      const cv::Point& p = outline[clockwise ? i : 3 - i];
      quad.corner[i] = {p.x, p.y};
      quad.centre += 0.25 * quad.corner[i];
    }
    quads.push_back(quad);
  }
  return quads;
}

// Where the neighbour's centre should be, in units of the side: the grid's step along the side k -> k + 1.
Eigen::Vector2d neighbour_centre(const Quad& quad, int direction, double pitch) {
  const auto& c = quad.corner;
  const Eigen::Vector2d right = 0.5 * (c[1] - c[0] + c[2] - c[3]), down = 0.5 * (c[3] - c[0] + c[2] - c[1]);
  switch (direction) {
    case 0:
      return quad.centre + pitch * right;
    case 1:
      return quad.centre + pitch * down;
    case 2:
      return quad.centre - pitch * right;
    default:
      return quad.centre - pitch * down;
  }
}

// Turns the neighbour so that its first corner is the one that lies like the quad's own.
Quad turned_like(const Quad& quad, Quad other) {
  const Eigen::Vector2d want = quad.corner[0] - quad.centre;
  int best = 0;
  for (int k = 1; k < 4; ++k)
    if (want.dot(other.corner[static_cast<std::size_t>(k)] - other.centre) >
        want.dot(other.corner[static_cast<std::size_t>(best)] - other.centre))
      best = k;
  std::rotate(other.corner.begin(), other.corner.begin() + best, other.corner.end());
  return other;
}

// Cells of the grid that grows from one quad.
std::map<std::pair<int, int>, Quad> grow_grid(const std::vector<Quad>& quads, std::size_t seed, double pitch) {
  std::map<std::pair<int, int>, Quad> grid;
  std::vector<bool> taken(quads.size(), false);
  std::queue<std::pair<int, int>> front;
  grid[{0, 0}] = quads[seed];
  taken[seed] = true;
  front.push({0, 0});
  constexpr int step[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
  while (!front.empty()) {
    const auto cell = front.front();
    front.pop();
    const Quad quad = grid[cell];
    const double side = 0.25 * ((quad.corner[0] - quad.corner[1]).norm() + (quad.corner[1] - quad.corner[2]).norm() +
                                (quad.corner[2] - quad.corner[3]).norm() + (quad.corner[3] - quad.corner[0]).norm());
    for (int direction = 0; direction < 4; ++direction) {
      const std::pair<int, int> next{cell.first + step[direction][0], cell.second + step[direction][1]};
      if (grid.count(next) > 0) continue;
      const Eigen::Vector2d expected = neighbour_centre(quad, direction, pitch);
      std::size_t nearest = quads.size();
      double distance = 0.4 * side;
      for (std::size_t i = 0; i < quads.size(); ++i) {
        if (taken[i] || !((quads[i].centre - expected).norm() < distance)) continue;
        distance = (quads[i].centre - expected).norm();
        nearest = i;
      }
      if (nearest == quads.size()) continue;
      taken[nearest] = true;
      grid[next] = turned_like(quad, quads[nearest]);
      front.push(next);
    }
  }
  return grid;
}

}  // namespace

std::vector<TargetCorner> detect_squares(const GreyImage& image, const CalibrationTarget& target,
                                         const DetectionOptions&) {
  const double pitch = (target.square_m + target.detail()) / target.square_m;
  const auto wanted = static_cast<std::size_t>(target.columns * target.rows);
  for (const int share : {8, 16, 4}) {
    const int block = std::max(image.cols, image.rows) / share | 1;
    const std::vector<Quad> quads = dark_quads(image, std::max(block, 7));
    if (quads.size() < wanted) continue;
    for (std::size_t seed = 0; seed < quads.size(); seed += 1 + quads.size() / 16) {
      const auto grid = grow_grid(quads, seed, pitch);
      if (grid.size() != wanted) continue;
      int left = 0, top = 0, right = 0, bottom = 0;
      for (const auto& [cell, quad] : grid) {
        left = std::min(left, cell.first);
        right = std::max(right, cell.first);
        top = std::min(top, cell.second);
        bottom = std::max(bottom, cell.second);
      }
      const int columns = right - left + 1, rows = bottom - top + 1;
      const bool upright = columns == target.columns && rows == target.rows;
      if (!upright && !(columns == target.rows && rows == target.columns)) continue;
      std::vector<TargetCorner> corners;
      for (const auto& [cell, quad] : grid) {
        const int c = cell.first - left, r = cell.second - top;
        for (int k = 0; k < 4; ++k) {
          const Eigen::Vector2d& at = quad.corner[static_cast<std::size_t>(k)];
          const double side = std::min((at - quad.corner[static_cast<std::size_t>((k + 1) % 4)]).norm(),
                                       (at - quad.corner[static_cast<std::size_t>((k + 3) % 4)]).norm());
          cv::Point2f refined(static_cast<float>(at.x()), static_cast<float>(at.y()));
          const double free = side * std::min(1.0, pitch - 1);
          if (!refine_corner(image, std::clamp(static_cast<int>(0.45 * free), 2, 6), &refined)) continue;
          // A quarter turn where the grid lies on its side.
          const int id =
              upright ? 4 * (r * target.columns + c) + k : 4 * ((columns - 1 - c) * target.columns + r) + (k + 3) % 4;
          corners.push_back({id, {refined.x, refined.y}});
        }
      }
      std::sort(corners.begin(), corners.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
      return corners;
    }
  }
  return {};
}

}  // namespace parallax
