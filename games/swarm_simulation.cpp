#include "games/swarm_simulation.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "games/swarm_rules.h"

namespace parallax::swarm {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr std::size_t kMostSparks = 300, kMostSounds = 32;
constexpr double kSameShare = 1e-9;
constexpr double kSeatedReach = 0.3;  // the reticle is at least so far from the robot when it is steered

Vector2d direction_of(double angle) { return {std::cos(angle), std::sin(angle)}; }

void plan_wave(State* state) {
  Wave& wave = state->wave;
  wave.to_release = wave_of(wave.number, state->difficulty, state->horde);
  wave.pause_ticks = kWavePause;
  wave.ticks = wave.release_ticks = 0;
  for (double& gate : wave.gates) gate = (random_part(&state->random) * 2 - 1) * std::numbers::pi;
}

}  // namespace

void Simulation::start(const PlayingField& field, const GameOptions& options) {
  State fresh;
  fresh.difficulty = options.difficulty;
  fresh.seated = options.seated;
  fresh.colour_blind_safe = options.colour_blind_safe;
  fresh.random = options.seed;
  state_ = fresh;
  for (const auto& [name, value] : options.settings) set(name, value);
  field_ = field;
  lay_ground();
  state_.robot.position = ground_.nearest_walkable(ground_.middle());
  state_.home = state_.robot.position;
  state_.robot.health = kFullHealth;
  state_.robot.bombs = rules_of(options.difficulty).bombs;
  plan_wave(&state_);
  sparks_.clear();
  sounds_.clear();
  deeds_.clear();
  blast_ticks_ = 0;
  ground_.set_goal(state_.robot.position);
}

void Simulation::change_field(const PlayingField& field) {
  const double unit_m = state_.unit_share * field_.radius_m * length_factor(field_, field);
  field_ = field;
  const double share = unit_m / field.radius_m;
  // What a field that is only scaled leaves of rounding is no change.
  state_.unit_share = std::abs(share - 1) < kSameShare ? 1.0 : share;
  if (state_.unit_share < kLeastUnitShare || state_.unit_share > 1)
    change_unit(std::clamp(state_.unit_share, kLeastUnitShare, 1.0));
  lay_ground();
  settle();
}

void Simulation::lay_ground() {
  PlayingField in_units = field_;
  in_units.radius_m *= state_.unit_share;
  ground_.rebuild(in_units);
}

// Another unit of length; nothing moves.
void Simulation::change_unit(double share) {
  const double factor = std::clamp(state_.unit_share / share, 0.05, 20.0);
  state_.unit_share = share;
  Robot& robot = state_.robot;
  for (Vector2d* lengths : {&state_.home, &robot.position, &robot.velocity, &robot.sight, &robot.reticle})
    *lengths *= factor;
  for (Critter& critter : state_.critters) {
    critter.position *= factor;
    critter.velocity *= factor;
  }
  for (Pickup& pickup : state_.pickups) pickup.position *= factor;
  for (Spark& spark : sparks_) spark.position *= factor;
  blast_position_ *= factor;
  // What is in the air is away before anybody sees that it is no more.
  state_.bolts.clear();
  state_.spits.clear();
}

void Simulation::restore(State state, const PlayingField& field) {
  state_ = std::move(state);
  sparks_.clear();
  sounds_.clear();
  blast_ticks_ = 0;
  field_ = field;
  lay_ground();
  settle();
}

void Simulation::settle() {
  Robot& robot = state_.robot;
  robot.position = ground_.nearest_walkable(robot.position);
  for (Critter& critter : state_.critters) {
    if (critter.phase != CritterPhase::climbing) {
      critter.position = ground_.nearest_walkable(critter.position);
      continue;
    }
    // The edge it was climbing over may be elsewhere now.
    const Vector2d goes =
        critter.position + critter.velocity * (kGameTick_s * std::max(kClimb - critter.phase_ticks, 0));
    if (!ground_.walkable(goes)) critter.position += ground_.nearest_walkable(goes) - goes;
  }
  for (Pickup& pickup : state_.pickups) pickup.position = ground_.nearest_walkable(pickup.position);
  ground_.set_goal(robot.position);
}

void Simulation::set(const std::string& setting, double value) {
  if (!std::isfinite(value)) return;
  if (setting == "horde") state_.horde = std::clamp(value, 0.5, 2.0);
  if (setting == "aim_assist") state_.aim_assist = std::clamp(value, 0.0, 1.0);
}

std::vector<Heard> Simulation::take_sounds() { return std::exchange(sounds_, {}); }

void Simulation::hear(const char* name, const Vector2d& position, float volume, float pitch) {
  if (sounds_.size() < kMostSounds) sounds_.push_back({name, volume, pitch, position});
}

void Simulation::scatter(const Vector3d& position, int count, int colour, double speed) {
  for (int i = 0; i < count && sparks_.size() < kMostSparks; ++i) {
    const double angle = random_part(&spark_random_) * 2 * std::numbers::pi, up = random_part(&spark_random_);
    Spark spark;
    spark.position = position;
    spark.velocity << speed * (0.4 + 0.6 * random_part(&spark_random_)) * direction_of(angle), speed * up * 1.2;
    spark.ticks = spark.ticks_left = ticks(0.25 + 0.25 * random_part(&spark_random_));
    spark.size = 0.010 + 0.012 * random_part(&spark_random_);
    spark.colour = colour;
    sparks_.push_back(spark);
  }
}

void Simulation::age_sparks() {
  for (Spark& spark : sparks_) {
    --spark.ticks_left;
    spark.velocity.z() -= 2.5 * kGameTick_s;
    spark.position += spark.velocity * kGameTick_s;
    if (spark.position.z() < 0) spark.position.z() = 0;
  }
  std::erase_if(sparks_, [](const Spark& spark) { return spark.ticks_left <= 0; });
  blast_ticks_ = counted_down(blast_ticks_);
}

double Simulation::assist_radius() const {
  return rules_of(state_.difficulty).assist + kSettingAssist * state_.aim_assist +
         (state_.seated ? kSeatedAssist : 0.0);
}

void Simulation::assist() {
  Robot& robot = state_.robot;
  robot.reticle = robot.sight;
  if (state_.seated) {
    // Steered: the dial turns it about the robot.
    const Vector2d to_sight = robot.sight - robot.position;
    const double reach = std::max(to_sight.norm(), kSeatedReach);
    const double angle = (to_sight.norm() > 1e-6 ? std::atan2(to_sight.y(), to_sight.x()) : 0.0) + robot.steer;
    robot.reticle = robot.position + reach * direction_of(angle);
  }
  // The critter nearest to it draws it on, to where a bolt will meet that critter.
  double best = assist_radius();
  const Critter* target = nullptr;
  for (const Critter& critter : state_.critters) {
    const double distance = (critter.position - robot.reticle).norm();
    if (distance >= best || critter.height < -0.5 * kClimbDepth) continue;
    best = distance;
    target = &critter;
  }
  if (target == nullptr) return;
  const double flight_s = (target->position - robot.position).norm() / kBoltSpeed;
  robot.reticle = target->position + target->velocity * flight_s;
}

void Simulation::look(const GameInput& input) {
  Robot& robot = state_.robot;
  if (input.camera_from_plane) {
    view_right(*input.camera_from_plane, &robot.right);
    view_sight(*input.camera_from_plane, ground_.radius_m(), &robot.sight);
  }
  const double dial = std::isfinite(input.dial) ? std::clamp(input.dial, -1.0, 1.0) : 0.0;
  if (state_.seated) robot.steer = std::remainder(robot.steer + dial * kSteerSpeed * kGameTick_s, 2 * std::numbers::pi);
  assist();
  const Vector2d aim = robot.reticle - robot.position;
  if (aim.norm() > 1e-6) robot.aim = aim.normalized();
}

void Simulation::move_robot(const GameInput& input) {
  Robot& robot = state_.robot;
  Vector2d move = input.move.allFinite() ? input.move : Vector2d::Zero();
  if (move.norm() > 1) move.normalize();
  const Vector2d away(-robot.right.y(), robot.right.x());
  const Vector2d wanted = kRobotSpeed * (move.x() * robot.right + move.y() * away);
  robot.velocity += (wanted - robot.velocity) * (kRobotAgility * kGameTick_s);
  const Vector2d before = robot.position;
  robot.position = ground_.slide(before, before + robot.velocity * kGameTick_s);
  robot.velocity = (robot.position - before) / kGameTick_s;
  robot.rolled = std::fmod(robot.rolled + (robot.position - before).norm(), 1000.0);
  if (robot.velocity.norm() > 0.05) {
    const double turn =
        std::remainder(std::atan2(robot.velocity.y(), robot.velocity.x()) - robot.heading, 2 * std::numbers::pi);
    robot.heading = std::remainder(robot.heading + std::clamp(turn, -0.07, 0.07), 2 * std::numbers::pi);
  }
  ground_.set_goal(robot.position);
}

void Simulation::act_on_deeds() {
  for (const CritterDeed& deed : deeds_) {
    const Critter& critter = state_.critters[deed.critter];
    switch (deed.kind) {
      case CritterDeed::Kind::bite:
      case CritterDeed::Kind::land_on:
        hurt_robot(rules_of(critter.kind).damage, critter.position);
        break;
      case CritterDeed::Kind::leap_off:
        hear("jump", critter.position, 0.6f);
        break;
      case CritterDeed::Kind::spit:
        hear("spit", critter.position, 0.6f);
        break;
    }
  }
  deeds_.clear();
}

void Simulation::release() {
  Wave& wave = state_.wave;
  if (wave.pause_ticks > 0) {
    if (--wave.pause_ticks > 0) return;
    hear("wave_begins", state_.robot.position);
    if (state_.unit_share < 1) {
      change_unit(1);
      lay_ground();
      settle();
    }
    return;
  }
  ++wave.ticks;
  wave.release_ticks = counted_down(wave.release_ticks);
  int left = 0;
  for (const int count : wave.to_release) left += count;
  if (left == 0 || wave.release_ticks > 0 || state_.critters.size() >= static_cast<std::size_t>(kMostCritters)) return;
  wave.release_ticks = release_interval(wave.number, state_.difficulty);
  int pick = random_index(&state_.random, left);
  std::size_t kind = 0;
  while (pick >= wave.to_release[kind]) pick -= wave.to_release[kind++];
  --wave.to_release[kind];
  // Through one of the gates, spread a little, and not on top of the robot.
  const Ground::Entry* entry = nullptr;
  for (int attempt = 0; attempt < 4; ++attempt) {
    const double gate = wave.gates[static_cast<std::size_t>(random_index(&state_.random, 3))];
    const Ground::Entry& candidate = ground_.entry_towards(gate + 0.5 * (random_part(&state_.random) - 0.5));
    const auto room = [&](const Ground::Entry& e) { return (e.position - state_.robot.position).norm(); };
    if (entry == nullptr || room(candidate) > room(*entry)) entry = &candidate;
    if (room(*entry) > 0.4) break;
  }
  const int side = random_index(&state_.random, 2) == 0 ? -1 : 1;
  state_.critters.push_back(climbing_critter(static_cast<CritterKind>(kind), *entry, wave.number, side));
}

void Simulation::bury() {
  const double chance = rules_of(state_.difficulty).pickup_chance;
  for (const Critter& critter : state_.critters) {
    if (critter.health > 0) continue;
    const bool drops = random_part(&state_.random) < chance;
    const int kind = random_index(&state_.random, 4);
    if (!drops || state_.pickups.size() >= static_cast<std::size_t>(kMostPickups)) continue;
    state_.pickups.push_back({static_cast<PickupKind>(kind), ground_.nearest_walkable(critter.position), kPickupLife});
  }
  std::erase_if(state_.critters, [](const Critter& critter) { return critter.health <= 0; });
}

void Simulation::take_pickups() {
  Robot& robot = state_.robot;
  std::erase_if(state_.pickups, [&](Pickup& pickup) {
    if (--pickup.ticks_left <= 0) return true;
    if ((pickup.position - robot.position).norm() > kPickupReach) return false;
    switch (pickup.kind) {
      case PickupKind::heal:
        robot.health = std::min(robot.health + kHeal, kFullHealth);
        break;
      case PickupKind::rapid:
        robot.rapid_ticks = kRapidTicks;
        break;
      case PickupKind::shield:
        robot.shield_ticks = kShieldTicks;
        break;
      case PickupKind::bomb:
        robot.bombs = std::min(robot.bombs + 1, kMostBombs);
        break;
    }
    hear("pickup", robot.position, 0.9f);
    return true;
  });
}

void Simulation::end_tick() {
  Robot& robot = state_.robot;
  robot.rapid_ticks = counted_down(robot.rapid_ticks);
  robot.shield_ticks = counted_down(robot.shield_ticks);
  robot.hurt_ticks = counted_down(robot.hurt_ticks);
  state_.chain_ticks = counted_down(state_.chain_ticks);
  if (state_.chain_ticks == 0) state_.chain = 0;
  Wave& wave = state_.wave;
  const bool all_released = std::all_of(wave.to_release.begin(), wave.to_release.end(), [](int n) { return n == 0; });
  if (state_.over || wave.pause_ticks > 0 || !all_released || !state_.critters.empty()) return;
  state_.score += static_cast<std::int64_t>(kWaveBonus) * wave.number;
  robot.health = std::min(robot.health + kWaveHeal, kFullHealth);
  wave.number = std::min(wave.number + 1, 9999);
  plan_wave(&state_);
}

void Simulation::step(const GameInput& input) {
  age_sparks();
  if (state_.over) return;
  ++state_.tick;
  look(input);
  move_robot(input);
  release();
  neighbours_.rebuild(state_.critters);
  move_critters(ground_, neighbours_, &state_, &deeds_);
  act_on_deeds();
  neighbours_.rebuild(state_.critters);
  shoot(input);
  fly_bolts();
  fly_spits();
  bury();
  take_pickups();
  end_tick();
}

bool view_right(const RigidTransform& camera_from_plane, Vector2d* right) {
  const Eigen::Matrix3d plane_from_camera = camera_from_plane.R.transpose();
  Vector2d x = plane_from_camera.col(0).head<2>();
  if (!(x.norm() > 0.05)) {
    // The camera is turned on its side: what is up in the picture is away.
    const Vector2d up = -plane_from_camera.col(1).head<2>();
    x = Vector2d(up.y(), -up.x());
  }
  if (!(x.norm() > 0.05) || !x.allFinite()) return false;
  *right = x.normalized();
  return true;
}

bool view_sight(const RigidTransform& camera_from_plane, double radius_m, Vector2d* sight) {
  const RigidTransform plane_from_camera = camera_from_plane.inverse();
  Vector2d at_m;
  if (!meets_plane(plane_from_camera.t, plane_from_camera.R.col(2), &at_m) || !at_m.allFinite()) return false;
  Vector2d at = at_m / radius_m;
  if (at.norm() > Ground::kHalf) at *= Ground::kHalf / at.norm();
  *sight = at;
  return true;
}

}  // namespace parallax::swarm
