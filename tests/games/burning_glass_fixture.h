// What the tests of the burning glass share: a game under the sun overhead, cameras, and how much is charred.
#pragma once

#include <cmath>
#include <cstdint>

#include "games/burning_glass.h"
#include "games/burning_glass_noise.h"

namespace parallax::glass_test {

inline constexpr double kRadius_m = 0.2;  // of the table

inline RigidTransform look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  const Eigen::Vector3d z = (target - eye).normalized();
  const Eigen::Vector3d x =
      z.cross(std::abs(z.y()) > 0.9 ? Eigen::Vector3d::UnitX().eval() : Eigen::Vector3d::UnitY().eval()).normalized();
  Eigen::Matrix3d R;
  R.row(0) = x;
  R.row(1) = z.cross(x);
  R.row(2) = z;
  return {R, -R * eye};
}

// The sun overhead.
inline GameOptions options_of(int material, std::uint64_t seed = 1) {
  GameOptions options;
  options.seed = seed;
  options.settings = {{"sun_elevation", 90}, {"sun_azimuth", -90}, {"material", material}};
  return options;
}

inline GameInput above(double x, double y, double height) {
  GameInput input;
  input.camera_from_plane = look_at({x, y, height}, {x, y, 0});
  return input;
}

inline void play(BurningGlass* game, const GameInput& input, double seconds) {
  const int ticks = static_cast<int>(std::lround(seconds * kGameTicksPerSecond));
  for (int i = 0; i < ticks; ++i) game->step(input);
}

inline double char_sum(const BurningGlass& game) {
  double sum = 0;
  for (const std::uint16_t value : game.sheet().charred()) sum += value;
  return sum / burning::kFullChar;
}

inline double char_at(const BurningGlass& game, double x, double y) {
  const Eigen::Vector2d cell = game.grid().cell_at({x, y});
  return game.sheet().charred()[burning::SheetGrid::index(static_cast<int>(std::lround(cell.x())),
                                                          static_cast<int>(std::lround(cell.y())))] /
         static_cast<double>(burning::kFullChar);
}

inline GameInput random_input(burning::Generator* generator, const GameInput& last) {
  GameInput input = last;
  if (generator->uniform() < 0.02) {
    input.move = {generator->uniform(-1, 1), generator->uniform(-1, 1)};
    input.dial = generator->uniform(-1, 1);
    input.fire = generator->uniform() < 0.2;
    input.act = generator->uniform() < 0.15;
  }
  if (generator->uniform() < 0.03) {
    input.camera_from_plane.reset();
    if (generator->uniform() < 0.9) {
      const Eigen::Vector3d at(generator->uniform(-0.2, 0.2), generator->uniform(-0.2, 0.2), 0);
      const Eigen::Vector3d eye = at + Eigen::Vector3d(generator->uniform(-0.2, 0.2), generator->uniform(-0.2, 0.2),
                                                       generator->uniform(-0.05, 0.5));
      input.camera_from_plane = look_at(eye, at);
    }
  }
  return input;
}

}  // namespace parallax::glass_test
