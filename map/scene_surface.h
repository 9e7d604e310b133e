// What stands on the dominant plane, as heights over it: what real things hide, and what marbles bounce off.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/se3.h"

namespace parallax {

// A grid of heights in the plane's frame (z up, metres). Cell (column, row) covers corner_m + cell_m * [column,
// column + 1) x [row, row + 1). A value: made by the mapper's side, shared as immutable with whoever draws or plays.
struct SceneSurface {
  RigidTransform world_from_plane;
  int columns = 0, rows = 0;
  double cell_m = 0;
  Eigen::Vector2d corner_m = Eigen::Vector2d::Zero();
  std::vector<float> height_m;  // rows * columns, row by row; 0 is the plane itself, never below
  // As many, or none: what is filled of the space over a cell, where not all of it up to the height is (a screen on its
  // foot). Bit k is a box from k to k + 1 times cell_m over the plane; the highest one ends at the height,
  // which is within half a box of its top.
  std::vector<std::uint64_t> filled;
  std::vector<std::uint8_t> known;  // as many: 1 where the plane or something on it was seen
  std::uint64_t version = 0;        // greater for every new one of a map
  int map_version = 0;              // of the map it was made from

  bool empty() const { return height_m.empty(); }
  std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(column);
  }
  bool contains(int column, int row) const { return column >= 0 && row >= 0 && column < columns && row < rows; }
  Eigen::Vector2d centre_of(int column, int row) const {
    return corner_m + cell_m * Eigen::Vector2d(column + 0.5, row + 0.5);
  }
  // 0 outside the grid.
  float height_at(const Eigen::Vector2d& position) const {
    if (empty()) return 0;
    const Eigen::Vector2d cell = (position - corner_m) / cell_m;
    if (!(cell.x() >= 0 && cell.y() >= 0 && cell.x() < columns && cell.y() < rows)) return 0;
    return height_m[index(static_cast<int>(cell.x()), static_cast<int>(cell.y()))];
  }
};

}  // namespace parallax
