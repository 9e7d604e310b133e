// Where one can walk: the mapped part of the plane without the real things that stand on it, as a grid of cells, with
// the way from everywhere to one goal.
//
// Units of the field's radius (games/swarm_state.h). A cell is walkable when its centre lies within the outline and no
// obstacle is in it or in one of its eight neighbours, and when it is connected with the largest such part of the
// table: so from every walkable place there is a way to every other. Who moves by slide() stays on walkable cells.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "games/playing_field.h"

namespace parallax::swarm {

class Ground {
 public:
  static constexpr int kSide = 64;  // cells
  static constexpr double kCell = 0.05;
  static constexpr double kHalf = kSide * kCell / 2;
  static constexpr double kObstacleHeight = 0.05;  // lower things are walked over

  // A place at the edge where a critter can come in.
  struct Entry {
    Eigen::Vector2d position = Eigen::Vector2d::Zero();
    Eigen::Vector2d outward = Eigen::Vector2d::UnitX();
    double angle = 0;  // of the position, seen from the middle
  };

  void rebuild(const PlayingField& field);

  bool walkable(const Eigen::Vector2d& position) const;
  // The place itself when it is walkable.
  Eigen::Vector2d nearest_walkable(const Eigen::Vector2d& position) const;
  // From a walkable place as far towards `to` as walls allow, along them where it meets one. Steps shorter than a cell.
  Eigen::Vector2d slide(const Eigen::Vector2d& from, const Eigen::Vector2d& to) const;
  // Whether the straight way is walkable.
  bool clear_between(const Eigen::Vector2d& from, const Eigen::Vector2d& to) const;
  // Of what stands there.
  double height_at(const Eigen::Vector2d& position) const;

  // The goal of way_from(); cheap while it stays in a cell.
  void set_goal(const Eigen::Vector2d& goal);
  // Unit vector: straight to the goal when that way is clear, else along the shortest way round. Zero at the goal.
  Eigen::Vector2d way_from(const Eigen::Vector2d& from) const;

  // The entry whose direction from the middle is nearest.
  const Entry& entry_towards(double angle) const;
  const std::vector<Entry>& entries() const { return entries_; }
  Eigen::Vector2d middle() const { return middle_; }
  double radius_m() const { return radius_m_; }
  // Of the walkable cells and the heights.
  std::uint64_t hash() const { return hash_; }

 private:
  static constexpr std::size_t kCells = static_cast<std::size_t>(kSide) * kSide;
  using Mask = std::array<std::uint8_t, kCells>;
  struct Cell {
    int column = -1, row = -1;
  };
  static Cell cell_of(const Eigen::Vector2d& position);
  static bool contains(int column, int row) { return column >= 0 && row >= 0 && column < kSide && row < kSide; }
  static std::size_t index(int column, int row) {
    return static_cast<std::size_t>(row) * kSide + static_cast<std::size_t>(column);
  }
  static Eigen::Vector2d centre(int column, int row) {
    return {(column + 0.5) * kCell - kHalf, (row + 0.5) * kCell - kHalf};
  }
  bool free_at(int column, int row) const { return contains(column, row) && free_[index(column, row)] != 0; }
  void mark_inside(const PlayingField& field, Mask* inside) const;
  void mark_obstacles(Mask* obstacle) const;
  bool keep_largest_part();
  void find_entries(const Mask& inside, const Mask& obstacle);
  void measure_distances();

  std::shared_ptr<const SceneSurface> surface_;
  double radius_m_ = 1;
  Mask free_{};
  std::vector<Entry> entries_;  // by angle
  Eigen::Vector2d middle_ = Eigen::Vector2d::Zero();
  Cell goal_cell_;
  Eigen::Vector2d goal_ = Eigen::Vector2d::Zero();
  std::array<std::uint16_t, kCells> distance_{};  // to the goal's cell; 5 straight, 7 diagonal
  std::array<std::vector<std::uint16_t>, 8> waiting_;
  std::uint64_t hash_ = 0;
};

}  // namespace parallax::swarm
