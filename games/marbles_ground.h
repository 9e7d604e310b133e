// What stands on the table, as marbles meet it: the height grid of the map, cleaned of noise and merged into blocks.
//
// Units: the marble's diameter is 1 (see games/marbles_physics.h); `unit_m` metres of the map. Plane frame. Plain
// functions and values.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "games/marbles_physics.h"
#include "games/playing_field.h"

namespace parallax {

// Radius of the playing field in marbles' diameters: a marble's radius is 0.035 of it.
inline constexpr double kMarblesFieldRadius = 0.5 / 0.035;
// What is lower than this is taken for noise of the map (0.021 of the field's radius).
inline constexpr float kLeastObstacleHeight = 0.3f;

struct TableGrid {
  int columns = 0, rows = 0;
  float cell = 0.25f;
  Eigen::Vector2f corner = Eigen::Vector2f::Zero();

  std::size_t size() const { return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows); }
  bool contains(int column, int row) const { return column >= 0 && row >= 0 && column < columns && row < rows; }
  std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(column);
  }
  int column_of(std::size_t i) const { return static_cast<int>(i % static_cast<std::size_t>(columns)); }
  int row_of(std::size_t i) const { return static_cast<int>(i / static_cast<std::size_t>(columns)); }
  Eigen::Vector2f centre(std::size_t i) const {
    return corner +
           cell * Eigen::Vector2f(static_cast<float>(column_of(i)) + 0.5f, static_cast<float>(row_of(i)) + 0.5f);
  }
  // The cell of a place, which may lie outside.
  Eigen::Vector2i cell_of(const Eigen::Vector2f& place) const;
};

struct TableGround {
  TableGrid grid;
  std::vector<Eigen::Vector2f> outline;  // convex, counter-clockwise, at least three corners
  std::vector<float> height;             // a cell: 0 is the table
  std::vector<std::uint8_t> known;       // a cell: something was seen there
};

// The outline in units; a circle of the field's radius when the field has none that can be played on. At most 64
// corners.
std::vector<Eigen::Vector2f> table_outline(const PlayingField& field, double unit_m);
// Distance of a place from the rim; negative outside.
float distance_inside(const std::vector<Eigen::Vector2f>& outline, const Eigen::Vector2f& place);

// Resamples the field's surface: what is low is dropped, speckles are removed, small holes closed, tops that are nearly
// level made level. `with_obstacles` false: an empty table of the same outline.
TableGround read_ground(const PlayingField& field, double unit_m, bool with_obstacles = true);

// Blocks that together cover exactly the cells that are not 0, each as high as its cells.
std::vector<TableBox> merge_boxes(const TableGround& ground);

// The upper edges of what stands there: straight pieces between a cell and a lower one.
struct TableEdge {
  Eigen::Vector3f from = Eigen::Vector3f::Zero(), to = Eigen::Vector3f::Zero();
};
std::vector<TableEdge> obstacle_edges(const TableGround& ground);

}  // namespace parallax
