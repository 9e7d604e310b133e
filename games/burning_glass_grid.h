// The square sheet on the table that light falls on and that is burnt: cells of a fixed number, laid over the field.
// Plane frame; cell (column, row) covers corner + cell * [column, column + 1) x [row, row + 1). Values.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>

namespace parallax::burning {

inline constexpr int kSheetCells = 256;  // along each side: the sun's picture is about two of them across
inline constexpr std::size_t kSheetSize = static_cast<std::size_t>(kSheetCells) * kSheetCells;

struct SheetGrid {
  double half_extent_m = 0.2;

  double cell_m() const { return 2 * half_extent_m / kSheetCells; }
  // Whole numbers lie in the centres of the cells.
  Eigen::Vector2d cell_at(const Eigen::Vector2d& position_m) const {
    return (position_m.array() + half_extent_m).matrix() / cell_m() - Eigen::Vector2d::Constant(0.5);
  }
  Eigen::Vector2d centre_of(int column, int row) const {
    return Eigen::Vector2d(column + 0.5, row + 0.5) * cell_m() - Eigen::Vector2d::Constant(half_extent_m);
  }
  static std::size_t index(int column, int row) {
    return static_cast<std::size_t>(row) * kSheetCells + static_cast<std::size_t>(column);
  }
};

// Columns [left, right) and rows [bottom, top); empty when there are none.
struct SheetBox {
  int left = kSheetCells, bottom = kSheetCells, right = 0, top = 0;

  bool empty() const { return left >= right || bottom >= top; }
  void include(int column, int row) {
    left = std::min(left, column);
    right = std::max(right, column + 1);
    bottom = std::min(bottom, row);
    top = std::max(top, row + 1);
  }
  void include(const SheetBox& other) {
    if (other.empty()) return;
    left = std::min(left, other.left);
    right = std::max(right, other.right);
    bottom = std::min(bottom, other.bottom);
    top = std::max(top, other.top);
  }
  SheetBox grown(int cells) const {
    if (empty()) return *this;
    return {std::max(0, left - cells), std::max(0, bottom - cells), std::min(kSheetCells, right + cells),
            std::min(kSheetCells, top + cells)};
  }
  static SheetBox all() { return {0, 0, kSheetCells, kSheetCells}; }
};

}  // namespace parallax::burning
