#include "calib/target.h"

#include <cmath>
#include <opencv2/aruco.hpp>

#include "core/error.h"

namespace parallax {
namespace {

constexpr int largest_side = 100, smallest_side = 3;
constexpr int largest_marker_count = 250;

// Inside the square `column`, `row` of a chessboard whose first inner corner is the origin.
int cell_of(double x, double side) { return static_cast<int>(std::floor(x / side)) + 1; }

bool charuco_black(const CalibrationTarget& target, double x, double y) {
  const int column = cell_of(x, target.square_m), row = cell_of(y, target.square_m);
  if ((column + row) % 2 == 0) return true;
  int marker = 0;
  // Count up: boards are small.
  for (int r = 0; r <= row; ++r)
    for (int c = 0; c <= target.columns; ++c) {
      if (r == row && c == column) break;
      if ((r + c) % 2 == 1) ++marker;
    }
  const double margin = 0.5 * (target.square_m - target.detail());
  const double u = (x - (column - 1) * target.square_m - margin) / target.detail();
  const double v = (y - (row - 1) * target.square_m - margin) / target.detail();
  if (u < 0 || v < 0 || u >= 1 || v >= 1) return false;
  return charuco_marker_cells(marker)[static_cast<std::size_t>(v * 7)][static_cast<std::size_t>(u * 7)];
}

Eigen::Vector2d circle_centre(const CalibrationTarget& target, int column, int row) {
  if (target.kind == TargetKind::circles) return {column * target.square_m, row * target.square_m};
  return {(2 * column + row % 2) * target.square_m, row * target.square_m};
}

}  // namespace

const char* to_string(TargetKind kind) {
  switch (kind) {
    case TargetKind::chessboard:
      return "chessboard";
    case TargetKind::charuco:
      return "charuco";
    case TargetKind::circles:
      return "circles";
    case TargetKind::asymmetric_circles:
      return "acircles";
    case TargetKind::squares:
      return "squares";
  }
  return "unknown";
}

TargetKind target_kind(const std::string& name) {
  for (const TargetKind kind : {TargetKind::chessboard, TargetKind::charuco, TargetKind::circles,
                                TargetKind::asymmetric_circles, TargetKind::squares})
    if (name == to_string(kind)) return kind;
  throw InputError("target: found '" + name + "', expected chessboard, charuco, circles, acircles or squares");
}

double CalibrationTarget::detail() const {
  if (detail_m > 0) return detail_m;
  switch (kind) {
    case TargetKind::charuco:
      return 0.75 * square_m;
    case TargetKind::circles:
      return 0.5 * square_m;
    case TargetKind::asymmetric_circles:
      return 0.9 * square_m;
    default:
      return 0.77778 * square_m;
  }
}

void CalibrationTarget::validate() const {
  const int least = kind == TargetKind::squares ? 2 : smallest_side;
  const auto side = [least](const char* name, int value) {
    if (value < least || value > largest_side)
      throw InputError(std::string("board: ") + name + ": found " + std::to_string(value) + ", expected " +
                       std::to_string(least) + " to " + std::to_string(largest_side));
  };
  side("columns", columns);
  side("rows", rows);
  if (!(square_m > 0) || !std::isfinite(square_m) || square_m > 100)
    throw InputError("square: found " + std::to_string(square_m) + ", expected metres above 0");
  if (!(detail_m >= 0) || !std::isfinite(detail_m))
    throw InputError("marker, circle or gap: found " + std::to_string(detail_m) + ", expected metres above 0");
  const double most = kind == TargetKind::asymmetric_circles ? 1.3 * square_m : 0.95 * square_m;
  if (kind != TargetKind::squares && kind != TargetKind::chessboard && detail() > most)
    throw InputError("marker or circle: found " + std::to_string(detail()) + " m, expected less than " +
                     std::to_string(most) + " m for squares of " + std::to_string(square_m) + " m");
  if (kind == TargetKind::charuco && charuco_marker_count(*this) > largest_marker_count)
    throw InputError("board: found " + std::to_string(charuco_marker_count(*this)) +
                     " markers, expected at most 250 in a charuco board");
}

int target_point_count(const CalibrationTarget& target) {
  return target.columns * target.rows * (target.kind == TargetKind::squares ? 4 : 1);
}

std::vector<Eigen::Vector3d> target_points(const CalibrationTarget& target) {
  std::vector<Eigen::Vector3d> points;
  for (int row = 0; row < target.rows; ++row) {
    for (int column = 0; column < target.columns; ++column) {
      const double s = target.square_m, pitch = s + target.detail();
      switch (target.kind) {
        case TargetKind::chessboard:
        case TargetKind::charuco:
          points.emplace_back(column * s, row * s, 0);
          break;
        case TargetKind::circles:
        case TargetKind::asymmetric_circles: {
          const Eigen::Vector2d centre = circle_centre(target, column, row);
          points.emplace_back(centre.x(), centre.y(), 0);
          break;
        }
        case TargetKind::squares:
          for (const Eigen::Vector2d& corner :
               {Eigen::Vector2d(0, 0), Eigen::Vector2d(s, 0), Eigen::Vector2d(s, s), Eigen::Vector2d(0, s)})
            points.emplace_back(column * pitch + corner.x(), row * pitch + corner.y(), 0);
          break;
      }
    }
  }
  return points;
}

TargetExtent target_extent(const CalibrationTarget& target) {
  const double s = target.square_m;
  switch (target.kind) {
    case TargetKind::chessboard:
    case TargetKind::charuco:
      return {-s, -s, target.columns * s, target.rows * s};
    case TargetKind::circles: {
      const double r = 0.5 * target.detail();
      return {-r, -r, (target.columns - 1) * s + r, (target.rows - 1) * s + r};
    }
    case TargetKind::asymmetric_circles: {
      const double r = 0.5 * target.detail();
      return {-r, -r, (2 * target.columns - 1) * s + r, (target.rows - 1) * s + r};
    }
    case TargetKind::squares: {
      const double pitch = s + target.detail();
      return {0, 0, (target.columns - 1) * pitch + s, (target.rows - 1) * pitch + s};
    }
  }
  return {};
}

bool target_is_black(const CalibrationTarget& target, double x, double y) {
  const TargetExtent extent = target_extent(target);
  if (x < extent.left || y < extent.top || x >= extent.right || y >= extent.bottom) return false;
  const double s = target.square_m;
  switch (target.kind) {
    case TargetKind::chessboard:
      return (cell_of(x, s) + cell_of(y, s)) % 2 == 0;
    case TargetKind::charuco:
      return charuco_black(target, x, y);
    case TargetKind::circles:
    case TargetKind::asymmetric_circles: {
      const int row = static_cast<int>(std::lround(y / s));
      const double column = target.kind == TargetKind::circles ? x / s : 0.5 * (x / s - std::abs(row % 2));
      const Eigen::Vector2d centre = circle_centre(target, static_cast<int>(std::lround(column)), row);
      return std::hypot(x - centre.x(), y - centre.y()) <= 0.5 * target.detail();
    }
    case TargetKind::squares: {
      const double pitch = s + target.detail();
      return std::fmod(x, pitch) < s && std::fmod(y, pitch) < s;
    }
  }
  return false;
}

std::vector<std::vector<int>> target_symmetries(const CalibrationTarget& target) {
  const int n = target_point_count(target), columns = target.columns, rows = target.rows;
  std::vector<std::vector<int>> all(1);
  for (int i = 0; i < n; ++i) all[0].push_back(i);
  if (target.kind == TargetKind::charuco) return all;
  if (target.kind == TargetKind::asymmetric_circles) {
    if (rows % 2 == 1) return all;  // half a turn would shift the other rows
    std::vector<int> half(all[0].rbegin(), all[0].rend());
    all.push_back(half);
    return all;
  }
  const int per = target.kind == TargetKind::squares ? 4 : 1;
  // Where a turn changes the colours of a chessboard, the detector knows which way up it is.
  const bool chess = target.kind == TargetKind::chessboard;
  for (int quarter = 1; quarter < 4; ++quarter) {
    if (quarter != 2 && columns != rows) continue;
    if (chess && quarter == 2 && (columns + rows) % 2 == 1) continue;
    if (chess && quarter != 2 && columns % 2 == 1) continue;
    std::vector<int> ids;
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns; ++column) {
        int c = column, r = row;
        if (quarter == 1) {
          c = columns - 1 - row;
          r = column;
        } else if (quarter == 2) {
          c = columns - 1 - column;
          r = rows - 1 - row;
        } else {
          c = row;
          r = rows - 1 - column;
        }
        for (int k = 0; k < per; ++k) ids.push_back(per * (r * columns + c) + (per == 4 ? (k + quarter) % 4 : 0));
      }
    }
    all.push_back(ids);
  }
  return all;
}

int charuco_marker_count(const CalibrationTarget& target) { return (target.columns + 1) * (target.rows + 1) / 2; }

std::array<Eigen::Vector2d, 4> charuco_marker(const CalibrationTarget& target, int marker, Eigen::Vector2i* square) {
  int count = 0;
  for (int row = 0; row <= target.rows; ++row) {
    for (int column = 0; column <= target.columns; ++column) {
      if ((row + column) % 2 == 0 || count++ != marker) continue;
      const double margin = 0.5 * (target.square_m - target.detail());
      const double x = (column - 1) * target.square_m + margin, y = (row - 1) * target.square_m + margin;
      const double d = target.detail();
      *square = {column, row};
      return {Eigen::Vector2d(x, y), Eigen::Vector2d(x + d, y), Eigen::Vector2d(x + d, y + d),
              Eigen::Vector2d(x, y + d)};
    }
  }
  throw InputError("charuco marker " + std::to_string(marker) + ": not on the board");
}

std::array<std::array<bool, 7>, 7> charuco_marker_cells(int marker) {
  using Cells = std::array<std::array<bool, 7>, 7>;
  static const std::vector<Cells> all = [] {
    std::vector<Cells> cells(largest_marker_count);
    const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_5X5_250);
    for (int i = 0; i < largest_marker_count; ++i) {
      cv::Mat image;
      dictionary->drawMarker(i, 7, image, 1);
      for (int row = 0; row < 7; ++row)
        for (int column = 0; column < 7; ++column)
          cells[static_cast<std::size_t>(i)][static_cast<std::size_t>(row)][static_cast<std::size_t>(column)] =
              image.at<unsigned char>(row, column) < 128;
    }
    return cells;
  }();
  return all[static_cast<std::size_t>(marker)];
}

}  // namespace parallax
