#include "games/swarm_draw.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "games/swarm_rules.h"

namespace parallax::swarm {
namespace {

using Eigen::Affine3f;
using Eigen::AngleAxisf;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kWheelRadius = 0.16;  // of the robot's length
constexpr double kNear_px = 1000;      // taken to be seen as large as this where that is not known

DrawColour faded(DrawColour colour, double alpha) {
  colour.a *= static_cast<float>(std::clamp(alpha, 0.0, 1.0));
  return colour;
}
DrawColour mixed(const DrawColour& a, const DrawColour& b, float part) {
  return {a.r + (b.r - a.r) * part, a.g + (b.g - a.g) * part, a.b + (b.b - a.b) * part, a.a + (b.a - a.a) * part};
}

class Painter {
 public:
  Painter(const Simulation& simulation, const PlayingField& field, const ModelSet& models, CritterPoses* poses,
          DrawList* out)
      : simulation_(simulation),
        state_(simulation.state()),
        radius_(simulation.unit_m()),
        models_(models),
        poses_(*poses),
        out_(*out),
        safe_(state_.colour_blind_safe) {
    world_from_plane_.linear() = field.world_from_plane.R.cast<float>();
    world_from_plane_.translation() = field.world_from_plane.t.cast<float>();
    if (!out_.shadow_plane) out_.shadow_plane = field.world_from_plane;
  }

  void run() {
    ring(state_.home, 0.11, 24, {0.75f, 0.80f, 0.85f, 0.55f}, 1.5f);  // the plate where it began
    ring(state_.home, 0.03, 10, {0.75f, 0.80f, 0.85f, 0.55f}, 1.5f);
    for (const Pickup& pickup : state_.pickups) paint(pickup);
    for (const Critter& critter : state_.critters) paint(critter);
    if (state_.over) {
      paint_wreck();
    } else {
      paint_robot();
    }
    for (const Bolt& bolt : state_.bolts) paint(bolt);
    for (const Spit& spit : state_.spits) paint(spit);
    // At the end the sparks of the last blow stand still where they were born: a white ball, were they drawn.
    if (!state_.over)
      for (const Spark& spark : simulation_.sparks()) paint(spark);
    paint_blast();
    if (!state_.over) paint_reticle();
  }

 private:
  Vector3f world(const Vector3d& place) const { return world_from_plane_ * (place * radius_).cast<float>(); }
  Vector3f world(const Vector2d& place, double height) const { return world(Vector3d(place.x(), place.y(), height)); }
  // Of a model of unit length that stands there.
  Affine3f placed(const Vector2d& place, double height, double heading, double length) const {
    Affine3f plane_from_model = Affine3f::Identity();
    plane_from_model.translate((Vector3d(place.x(), place.y(), height) * radius_).cast<float>());
    plane_from_model.rotate(AngleAxisf(static_cast<float>(heading), Vector3f::UnitZ()));
    plane_from_model.scale(static_cast<float>(length * radius_));
    return world_from_plane_ * plane_from_model;
  }
  void line(const Vector3f& a, const Vector3f& b, const DrawColour& colour, float width_px) {
    out_.world_lines.push_back({a, b, colour, width_px});
  }
  void sprite(const Vector3f& at, double size, const DrawColour& colour, bool additive) {
    out_.sprites.push_back({at, static_cast<float>(size * radius_), colour, additive});
  }

  // How long a thing of a length in the game's units is seen to be there.
  double seen_px(const Vector3f& at, double length) const {
    if (!out_.camera_from_world || out_.camera.width() <= 0) return kNear_px;
    const double distance = (*out_.camera_from_world * at.cast<double>()).norm();
    return length * radius_ / std::max(distance, 1e-6) * out_.camera.mean_focal_px();
  }

  void paint(const Critter& critter) {
    const Model& model = models_.model(rules_of(critter.kind).model);
    CritterPose pose;
    pose.walked = critter.walked;
    pose.leaping = critter.phase == CritterPhase::leaping;
    pose.open = critter.rest_ticks > kBiteRest / 2 || critter.phase == CritterPhase::charging;
    Affine3f at = placed(critter.position, critter.height, critter.heading, kCritterLength * (1 + 0.3 * bulk(critter)));
    if (critter.phase == CritterPhase::climbing)  // head first over the edge
      at.rotate(AngleAxisf(static_cast<float>(8 * critter.height), Vector3f::UnitY()));
    if (critter.phase == CritterPhase::crouching) at.scale(Vector3f(1.1f, 1.1f, 0.7f));
    if (critter.phase == CritterPhase::leaping)
      at.rotate(AngleAxisf(static_cast<float>(-0.4 * critter.rise), Vector3f::UnitY()));
    const double alpha = 1 + critter.height / kClimbDepth;
    const bool above = critter.phase != CritterPhase::climbing;
    const DrawColour tint = faded(mixed({1, 1, 1, 1}, colour_of(critter.kind, safe_), 0.35f), above ? 1 : alpha);
    const CritterPoses::Body body = poses_.body(model, pose, seen_px(at.translation(), kCritterLength));
    const float emission = critter.hurt_ticks > 0 ? 0.9f : 0.1f;
    if (body.trunk) {
      // Nothing below the table darkens it.
      out_.meshes.push_back({body.trunk, at, tint, emission, above});
      out_.meshes.push_back({body.limbs, at, tint, emission, false});
    } else {
      draw_model(model, at, tint, emission, critter_motion(model, pose), &out_);
    }
    if (critter.health < critter.full_health) paint_bar(critter);
  }
  static double bulk(const Critter& critter) { return (critter.full_health - 10) / 50.0; }

  void paint_bar(const Critter& critter) {
    const double part = std::clamp(static_cast<double>(critter.health) / critter.full_health, 0.0, 1.0);
    const Vector2d across = 0.045 * state_.robot.right;
    const double height = critter.height + 0.085;
    const Vector3f left = world(critter.position - across, height), right = world(critter.position + across, height);
    line(left, right, {0.05f, 0.05f, 0.05f, 0.8f}, 5);
    line(left, left + static_cast<float>(part) * (right - left), health_colour(part, safe_), 3);
  }

  void paint_robot() {
    const Robot& robot = state_.robot;
    const Model& model = models_.model("robot");
    std::vector<PartMotion> motion;
    for (const ModelPart& part : model.parts) {
      if (part.name.rfind("wheel", 0) != 0) continue;
      Affine3f roll = Affine3f::Identity();
      roll.rotate(
          AngleAxisf(static_cast<float>(std::fmod(robot.rolled / (kWheelRadius * kRobotLength), 2 * std::numbers::pi)),
                     Vector3f::UnitY()));
      motion.push_back({part.name, roll});
    }
    Affine3f turret = Affine3f::Identity();
    turret.rotate(
        AngleAxisf(static_cast<float>(std::atan2(robot.aim.y(), robot.aim.x()) - robot.heading), Vector3f::UnitZ()));
    motion.push_back({"turret", turret});
    const bool flash = robot.hurt_ticks > kGrace / 2 && robot.shield_ticks == 0;
    draw_model(model, placed(robot.position, 0, robot.heading, kRobotLength),
               flash ? DrawColour{1, 0.5f, 0.45f, 1} : DrawColour{}, flash ? 0.7f : 0.08f, motion, &out_);
    if (robot.shield_ticks > 0) {
      const bool ending = robot.shield_ticks < ticks(1.5) && (robot.shield_ticks / 12) % 2 == 0;
      if (!ending) sprite(world(robot.position, 0.05), 0.13, {0.35f, 0.7f, 0.95f, 0.4f}, true);
      ring(robot.position, 0.1, 24, {0.34f, 0.71f, 0.91f, ending ? 0.3f : 0.9f}, 2.5f);
    }
    if (robot.reload_ticks > kReload - 5)
      sprite(world(robot.position + 0.08 * robot.aim, kBoltHeight), 0.035, {1, 0.85f, 0.4f, 0.9f}, true);
  }

  // On its side, dark, and smoking.
  void paint_wreck() {
    const Robot& robot = state_.robot;
    Affine3f at = placed(robot.position, 0.46 * kRobotLength, robot.heading, kRobotLength);
    at.rotate(AngleAxisf(1.75f, Vector3f::UnitX()));
    draw_model(models_.model("robot"), at, {0.42f, 0.42f, 0.45f, 1}, 0, {}, &out_);
    for (int k = 0; k < 4; ++k)
      sprite(world(robot.position + 0.012 * k * robot.right, 0.07 + 0.035 * k), 0.03 + 0.012 * k,
             {0.3f, 0.3f, 0.32f, 0.45f - 0.1f * static_cast<float>(k)}, false);
  }

  void paint(const Bolt& bolt) {
    const double heading = std::atan2(bolt.direction.y(), bolt.direction.x());
    const DrawColour colour{1, 0.9f, 0.45f, 1};
    const std::size_t first = out_.meshes.size();
    draw_model(models_.model("bolt"), placed(bolt.position, kBoltHeight - 0.01, heading, 0.06), colour, 0.95f, {},
               &out_);
    for (std::size_t i = first; i < out_.meshes.size(); ++i) out_.meshes[i].casts_shadow = false;
    sprite(world(bolt.position, kBoltHeight), 0.03, faded(colour, 0.6), true);
    line(world(bolt.position, kBoltHeight), world(bolt.position - 0.05 * bolt.direction, kBoltHeight),
         faded(colour, 0.5), 2);
  }

  void paint(const Spit& spit) {
    const double heading = std::atan2(spit.velocity.y(), spit.velocity.x());
    const DrawColour colour = colour_of(CritterKind::spitter, safe_);
    draw_model(models_.model("spit"), placed(spit.position, std::max(spit.height, 0.0), heading, 0.03), colour, 0.5f,
               {}, &out_);
    sprite(world(spit.position, spit.height + 0.01), 0.025, faded(colour, 0.5), false);
  }

  void paint(const Pickup& pickup) {
    static constexpr std::array<const char*, 4> kModels{"pickup_heal", "pickup_rapid", "pickup_shield", "pickup_bomb"};
    const double time_s = static_cast<double>(state_.tick % 1'000'000) * kGameTick_s;
    const double height = 0.02 + 0.012 * std::sin(4 * time_s);
    if (pickup.ticks_left < ticks(3) && (pickup.ticks_left / 15) % 2 == 0) return;
    draw_model(models_.model(kModels[static_cast<std::size_t>(pickup.kind)]),
               placed(pickup.position, height, 1.6 * time_s, 0.075), DrawColour{}, 0.35f, {}, &out_);
    ring(pickup.position, 0.055, 16, {1, 1, 1, 0.6f}, 1.5f);
  }

  void paint(const Spark& spark) {
    const double left = static_cast<double>(spark.ticks_left) / spark.ticks;
    static constexpr std::array<DrawColour, 4> kColours{
        {{1, 0.75f, 0.25f, 1}, {0.45f, 0.8f, 1, 1}, {1, 0.95f, 0.8f, 1}, {0.75f, 0.72f, 0.68f, 1}}};
    const DrawColour colour = kColours[static_cast<std::size_t>(spark.colour)];
    sprite(world(spark.position), spark.size * (0.5 + 0.5 * left), faded(colour, 0.9 * left), spark.colour != 3);
  }

  void ring(const Vector2d& middle, double radius, int sides, const DrawColour& colour, float width_px) {
    Vector3f before = world(middle + Vector2d(radius, 0), 0.002);
    for (int k = 1; k <= sides; ++k) {
      const double angle = k * 2 * std::numbers::pi / sides;
      const Vector3f next = world(middle + radius * Vector2d(std::cos(angle), std::sin(angle)), 0.002);
      line(before, next, colour, width_px);
      before = next;
    }
  }

  void paint_blast() {
    if (simulation_.blast_ticks() <= 0) return;
    const double left = static_cast<double>(simulation_.blast_ticks()) / ticks(0.5);
    const double reach = kBombRadius * (1 - left * left);
    ring(simulation_.blast_position(), reach, 40, {1, 0.7f, 0.25f, static_cast<float>(left)}, 4);
    sprite(world(simulation_.blast_position(), 0.05), 0.5 * reach + 0.1,
           {1, 0.7f, 0.3f, static_cast<float>(0.7 * left)}, true);
  }

  void paint_reticle() {
    const Robot& robot = state_.robot;
    const DrawColour colour = safe_ ? DrawColour{0.94f, 0.89f, 0.26f, 0.95f} : DrawColour{1, 0.25f, 0.2f, 0.95f};
    const DrawColour shade{0, 0, 0, 0.55f};
    ring(robot.reticle, 0.05, 24, shade, 5);
    ring(robot.reticle, 0.05, 24, colour, 2.5f);
    for (int k = 0; k < 4; ++k) {
      const double angle = k * std::numbers::pi / 2;
      const Vector2d out(std::cos(angle), std::sin(angle));
      line(world(robot.reticle + 0.035 * out, 0.002), world(robot.reticle + 0.075 * out, 0.002), colour, 2.5f);
    }
    // The line of fire, faintly.
    const double reach = (robot.reticle - robot.position).norm();
    for (double along = 0.12; along + 0.03 < reach - 0.05; along += 0.07)
      line(world(robot.position + along * robot.aim, 0.003), world(robot.position + (along + 0.03) * robot.aim, 0.003),
           faded(colour, 0.45), 1.5f);
  }

  const Simulation& simulation_;
  const State& state_;
  double radius_;
  const ModelSet& models_;
  CritterPoses& poses_;
  DrawList& out_;
  bool safe_;
  Affine3f world_from_plane_ = Affine3f::Identity();
};

}  // namespace

void draw_swarm(const Simulation& simulation, const PlayingField& field, const ModelSet& models, CritterPoses* poses,
                DrawList* out) {
  Painter(simulation, field, models, poses, out).run();
}

DrawColour colour_of(CritterKind kind, bool colour_blind_safe) {
  static constexpr std::array<DrawColour, kKinds> kSafe{
      {{0.90f, 0.62f, 0, 1}, {0.34f, 0.71f, 0.91f, 1}, {0, 0.62f, 0.45f, 1}, {0.80f, 0.47f, 0.65f, 1}}};
  static constexpr std::array<DrawColour, kKinds> kRich{
      {{0.95f, 0.45f, 0.15f, 1}, {0.45f, 0.35f, 0.95f, 1}, {0.35f, 0.85f, 0.25f, 1}, {0.95f, 0.25f, 0.55f, 1}}};
  return (colour_blind_safe ? kSafe : kRich)[static_cast<std::size_t>(kind)];
}

DrawColour health_colour(double part, bool colour_blind_safe) {
  if (colour_blind_safe) return part > 0.35 ? DrawColour{0.34f, 0.71f, 0.91f, 1} : DrawColour{0.84f, 0.37f, 0, 1};
  return part > 0.35 ? DrawColour{0.3f, 0.85f, 0.3f, 1} : DrawColour{0.95f, 0.2f, 0.15f, 1};
}

}  // namespace parallax::swarm
