#include "games/swarm_player.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "games/swarm_rules.h"
#include "games/swarm_simulation.h"

namespace parallax::swarm {
namespace {

using Eigen::Vector2d;

constexpr int kDirections = 16;
constexpr double kAhead_s = 0.3;    // it thinks so far ahead
constexpr double kDanger = 0.42;    // nearer than this a critter is one
constexpr double kInTheWay = 0.05;  // of a bolt: half the width that it sweeps, about
constexpr double kFarShot = 1.8;

// How far a critter is from the line of fire, and how far along; false when it is behind or too far.
bool off_line(const Vector2d& robot, const Vector2d& reticle, const Critter& critter, double* off, double* along) {
  const Vector2d aim = reticle - robot;
  if (aim.norm() < 0.02) return false;
  const Vector2d direction = aim.normalized();
  double away_s = (critter.position - robot).norm() / kBoltSpeed;
  const Vector2d at = critter.position + critter.velocity * away_s - robot;
  *along = direction.dot(at);
  *off = std::abs(direction.x() * at.y() - direction.y() * at.x());
  return *along > 0 && *along < kFarShot && critter.height > -0.02 && critter.height < 0.06;
}

// Less is better.
double cost_of(const State& state, const Ground& ground, const Vector2d& place, const Vector2d& reticle) {
  double cost = 0, best_line = 1;
  for (const Critter& critter : state.critters) {
    const Vector2d at = critter.position + critter.velocity * kAhead_s;
    const double distance = std::max((at - place).norm(), 0.02);
    const double danger = critter.kind == CritterKind::spitter ? 0.6 * kDanger : kDanger;
    if (distance < danger) cost += 0.6 * (danger / distance - 1);
    double off = 0, along = 0;
    if (off_line(place, reticle, critter, &off, &along))
      best_line = std::min(best_line, std::max(off - kInTheWay, 0.0) + 0.1 * along);
  }
  for (const Spit& spit : state.spits) {
    // Where it will come down.
    const double fall_s =
        (spit.rise + std::sqrt(spit.rise * spit.rise + 2 * kSpitGravity * std::max(spit.height, 0.0))) / kSpitGravity;
    const double distance = (spit.position + spit.velocity * fall_s - place).norm();
    if (distance < 0.18) cost += 6 * (0.18 - distance);
  }
  cost += 1.5 * best_line;
  cost += 0.35 * (place - ground.middle()).squaredNorm();
  // Room on every side.
  for (int k = 0; k < 8; ++k) {
    const double angle = k * std::numbers::pi / 4;
    const Vector2d side = place + 0.18 * Vector2d(std::cos(angle), std::sin(angle));
    if (!ground.walkable(side)) cost += 0.12;
  }
  for (const Pickup& pickup : state.pickups) {
    const bool wanted = pickup.kind != PickupKind::heal || state.robot.health < kFullHealth - 10;
    if (wanted) cost -= 0.5 * std::exp(-3 * (pickup.position - place).norm());
  }
  return cost;
}

}  // namespace

GameInput play_patiently(const State& state, const Ground& ground,
                         const std::optional<RigidTransform>& camera_from_plane) {
  GameInput input;
  input.camera_from_plane = camera_from_plane;
  const Robot& robot = state.robot;
  Vector2d right = robot.right, sight = robot.sight;
  if (camera_from_plane) {
    view_right(*camera_from_plane, &right);
    view_sight(*camera_from_plane, ground.radius_m(), &sight);
  }
  const Vector2d reticle = state.seated ? robot.reticle : sight;

  double best = cost_of(state, ground, robot.position, reticle);
  Vector2d direction = Vector2d::Zero();
  const double reach = kRobotSpeed * kAhead_s;
  for (int k = 0; k < kDirections; ++k) {
    const double angle = k * 2 * std::numbers::pi / kDirections;
    const Vector2d way(std::cos(angle), std::sin(angle));
    const Vector2d place = robot.position + reach * way;
    if (!ground.clear_between(robot.position, place)) continue;
    const double cost = cost_of(state, ground, place, reticle);
    if (cost >= best - 0.01) continue;
    best = cost + 0.01;
    direction = way;
  }
  input.move = {direction.dot(right), direction.dot(Vector2d(-right.y(), right.x()))};

  int close = 0;
  double nearest = std::numeric_limits<double>::infinity(), nearest_turn = 0;
  for (const Critter& critter : state.critters) {
    double off = 0, along = 0;
    // What the assisted reticle has found is in the way of a bolt by itself.
    for (const Vector2d& target : {reticle, robot.reticle})
      if (off_line(robot.position, target, critter, &off, &along) && off < kInTheWay) input.fire = true;
    const Vector2d to_critter = critter.position - robot.position;
    if (to_critter.norm() < 0.75 * kBombRadius) ++close;
    if (to_critter.norm() >= nearest || critter.height < -0.02) continue;
    nearest = to_critter.norm();
    nearest_turn =
        std::atan2(robot.aim.x() * to_critter.y() - robot.aim.y() * to_critter.x(), robot.aim.dot(to_critter));
  }
  if (state.seated && std::isfinite(nearest)) input.dial = std::clamp(3 * nearest_turn, -1.0, 1.0);
  const bool needed = close >= 5 || (close >= 2 && robot.health < 35);
  input.act = needed && robot.bombs > 0 && !robot.act_was_down;
  return input;
}

}  // namespace parallax::swarm
