// Where a marble can be rolled to: a flood over the cells where it has room around it and no cliff under it, on the
// table, up the ramps and over what they lead to.
//
// Units and frame as in games/marbles_ground.h. Plain functions and values.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "games/marbles_ground.h"

namespace parallax {

struct WalkMap {
  TableGrid grid;
  std::vector<float> height;           // of what a marble would roll on, ramps included
  std::vector<Eigen::Vector2f> slope;  // of that, rise a length: on ramps, else 0
  std::vector<std::uint8_t> drivable;  // a marble of this game can be here without touching or falling
  std::vector<float> clearance;        // distance to where it cannot; 0 there
  std::vector<int> area;               // number of the connected area, -1 where it cannot be
  std::vector<int> area_size;          // cells of each

  std::optional<std::size_t> cell_at(const Eigen::Vector2f& place) const;
  // The nearest drivable cell within a distance, of one area or of any (-1).
  std::optional<std::size_t> nearest_drivable(const Eigen::Vector2f& place, float within, int of_area) const;
  // The area with most cells; -1 when there is none.
  int greatest_area() const;
};

// The height of a ramp's surface above a place, nothing beside it.
std::optional<float> ramp_height(const TableRamp& ramp, const Eigen::Vector2f& place);

WalkMap make_walk_map(const TableGround& ground, const std::vector<TableRamp>& ramps);

// For every cell the length of the shortest way to a target cell, ways close to cliffs and walls counting more;
// infinite where there is none (Dijkstra 1959).
std::vector<float> ways_to(const WalkMap& walk, std::size_t target);

// Whether a marble can be rolled straight from one place to the other.
bool straight_is_free(const WalkMap& walk, const Eigen::Vector2f& from, const Eigen::Vector2f& to);

// Where to aim for from a place: along the way given by ways_to() as far as it can be gone straight, at most `reach`.
std::optional<Eigen::Vector2f> aim_along(const WalkMap& walk, const std::vector<float>& ways,
                                         const Eigen::Vector2f& from, float reach);

}  // namespace parallax
