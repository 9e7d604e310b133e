// What flies in Swarm, and what it does to whom it meets.
#include <algorithm>
#include <cmath>

#include "games/swarm_rules.h"
#include "games/swarm_simulation.h"

namespace parallax::swarm {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kHitReach = kCritterRadius + 0.02;
constexpr double kOutOfSight = 4;  // nothing flies further from the middle

}  // namespace

void Simulation::shoot(const GameInput& input) {
  Robot& robot = state_.robot;
  robot.reload_ticks = counted_down(robot.reload_ticks);
  if (input.fire && robot.reload_ticks == 0 && state_.bolts.size() < static_cast<std::size_t>(kMostBolts)) {
    state_.bolts.push_back({robot.position, robot.aim, kBoltLife});
    robot.reload_ticks = robot.rapid_ticks > 0 ? kRapidReload : kReload;
    ++state_.shots;
    hear("fire", robot.position, 0.6f, robot.rapid_ticks > 0 ? 1.2f : 1.0f);
  }
  if (input.act && !robot.act_was_down && robot.bombs > 0) explode();
  robot.act_was_down = input.act;
}

void Simulation::explode() {
  Robot& robot = state_.robot;
  --robot.bombs;
  blast_ticks_ = ticks(0.5);
  blast_position_ = robot.position;
  hear("game_over", robot.position, 0.7f, 1.8f);
  scatter({robot.position.x(), robot.position.y(), 0.05}, 40, 0, 1.1);
  for (Critter& critter : state_.critters) {
    const Vector2d away = critter.position - robot.position;
    if (away.norm() > kBombRadius) continue;
    hit(&critter, kBombDamage);
    if (critter.phase == CritterPhase::walking && away.norm() > 1e-6) critter.velocity = 1.2 * away.normalized();
  }
}

void Simulation::hit(Critter* critter, int damage) {
  if (critter->health <= 0) return;
  critter->health -= damage;
  critter->hurt_ticks = ticks(0.12);
  const Vector3d at(critter->position.x(), critter->position.y(), critter->height + 0.04);
  if (critter->health > 0) {
    hear("hit", critter->position, 0.6f);
    scatter(at, 5, 0, 0.35);
    return;
  }
  ++state_.kills;
  ++state_.chain;
  state_.best_chain = std::max(state_.best_chain, state_.chain);
  state_.chain_ticks = kChainTicks;
  state_.score += static_cast<std::int64_t>(rules_of(critter->kind).points) * multiplier(state_.chain);
  hear("critter_dies", critter->position, 0.8f, 1.0f + 0.05f * static_cast<float>(multiplier(state_.chain)));
  scatter(at, 14, 0, 0.5);
}

void Simulation::fly_bolts() {
  for (Bolt& bolt : state_.bolts) {
    --bolt.ticks_left;
    bolt.position += bolt.direction * (kBoltSpeed * kGameTick_s);
    if (bolt.position.norm() > kOutOfSight || ground_.height_at(bolt.position) > kBoltHeight) {
      scatter({bolt.position.x(), bolt.position.y(), kBoltHeight}, 4, 3, 0.3);
      bolt.ticks_left = 0;
      continue;
    }
    double best = kHitReach;
    Critter* target = nullptr;
    neighbours_.near(bolt.position, kHitReach, [&](std::size_t i) {
      Critter& critter = state_.critters[i];
      if (critter.health <= 0 || std::abs(critter.height + 0.03 - kBoltHeight) > 0.05) return;
      const double distance = (critter.position - bolt.position).norm();
      if (distance >= best) return;
      best = distance;
      target = &critter;
    });
    if (target == nullptr) continue;
    ++state_.hits;
    hit(target, kBoltDamage);
    bolt.ticks_left = 0;
  }
  std::erase_if(state_.bolts, [](const Bolt& bolt) { return bolt.ticks_left <= 0; });
}

void Simulation::fly_spits() {
  const int damage = rules_of(CritterKind::spitter).damage;
  std::erase_if(state_.spits, [&](Spit& spit) {
    spit.position += spit.velocity * kGameTick_s;
    spit.height += spit.rise * kGameTick_s;
    spit.rise -= kSpitGravity * kGameTick_s;
    const double ground = ground_.height_at(spit.position);
    const bool touches = (spit.position - state_.robot.position).norm() < kRobotRadius && spit.height < 0.1;
    const bool lands = spit.height <= 0 || spit.height > 2 || spit.position.norm() > kOutOfSight ||
                       (ground > 0.02 && ground > spit.height);
    if (!touches && !lands) return false;
    scatter({spit.position.x(), spit.position.y(), std::max(spit.height, 0.0)}, 8, 1, 0.3);
    if (touches || (spit.position - state_.robot.position).norm() < kSpitSplash) hurt_robot(damage, spit.position);
    return true;
  });
}

void Simulation::hurt_robot(int damage, const Vector2d& from) {
  Robot& robot = state_.robot;
  if (state_.over || robot.hurt_ticks > 0) return;
  const Vector3d at(robot.position.x(), robot.position.y(), 0.06);
  robot.hurt_ticks = kGrace;
  if (robot.shield_ticks > 0) {
    hear("knock", from, 0.5f);
    scatter(at, 6, 1, 0.4);
    return;
  }
  const double factor = rules_of(state_.difficulty).damage * (1 + 0.5 * frenzy(state_.wave));
  robot.health = std::max(robot.health - static_cast<int>(std::lround(damage * factor)), 0);
  state_.chain = state_.chain_ticks = 0;
  scatter(at, 10, 2, 0.5);
  hear("player_hurt", robot.position);
  if (robot.health > 0) return;
  state_.over = true;
  hear("game_over", robot.position);
  scatter(at, 60, 2, 0.9);
}

}  // namespace parallax::swarm
