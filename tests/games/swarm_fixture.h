// What the tests of Swarm share: cameras, tables, and a game with nobody in it.
#pragma once

#include <Eigen/Geometry>
#include <memory>

#include "games/swarm_player.h"
#include "games/swarm_rules.h"
#include "games/swarm_simulation.h"

namespace parallax::swarm {

inline constexpr double kRadius_m = 0.25;  // of the table

// A camera that looks from one place (metres) at another.
inline RigidTransform looking(const Eigen::Vector3d& eye, const Eigen::Vector3d& at) {
  const Eigen::Vector3d z = (at - eye).normalized(), x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d R;
  R.row(0) = x;
  R.row(1) = z.cross(x);
  R.row(2) = z;
  return {R, -R * eye};
}

// From the side of the player, at a place of the table in units of its radius.
inline RigidTransform looking_at(double x, double y) {
  return looking({0, -0.5, 0.45}, {x * kRadius_m, y * kRadius_m, 0});
}

// Walls on the table: rectangles [x0, x1] x [y0, y1] in units of the radius.
inline PlayingField table_with(const std::vector<Eigen::Vector4d>& walls) {
  PlayingField field = empty_field(kRadius_m);
  auto surface = std::make_shared<SceneSurface>();
  surface->columns = surface->rows = 100;
  surface->cell_m = 2 * kRadius_m / 100;
  surface->corner_m = Eigen::Vector2d(-kRadius_m, -kRadius_m);
  surface->height_m.assign(10000, 0.0f);
  surface->known.assign(10000, 1);
  for (int row = 0; row < 100; ++row)
    for (int column = 0; column < 100; ++column) {
      const Eigen::Vector2d at = surface->centre_of(column, row) / kRadius_m;
      for (const Eigen::Vector4d& wall : walls)
        if (at.x() >= wall[0] && at.x() <= wall[1] && at.y() >= wall[2] && at.y() <= wall[3])
          surface->height_m[surface->index(column, row)] = static_cast<float>(0.3 * kRadius_m);
    }
  field.surface = surface;
  return field;
}

// A game in its first wave, to which nobody has come; it waits for more than any test lasts.
inline Simulation quiet_game(const PlayingField& field = empty_field(kRadius_m), const GameOptions& options = {}) {
  Simulation game;
  game.start(field, options);
  game.edit_state().wave.pause_ticks = 0;
  game.edit_state().wave.to_release = {1, 0, 0, 0};
  game.edit_state().wave.release_ticks = ticks(59);
  game.edit_state().robot.position = Eigen::Vector2d::Zero();
  return game;
}

inline Critter& add(Simulation* game, CritterKind kind, const Eigen::Vector2d& position) {
  Critter critter;
  critter.kind = kind;
  critter.phase = CritterPhase::walking;
  critter.position = position;
  critter.health = critter.full_health = rules_of(kind).health;
  game->edit_state().critters.push_back(critter);
  return game->edit_state().critters.back();
}

inline GameInput aiming_at(double x, double y, bool fire = false) {
  GameInput input;
  input.camera_from_plane = looking_at(x, y);
  input.fire = fire;
  return input;
}

inline void run(Simulation* game, const GameInput& input, double seconds) {
  for (int t = 0; t < ticks(seconds); ++t) game->step(input);
}

// Somebody who presses anything.
class RandomPlayer {
 public:
  explicit RandomPlayer(std::uint64_t seed) : random_(seed) {}
  GameInput next() {
    if (left_-- <= 0) {
      left_ = random_index(&random_, 60);
      input_.move = {random_part(&random_) * 2 - 1, random_part(&random_) * 2 - 1};
      input_.fire = random_index(&random_, 3) != 0;
      input_.act = random_index(&random_, 8) == 0;
      input_.dial = random_part(&random_) * 2 - 1;
      input_.camera_from_plane.reset();
      if (random_index(&random_, 10) != 0)
        input_.camera_from_plane = looking_at(random_part(&random_) * 2 - 1, random_part(&random_) * 2 - 1);
    }
    return input_;
  }

 private:
  std::uint64_t random_;
  int left_ = 0;
  GameInput input_;
};

}  // namespace parallax::swarm
