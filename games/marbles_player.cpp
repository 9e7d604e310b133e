// The patient player of Marbles: rolls the marble along the ways of the walk map to one coin after another and then to
// the goal, with the keys only. What it does is a function of the game's state.
#include <algorithm>
#include <cmath>

#include "games/marbles_game.h"

namespace parallax {
namespace {

constexpr float kReach = 3;           // how far ahead it aims
constexpr float kFastest = 5.5f;      // where there is room
constexpr float kSlowest = 2.2f;      // along cliffs and the rim
constexpr float kRoomForFast = 2;     // clearance from which it is fast
constexpr float kBraking = 4;         // what it counts on when it comes close, diameters a second squared
constexpr float kArrival = 0.8f;      // speed at the target
constexpr float kGain = 7;            // of speed errors, 1/s
constexpr float kRescueReach = 6;     // how far a marble that is off the ways looks for one
constexpr float kRolling = 5.0f / 7;  // a rolling ball's share of the slope's acceleration

// The slope of what a marble rolls on, by central differences half a marble wide.
Eigen::Vector2f slope_at(const WalkMap& walk, const Eigen::Vector2f& place, float own_height) {
  const auto height = [&](float dx, float dy) {
    const auto cell = walk.cell_at(place + Eigen::Vector2f(dx, dy));
    const float found = cell ? walk.height[*cell] : own_height;
    return std::abs(found - own_height) < 0.12f ? found : own_height;  // not of a wall or a ramp's side
  };
  const float reach = 0.4f;
  return Eigen::Vector2f(height(reach, 0) - height(-reach, 0), height(0, reach) - height(0, -reach)) / (2 * reach);
}

}  // namespace

GameInput MarblesGame::scripted_input(const std::optional<RigidTransform>& camera_from_plane) const {
  GameInput input;
  input.camera_from_plane = camera_from_plane;
  if (state_.phase != MarblesPhase::playing || state_.respawn_ticks > 0) return input;
  const MarblesLevel& level = state_.level;
  const auto coin = std::find_if(level.coins.begin(), level.coins.end(), [](const MarblesCoin& c) { return !c.taken; });
  const auto target = walk_.cell_at(coin != level.coins.end() ? coin->place : level.goal);
  if (!target) return input;
  if (ways_.length.empty() || ways_.target != *target) ways_ = {*target, ways_to(walk_, *target)};

  const MarbleMotion& marble = state_.marbles.front();
  const Eigen::Vector2f at = marble.position.head<2>(), velocity = marble.velocity.head<2>();
  const auto here = walk_.cell_at(at);
  Eigen::Vector2f aim = at;
  float remaining = 0, speed = kSlowest;
  if (const auto ahead = aim_along(walk_, ways_.length, at, kReach)) {
    aim = *ahead;
    remaining = ways_.length[*here];
    if (remaining <= 0) aim = walk_.grid.centre(*target);
    // What matters is the room here and where it is going.
    const auto there = walk_.cell_at(aim);
    const float room = std::min(walk_.clearance[*here], there ? walk_.clearance[*there] : 0.0f);
    speed = kSlowest + (kFastest - kSlowest) * std::min(1.0f, room / kRoomForFast);
    speed = std::min(speed, kArrival + std::sqrt(2 * kBraking * remaining));
  } else {
    const auto near = walk_.nearest_drivable(at, kRescueReach, walk_.area[*target]);
    if (near) aim = walk_.grid.centre(*near);
  }
  Eigen::Vector2f direction = aim - at;
  if (direction.norm() > 1e-3f) direction.normalize();
  Eigen::Vector2f acceleration = kGain * (speed * direction - velocity);
  if (here && marble.position.z() < walk_.height[*here] + 2 * kMarbleRadius)
    acceleration += kRolling * kMarblesGravity * slope_at(walk_, at, walk_.height[*here]);
  const Eigen::Vector2f tilt = acceleration / (kRolling * kMarblesGravity);

  // As the viewer sees it.
  Eigen::Vector2f right = state_.heading;
  if (camera_from_plane) {
    const Eigen::Vector2d seen = camera_from_plane->R.row(0).head<2>();
    if (seen.norm() > 0.2) right = seen.normalized().cast<float>();
  }
  const Eigen::Vector2f away(-right.y(), right.x());
  Eigen::Vector2f keys = Eigen::Vector2f(tilt.dot(right), tilt.dot(away)) / kMarblesGreatestTilt;
  if (keys.norm() > 1) keys.normalize();
  input.move = keys.cast<double>();
  return input;
}

}  // namespace parallax
