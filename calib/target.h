// Calibration targets: what is printed and shown to the camera.
//
// Target frame: seen from the front, x to the right along a row, y down along a column, z away from the viewer; the
// origin is point 0, the plane is z = 0. Metres. Point `id` is at column id % columns, row id / columns (squares: four
// points a square, see target_points). Plain values and pure functions, safe from any thread.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

namespace parallax {

enum class TargetKind {
  chessboard,          // inner corners
  charuco,             // inner corners, with ArUco markers (5x5 bits, first 250) in the white squares
  circles,             // centres of black discs on a square grid
  asymmetric_circles,  // every second row shifted by half a step (OpenCV's asymmetric grid)
  squares,             // corners of separate black squares (Zhang's target)
};

// "chessboard", "charuco", "circles", "acircles", "squares".
const char* to_string(TargetKind kind);
// Throws InputError for any other name.
TargetKind target_kind(const std::string& name);

struct CalibrationTarget {
  TargetKind kind = TargetKind::chessboard;
  int columns = 9, rows = 6;  // inner corners, circles a row and rows, or squares
  // Metres: side of a square; distance of neighbouring circles (asymmetric: of neighbouring rows); squares: side.
  double square_m = 0.025;
  // Metres: side of a marker, diameter of a circle, gap between squares. 0: the usual share of square_m.
  double detail_m = 0;

  // detail_m, or its default: marker 0.75, circle 0.5 (asymmetric 0.9, whose neighbours are 1.41 away), gap 0.77778.
  double detail() const;
  // Throws InputError that names the option.
  void validate() const;
  bool operator==(const CalibrationTarget&) const = default;
};

int target_point_count(const CalibrationTarget& target);
// By id. Squares: id = 4 (row * columns + column) + corner, clockwise from the top left.
std::vector<Eigen::Vector3d> target_points(const CalibrationTarget& target);

// What is printed, without the white margin: from (left, top) to (right, bottom).
struct TargetExtent {
  double left = 0, top = 0, right = 0, bottom = 0;
  double width() const { return right - left; }
  double height() const { return bottom - top; }
};
TargetExtent target_extent(const CalibrationTarget& target);

// Whether ink covers the point of the plane (metres): what renderers of a target ask.
bool target_is_black(const CalibrationTarget& target, double x, double y);

// Rotations of the plane that look the same to a detector, as permutations of the ids: the identity first. Chessboards
// with an even and an odd side, and ChArUco, have only that one.
std::vector<std::vector<int>> target_symmetries(const CalibrationTarget& target);

// ChArUco: square (column, row) of the (columns + 1) x (rows + 1) squares is black when column + row is even, and
// markers count up through the white ones, row by row.
int charuco_marker_count(const CalibrationTarget& target);
// Corners of a marker in the target frame, clockwise from the marker's own top left; `square`: its column and row.
std::array<Eigen::Vector2d, 4> charuco_marker(const CalibrationTarget& target, int marker, Eigen::Vector2i* square);
// The marker's cells, true: black: 7 rows of 7 with the border.
std::array<std::array<bool, 7>, 7> charuco_marker_cells(int marker);

}  // namespace parallax
