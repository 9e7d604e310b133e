// What a game of Marbles looks like: its explanation, its numbers and its picture.
#include <algorithm>
#include <cmath>

#include "games/marbles_game.h"

namespace parallax {
namespace {

// Of the palette of Okabe and Ito (2008); the richer palette has its own two for the marbles.
constexpr DrawColour kOrange{0.90f, 0.62f, 0.0f, 1}, kSkyBlue{0.34f, 0.71f, 0.91f, 1};
constexpr DrawColour kGreen{0.0f, 0.62f, 0.45f, 1}, kYellow{0.94f, 0.89f, 0.26f, 1};
constexpr DrawColour kRose{0.95f, 0.35f, 0.55f, 1}, kWhite{1, 1, 1, 1}, kGrey{0.45f, 0.45f, 0.48f, 1};

constexpr float kCoinSize = 0.9f, kCoinHover = 0.12f, kFlagSize = 2.6f;
constexpr float kCoinTurns = 0.5f;                                      // a second
constexpr float kArrowLength = 3;                                       // at the greatest tilt
constexpr float kRampModelHeight = 0.36f, kRampModelHalfWidth = 0.32f;  // of assets/models/ramp
constexpr float kPlateThickness = 0.08f;

DrawColour faint(DrawColour colour, float alpha) {
  colour.a = alpha;
  return colour;
}

// A unit cube standing on z = 0.
std::shared_ptr<const Mesh> make_block() {
  auto mesh = std::make_shared<Mesh>();
  for (int axis = 0; axis < 3; ++axis)
    for (const float sign : {-1.0f, 1.0f}) {
      const std::uint32_t first = static_cast<std::uint32_t>(mesh->vertices.size());
      Eigen::Vector3f normal = Eigen::Vector3f::Zero(), u = normal, v = normal;
      normal[axis] = sign;
      u[(axis + 1) % 3] = 0.5f;
      v[(axis + 2) % 3] = 0.5f * sign;
      for (int corner = 0; corner < 4; ++corner) {
        const float a = corner == 0 || corner == 3 ? -1.0f : 1.0f, b = corner < 2 ? -1.0f : 1.0f;
        MeshVertex vertex;
        vertex.position = 0.5f * normal + a * u + b * v + Eigen::Vector3f(0, 0, 0.5f);
        vertex.normal = normal;
        mesh->vertices.push_back(vertex);
      }
      for (const std::uint32_t k : {0u, 1u, 2u, 0u, 2u, 3u}) mesh->indices.push_back(first + k);
    }
  return mesh;
}

std::string clock_text(int ticks) {
  const int seconds = (ticks + kGameTicksPerSecond - 1) / kGameTicksPerSecond;
  return std::to_string(seconds / 60) + (seconds % 60 < 10 ? ":0" : ":") + std::to_string(seconds % 60);
}

}  // namespace

const GameInfo& MarblesGame::info() const {
  static const GameInfo info = [] {
    GameInfo made;
    made.name = "marbles";
    made.title = "Marbles";
    made.explanation = {
        "Roll your marble to the coins, then to the goal,",
        "which opens when all coins are collected.",
        "The table tilts as you tilt the camera, or with",
        "the keys. Hold fire to charge, let go to flick",
        "the marble nearest the cross-hairs.",
        "Real things are in the way; ramps lead onto the",
        "low ones. What rolls off the edge costs a life.",
    };
    made.fire_does = "flick a marble";
    made.act_does = "level the table";
    made.move_does = "tilt the table";
    made.settings = {{"control", "Tilt with", "", 0, 1, 0, {"camera and keys", "keys"}},
                     {"sensitivity", "Tilt of the table per tilt of the camera", "", 0.25, 3, 1, {}},
                     {"loose_marbles", "Loose marbles", "", 0, kMarblesMostLoose, 2, {}},
                     {"outlines", "Outlines of real things", "", 0, 1, 1, {"off", "on"}}};
    return made;
  }();
  return info;
}

GameHud MarblesGame::hud() const {
  GameHud hud;
  hud.score = state_.score;
  const auto taken = std::count_if(state_.level.coins.begin(), state_.level.coins.end(),
                                   [](const MarblesCoin& coin) { return coin.taken; });
  hud.lines = {"level " + std::to_string(state_.level_number), "time " + clock_text(state_.ticks_left),
               "coins " + std::to_string(taken) + "/" + std::to_string(state_.level.coins.size()) +
                   (goal_is_open() ? ", goal open" : ""),
               "lives " + std::to_string(state_.lives)};
  const float full = static_cast<float>(marbles_level_ticks(state_.difficulty, state_.level_number));
  hud.gauges.push_back({"time", std::clamp(static_cast<double>(static_cast<float>(state_.ticks_left) / full), 0.0, 1.0),
                        state_.ticks_left < 15 * kGameTicksPerSecond ? kOrange : kSkyBlue});
  hud.gauges.push_back({"tilt", std::min(1.0, static_cast<double>(state_.tilt.norm() / kMarblesGreatestTilt)), kGreen});
  if (state_.charge_ticks > 0)
    hud.gauges.push_back({"flick", static_cast<double>(state_.charge_ticks) / kMarblesFullCharge_ticks, kYellow});
  switch (state_.news) {
    case MarblesNews::none:
      break;
    case MarblesNews::level:
      hud.message = "Level " + std::to_string(state_.level_number);
      break;
    case MarblesNews::lost:
      hud.message = "Over the edge!";
      break;
    case MarblesNews::time_up:
      hud.message = "Time is up";
      break;
    case MarblesNews::put_back:
      hud.message = "Stuck: back to the start";
      break;
    case MarblesNews::no_room:
      hud.message = "Too little free room: real things are ignored";
      break;
    case MarblesNews::done:
      hud.message = "Level done";
      break;
    case MarblesNews::over:
      hud.message = "Game over";
      break;
  }
  if (state_.phase == MarblesPhase::over) hud.message = "Game over";
  return hud;
}

void MarblesGame::draw(const ModelSet& models, DrawList* out) const {
  const float unit = static_cast<float>(state_.unit_m);
  Eigen::Affine3f world_from_plane = Eigen::Affine3f::Identity();
  world_from_plane.linear() = field_.world_from_plane.R.cast<float>();
  world_from_plane.translation() = field_.world_from_plane.t.cast<float>();
  const Eigen::Affine3f world_from_table = world_from_plane * Eigen::Scaling(unit);
  const auto placed = [&](const Eigen::Vector2f& place, float height, float size) -> Eigen::Affine3f {
    return world_from_table * Eigen::Translation3f(place.x(), place.y(), height) * Eigen::Scaling(size);
  };
  const auto line = [&](const Eigen::Vector3f& from, const Eigen::Vector3f& to, const DrawColour& colour, float width) {
    WorldLine made;
    made.a = world_from_table * from;
    made.b = world_from_table * to;
    made.colour = colour;
    made.width_px = width;
    out->world_lines.push_back(made);
  };

  // Goal, flag, coins.
  const MarblesLevel& level = state_.level;
  const bool open = goal_is_open();
  const float beat = 0.5f + 0.5f * std::sin(2 * static_cast<float>(M_PI) * static_cast<float>(state_.phase_ticks) /
                                            static_cast<float>(kGameTicksPerSecond));
  draw_model(models.model("goal"), placed(level.goal, level.goal_height, 2 * level.goal_radius), open ? kWhite : kGrey,
             open ? 0.25f + 0.35f * beat : 0, {}, out);
  const Eigen::Vector2f pole = level.goal - Eigen::Vector2f(0, level.goal_radius);
  if (open) draw_model(models.model("flag"), placed(pole, level.goal_height, kFlagSize), kWhite, 0, {}, out);
  for (std::size_t i = 0; i < level.coins.size(); ++i) {
    const MarblesCoin& coin = level.coins[i];
    if (coin.taken) continue;
    const float turns = kCoinTurns * static_cast<float>(state_.phase_ticks % (2 * kGameTicksPerSecond)) /
                            static_cast<float>(kGameTicksPerSecond) +
                        0.13f * static_cast<float>(i);
    const Eigen::Affine3f at = placed(coin.place, coin.height + kCoinHover, kCoinSize) *
                               Eigen::AngleAxisf(2 * static_cast<float>(M_PI) * turns, Eigen::Vector3f::UnitZ());
    draw_model(models.model("coin"), at, kWhite, 0.15f, {}, out);
  }

  // Ramps: the model as far as it rises, a plate over the landing.
  static const std::shared_ptr<const Mesh> block = make_block();
  for (const TableRamp& ramp : level.ramps) {
    const float turn = std::atan2(ramp.uphill.y(), ramp.uphill.x());
    const Eigen::Affine3f foot = placed(ramp.foot, 0, 1) * Eigen::AngleAxisf(turn, Eigen::Vector3f::UnitZ());
    draw_model(models.model("ramp"),
               foot * Eigen::Translation3f(0.5f * ramp.length, 0, 0) *
                   Eigen::Scaling(ramp.length, ramp.half_width / kRampModelHalfWidth, ramp.height / kRampModelHeight),
               kWhite, 0, {}, out);
    MeshInstance plate;
    plate.mesh = block;
    plate.world_from_model = foot *
                             Eigen::Translation3f(ramp.length + 0.5f * ramp.landing, 0, ramp.height - kPlateThickness) *
                             Eigen::Scaling(ramp.landing, 2 * ramp.half_width, kPlateThickness);
    plate.tint = kGrey;
    out->meshes.push_back(plate);
  }

  // Marbles; the model stands on z = 0 and turns about its middle. Below the table they fade.
  for (std::size_t i = 0; i < state_.marbles.size(); ++i) {
    if (i == 0 && state_.respawn_ticks > 0) continue;
    const MarbleMotion& marble = state_.marbles[i];
    DrawColour tint = i == 0 ? kWhite : state_.colour_blind_safe ? kOrange : kRose;
    tint.a = std::clamp(1 + (marble.position.z() + kMarbleRadius) / 3, 0.0f, 1.0f);
    const Eigen::Affine3f at = world_from_table * Eigen::Translation3f(marble.position) * marble.rotation *
                               Eigen::Translation3f(0, 0, -kMarbleRadius);
    draw_model(models.model("marble"), at, tint, i == 0 ? 0.1f : 0.0f, {}, out);
  }

  // The rim, the edges of real things, and an arrow to where the table is tilted.
  if (state_.outlines) {
    const std::vector<Eigen::Vector2f>& rim = ground_.outline;
    for (std::size_t i = 0; i < rim.size(); ++i) {
      Eigen::Vector3f a, b;
      a << rim[i], 0;
      b << rim[(i + 1) % rim.size()], 0;
      line(a, b, faint(kOrange, 0.6f), 1.5f);
    }
    for (const TableEdge& edge : edges_) line(edge.from, edge.to, faint(kSkyBlue, 0.4f), 1);
  }
  if (state_.tilt.norm() > 0.01f && state_.respawn_ticks == 0 && state_.phase == MarblesPhase::playing) {
    const Eigen::Vector2f along = state_.tilt * (kArrowLength / kMarblesGreatestTilt);
    const Eigen::Vector2f from = state_.marbles.front().position.head<2>();
    const float height = std::max(0.0f, state_.marbles.front().position.z() - 0.9f * kMarbleRadius);
    const auto at = [&](const Eigen::Vector2f& place) { return Eigen::Vector3f(place.x(), place.y(), height); };
    const Eigen::Vector2f tip = from + along.normalized() * kMarbleRadius + along;
    const Eigen::Vector2f side(-along.y(), along.x());
    line(at(from + along.normalized() * kMarbleRadius), at(tip), kYellow, 3);
    line(at(tip), at(tip - 0.25f * along + 0.15f * side), kYellow, 3);
    line(at(tip), at(tip - 0.25f * along - 0.15f * side), kYellow, 3);
  }
}

}  // namespace parallax
