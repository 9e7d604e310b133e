// A level of Marbles, made of whatever is on the table: start, goal, coins, ramps and loose marbles, all where a marble
// can get.
//
// Units and frame as in games/marbles_ground.h. Plain functions and values; the same ground, seed and wishes give the
// same level.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "games/marbles_ground.h"
#include "games/marbles_walk.h"

namespace parallax {

struct MarblesCoin {
  Eigen::Vector2f place = Eigen::Vector2f::Zero();
  float height = 0;  // of what it lies on
  bool taken = false;
};

struct MarblesLevel {
  Eigen::Vector2f start = Eigen::Vector2f::Zero(), goal = Eigen::Vector2f::Zero();
  float start_height = 0, goal_height = 0;
  float goal_radius = 1.3f;
  std::vector<MarblesCoin> coins;  // in the order of a tour
  std::vector<TableRamp> ramps;
  std::vector<Eigen::Vector2f> loose;  // where loose marbles begin, on the table itself
};

struct MarblesLevelWishes {
  std::uint64_t seed = 1;
  int coins = 5, ramps = 2, loose = 2;
  float goal_radius = 1.3f;
};

// The slope of the ramps, radians: tables can be tilted half as much again.
inline constexpr float kRampSlope = 0.17f;
// Real things up to this height get a ramp.
inline constexpr float kHighestRamp = 1.4f;

// False when there is too little room for a level.
bool make_marbles_level(const TableGround& ground, const MarblesLevelWishes& wishes, MarblesLevel* level);

// Brings a level in line with a ground that has changed: ramps that lead nowhere are taken away, what cannot be got any
// more is moved to the nearest place where it can. A level that fits stays as it is. False when there is no room.
bool mend_marbles_level(const TableGround& ground, MarblesLevel* level);

}  // namespace parallax
