// The whole state of a game of Marbles, as it is saved: all that has an effect on what comes, but for the table itself.
// Units: the marble's diameter, seconds, ticks. A value.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "games/game.h"
#include "games/marbles_level.h"
#include "games/marbles_physics.h"

namespace parallax {

enum class MarblesControl { camera, keys };
enum class MarblesPhase { ready, playing, done, over };
// What is shown for a while in the middle.
enum class MarblesNews { none, level, lost, time_up, put_back, no_room, done, over };

inline constexpr int kMarblesMostLoose = 6;
inline constexpr int kMarblesMostCoins = 16;
inline constexpr int kMarblesMostRamps = 4;

struct MarblesState {
  std::uint64_t seed = 1;
  GameDifficulty difficulty = GameDifficulty::normal;
  bool seated = false, colour_blind_safe = true;
  // Settings.
  MarblesControl control = MarblesControl::camera;
  double sensitivity = 1;
  int loose_marbles = 2;
  bool outlines = true;

  double unit_m = 0.2 / kMarblesFieldRadius;  // a marble's diameter in metres of the map
  bool with_obstacles = true;                 // false: there was no room between them

  MarblesPhase phase = MarblesPhase::ready;
  MarblesNews news = MarblesNews::none;
  int news_ticks = 0;   // left
  int phase_ticks = 0;  // since it began
  int level_number = 1, lives = 3;
  std::int64_t score = 0;
  int ticks_left = 0;
  MarblesLevel level;

  std::vector<MarbleMotion> marbles;                   // the player's first
  int respawn_ticks = 0;                               // the player's marble is away for so long yet
  int trapped_ticks = 0;                               // it has been where nothing can be reached
  Eigen::Vector2f tilt = Eigen::Vector2f::Zero();      // sine of the tilt, towards where marbles roll
  Eigen::Vector2f heading = Eigen::Vector2f::UnitX();  // what the viewer calls right, on the table
  std::optional<Eigen::Vector2f> level_attitude;       // the camera's roll and pitch that count as level
  int keys_ticks = 0;                                  // the keys keep the table for so long yet
  int charge_ticks = 0;                                // fire has been held
};

// JSON text and back. marbles_from_text() throws InputError, one line, when the text is not a state.
std::string marbles_to_text(const MarblesState& state);
MarblesState marbles_from_text(const std::string& text);

}  // namespace parallax
