#include "games/swarm_critters.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "games/swarm_rules.h"

namespace parallax::swarm {
namespace {

using Eigen::Vector2d;

constexpr double kApart = 0.085;  // nearer than this they push each other away
constexpr double kFlock = 0.25;   // swarmers within this are one flock
constexpr double kAgility = 7;    // of the difference to the wanted velocity, a second
constexpr double kLeapGravity = 8 * kLeapHeight / (kLeap * kGameTick_s * kLeap * kGameTick_s);
constexpr double kDesperate = 1.5;  // more frantic than this, every kind bites
constexpr double kFarthestStep = Ground::kCell / 2;

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }
Vector2d turned(const Vector2d& v, double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {c * v.x() - s * v.y(), s * v.x() + c * v.y()};
}
Vector2d unit_or(const Vector2d& v, const Vector2d& otherwise) {
  const double length = v.norm();
  return length > 1e-9 ? Vector2d(v / length) : otherwise;
}

void begin(CritterPhase phase, Critter* critter) {
  critter->phase = phase;
  critter->phase_ticks = 0;
}

class Mover {
 public:
  Mover(const Ground& ground, const Neighbours& neighbours, State* state, std::vector<CritterDeed>* deeds)
      : ground_(ground),
        neighbours_(neighbours),
        state_(*state),
        robot_(state->robot),
        deeds_(*deeds),
        frenzy_(frenzy(state->wave)),
        pace_(rules_of(state->difficulty).speed * wave_speed(state->wave.number) * (1 + 0.5 * frenzy_)) {}

  void run() {
    // All think about the same moment, then all move.
    wanted_.resize(state_.critters.size());
    for (std::size_t i = 0; i < state_.critters.size(); ++i) wanted_[i] = think(i);
    for (std::size_t i = 0; i < state_.critters.size(); ++i) move(i);
  }

 private:
  double speed_of(const Critter& critter) const { return rules_of(critter.kind).speed * pace_; }
  bool open(const Vector2d& from, const Vector2d& to) const { return ground_.clear_between(from, to); }

  // Away from whoever is too near, at most about 1 for each of them.
  Vector2d apart(std::size_t self) const {
    const Vector2d& at = state_.critters[self].position;
    Vector2d push = Vector2d::Zero();
    neighbours_.near(at, kApart, [&](std::size_t other) {
      if (other == self || state_.critters[other].phase == CritterPhase::leaping) return;
      const Vector2d away = at - state_.critters[other].position;
      const double distance = away.norm();
      if (distance >= kApart) return;
      // In the very same place, each has a direction of its own.
      const Vector2d direction =
          distance > 1e-6 ? Vector2d(away / distance) : turned(Vector2d::UnitX(), static_cast<double>(self) * 2.399963);
      push += direction * (1 - distance / kApart);
    });
    return push;
  }

  // Towards the middle of the flock and the way it goes.
  Vector2d together(std::size_t self, double speed) const {
    const Critter& critter = state_.critters[self];
    Vector2d middle = Vector2d::Zero(), velocity = Vector2d::Zero();
    int flock = 0;
    neighbours_.near(critter.position, kFlock, [&](std::size_t other) {
      const Critter& mate = state_.critters[other];
      if (other == self || mate.kind != critter.kind || mate.phase != CritterPhase::walking) return;
      if ((mate.position - critter.position).squaredNorm() > kFlock * kFlock) return;
      middle += mate.position;
      velocity += mate.velocity;
      ++flock;
    });
    if (flock == 0) return Vector2d::Zero();
    return 0.5 * speed / kFlock * (middle / flock - critter.position) + 0.2 * (velocity / flock - critter.velocity);
  }

  Vector2d think_flanker(Critter* critter, double speed) {
    const Vector2d from_robot = critter->position - robot_.position;
    const double distance = from_robot.norm();
    const double angle = std::atan2(cross(robot_.aim, from_robot), robot_.aim.dot(from_robot));
    if (critter->phase == CritterPhase::charging) return 1.7 * speed * ground_.way_from(critter->position);
    if (critter->rest_ticks > 0 && distance < kFlankRing)  // has bitten: away, for another go
      return speed * retreat(critter, from_robot);
    const bool behind = std::abs(angle) > kFlankAngle && distance < kFlankRing * 1.3;
    if (critter->rest_ticks == 0 && (behind || critter->phase_ticks > kFlankPatience)) {
      begin(CritterPhase::charging, critter);
      return 1.7 * speed * ground_.way_from(critter->position);
    }
    const double round = std::min(critter->side * angle + 0.7, kFlankAngle + 0.4);
    const Vector2d target = robot_.position + kFlankRing * turned(robot_.aim, critter->side * round);
    if (open(critter->position, target)) return speed * unit_or(target - critter->position, Vector2d::Zero());
    return speed * ground_.way_from(critter->position);
  }

  Vector2d think_jumper(Critter* critter, double speed) {
    if (critter->phase == CritterPhase::crouching) {
      if (critter->phase_ticks < kCrouch) return Vector2d::Zero();
      begin(CritterPhase::leaping, critter);
      critter->velocity = (robot_.position - critter->position) / (kLeap * kGameTick_s);
      critter->rise = kLeapGravity * kLeap * kGameTick_s / 2;
      return critter->velocity;
    }
    const Vector2d to_robot = robot_.position - critter->position;
    const double distance = to_robot.norm();
    if (critter->rest_ticks == 0 && distance < kLeapFrom && open(critter->position, robot_.position)) {
      begin(CritterPhase::crouching, critter);
      return Vector2d::Zero();
    }
    if (critter->rest_ticks > 0 && distance < 0.6 * kLeapFrom) return 0.7 * speed * retreat(critter, -to_robot);
    return speed * ground_.way_from(critter->position);
  }

  Vector2d think_spitter(std::size_t self, double speed) {
    Critter* critter = &state_.critters[self];
    const Vector2d from_robot = critter->position - robot_.position;
    const double distance = from_robot.norm(), bold = 1 - 0.3 * frenzy_;
    if (frenzy_ >= kDesperate) return speed * ground_.way_from(critter->position);
    const bool sees = open(critter->position, robot_.position);
    if (sees && critter->rest_ticks == 0 && distance < kSpitReach) spit(self, distance);
    if (!sees || distance > kSpitFar * bold) return speed * ground_.way_from(critter->position);
    if (distance < kSpitNear * bold) return 1.2 * speed * retreat(critter, from_robot);
    return 0.5 * speed * strafe(critter, from_robot);
  }

  // Straight away, else to a side.
  Vector2d retreat(Critter* critter, const Vector2d& from_robot) {
    const Vector2d away = unit_or(from_robot, Vector2d::UnitX());
    if (open(critter->position, critter->position + 1.6 * Ground::kCell * away)) return away;
    return strafe(critter, from_robot);
  }
  Vector2d strafe(Critter* critter, const Vector2d& from_robot) {
    const Vector2d away = unit_or(from_robot, Vector2d::UnitX());
    const Vector2d round = critter->side * Vector2d(-away.y(), away.x());
    if (open(critter->position, critter->position + 1.6 * Ground::kCell * round)) return round;
    if (critter->phase_ticks % 32 == 0) critter->side = -critter->side;
    return Vector2d::Zero();
  }

  void spit(std::size_t self, double distance) {
    Critter& critter = state_.critters[self];
    if (state_.spits.size() >= static_cast<std::size_t>(kMostSpits)) return;
    const double time_s = std::max(distance / kSpitSpeed, 0.25);
    Spit spit;
    spit.position = critter.position;
    spit.velocity = (robot_.position - critter.position) / time_s;
    spit.height = kSpitHeight;
    spit.rise = kSpitGravity * time_s / 2 - kSpitHeight / time_s;
    state_.spits.push_back(spit);
    critter.rest_ticks = static_cast<int>(kSpitRest * (1 - 0.25 * frenzy_));
    deeds_.push_back({CritterDeed::Kind::spit, self});
  }

  // The wanted velocity; begins what is to be begun.
  Vector2d think(std::size_t self) {
    Critter& critter = state_.critters[self];
    if (critter.phase == CritterPhase::climbing || critter.phase == CritterPhase::leaping) return critter.velocity;
    const double speed = speed_of(critter);
    Vector2d wanted = Vector2d::Zero();
    switch (critter.kind) {
      case CritterKind::swarmer:
        wanted = speed * ground_.way_from(critter.position) + together(self, speed);
        break;
      case CritterKind::flanker:
        wanted = think_flanker(&critter, speed);
        break;
      case CritterKind::jumper:
        wanted = think_jumper(&critter, speed);
        break;
      case CritterKind::spitter:
        wanted = think_spitter(self, speed);
        break;
    }
    if (critter.phase == CritterPhase::crouching || critter.phase == CritterPhase::leaping) return wanted;
    const double most = 1.8 * speed;
    wanted += 1.2 * speed * apart(self);
    // Not through the robot.
    const Vector2d away = critter.position - robot_.position;
    const double room = kRobotRadius + kCritterRadius;
    if (away.norm() < room) wanted += 3 * speed * (1 - away.norm() / room) * unit_or(away, Vector2d::UnitX());
    if (wanted.norm() > most) wanted *= most / wanted.norm();
    return wanted;
  }

  void move(std::size_t self) {
    Critter& critter = state_.critters[self];
    ++critter.phase_ticks;
    critter.rest_ticks = std::max(critter.rest_ticks - 1, 0);
    critter.hurt_ticks = std::max(critter.hurt_ticks - 1, 0);
    switch (critter.phase) {
      case CritterPhase::climbing:
        climb(&critter);
        return;
      case CritterPhase::leaping:
        leap(self);
        return;
      case CritterPhase::crouching:
        critter.velocity *= 0.8;
        break;
      default:
        critter.velocity += (wanted_[self] - critter.velocity) * (kAgility * kGameTick_s);
        break;
    }
    const Vector2d before = critter.position;
    step(&critter);
    critter.velocity = (critter.position - before) / kGameTick_s;
    const double moved = (critter.position - before).norm();
    critter.walked = std::fmod(critter.walked + moved, 1000.0);
    const Vector2d facing = critter.velocity.norm() > 0.02 ? critter.velocity : Vector2d(robot_.position - before);
    const double turn = std::remainder(std::atan2(facing.y(), facing.x()) - critter.heading, 2 * std::numbers::pi);
    critter.heading = std::remainder(critter.heading + std::clamp(turn, -0.06, 0.06), 2 * std::numbers::pi);
    bite(self);
  }

  void step(Critter* critter) const {
    Vector2d way = critter->velocity * kGameTick_s;
    if (way.norm() > kFarthestStep) way *= kFarthestStep / way.norm();
    critter->position = ground_.slide(critter->position, critter->position + way);
  }

  void climb(Critter* critter) const {
    const double left = std::max(1.0 - static_cast<double>(critter->phase_ticks) / kClimb, 0.0);
    critter->height = -kClimbDepth * left;
    critter->walked += 0.3 * kGameTick_s;
    critter->position += critter->velocity * kGameTick_s;
    if (critter->phase_ticks < kClimb && critter->position.norm() < 4) return;
    critter->height = 0;
    critter->position = ground_.nearest_walkable(critter->position);
    const Vector2d from_robot = critter->position - robot_.position;
    if (critter->kind == CritterKind::flanker) critter->side = cross(robot_.aim, from_robot) >= 0 ? 1 : -1;
    begin(CritterPhase::walking, critter);
  }

  void leap(std::size_t self) {
    Critter& critter = state_.critters[self];
    if (critter.phase_ticks == 1) deeds_.push_back({CritterDeed::Kind::leap_off, self});
    critter.height += critter.rise * kGameTick_s;
    critter.rise -= kLeapGravity * kGameTick_s;
    step(&critter);
    const bool down = critter.height <= 0 || critter.height > 1 || critter.phase_ticks > 2 * kLeap;
    if (!down) return;
    critter.height = critter.rise = 0;
    critter.velocity = Vector2d::Zero();
    critter.rest_ticks = static_cast<int>(kLeapRest * (1 - 0.25 * frenzy_));
    begin(CritterPhase::walking, &critter);
    if ((critter.position - robot_.position).norm() < kBiteReach) deeds_.push_back({CritterDeed::Kind::land_on, self});
  }

  void bite(std::size_t self) {
    Critter& critter = state_.critters[self];
    const bool biter = critter.kind == CritterKind::swarmer || critter.kind == CritterKind::flanker;
    if (!biter && frenzy_ < kDesperate) return;
    if (critter.rest_ticks > 0 || (critter.position - robot_.position).norm() > kBiteReach) return;
    critter.rest_ticks = kBiteRest;
    if (critter.phase == CritterPhase::charging) begin(CritterPhase::walking, &critter);
    deeds_.push_back({CritterDeed::Kind::bite, self});
  }

  const Ground& ground_;
  const Neighbours& neighbours_;
  State& state_;
  const Robot& robot_;
  std::vector<CritterDeed>& deeds_;
  double frenzy_, pace_;
  std::vector<Vector2d> wanted_;
};

}  // namespace

void move_critters(const Ground& ground, const Neighbours& neighbours, State* state, std::vector<CritterDeed>* deeds) {
  Mover(ground, neighbours, state, deeds).run();
}

Critter climbing_critter(CritterKind kind, const Ground::Entry& entry, int wave, int side) {
  Critter critter;
  critter.kind = kind;
  critter.position = entry.position + kClimbReach * entry.outward;
  critter.velocity = -kClimbReach / (kClimb * kGameTick_s) * entry.outward;
  critter.height = -kClimbDepth;
  critter.heading = std::atan2(-entry.outward.y(), -entry.outward.x());
  critter.health = critter.full_health = wave_health(wave, kind);
  critter.side = side;
  return critter;
}

}  // namespace parallax::swarm
