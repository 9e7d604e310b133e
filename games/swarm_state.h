// The state of a game of Swarm, as plain data: everything that has an effect on what comes, and nothing else.
//
// Frame: the plane's (z up, the table is z = 0). The unit of length is the field's radius as it was when the wave
// began, so that a map that is scaled scales the game with it, and one that grows moves nothing. Times are ticks of
// kGameTick_s, speeds units a second. Directions and headings are in the plane, radians, counter-clockwise from x.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "games/game.h"

namespace parallax::swarm {

inline constexpr int kKinds = 4;
inline constexpr double kLeastUnitShare = 0.1;  // of the field's radius: a table that grows beyond this moves things
enum class CritterKind { swarmer, flanker, jumper, spitter };
enum class CritterPhase { climbing, walking, charging, crouching, leaping };

struct Critter {
  CritterKind kind = CritterKind::swarmer;
  CritterPhase phase = CritterPhase::climbing;
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  Eigen::Vector2d velocity = Eigen::Vector2d::Zero();
  double height = 0, rise = 0;  // of its feet, and how fast that grows
  double heading = 0;
  double walked = 0;  // the way its feet have gone: moves its legs
  int health = 1, full_health = 1;
  int phase_ticks = 0;  // since the phase began
  int rest_ticks = 0;   // until it can bite, leap or spit again
  int hurt_ticks = 0;   // for how long it still shows that it was hit
  int side = 1;         // the way round it prefers, 1 or -1
};

struct Bolt {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  Eigen::Vector2d direction = Eigen::Vector2d::UnitX();
  int ticks_left = 0;
};

struct Spit {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  Eigen::Vector2d velocity = Eigen::Vector2d::Zero();
  double height = 0, rise = 0;
};

enum class PickupKind { heal, rapid, shield, bomb };
struct Pickup {
  PickupKind kind = PickupKind::heal;
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  int ticks_left = 0;
};

struct Robot {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  Eigen::Vector2d velocity = Eigen::Vector2d::Zero();
  double heading = 0;
  double rolled = 0;                                   // the way its wheels have gone
  Eigen::Vector2d aim = Eigen::Vector2d::UnitX();      // unit length: where a bolt would go
  Eigen::Vector2d right = Eigen::Vector2d::UnitX();    // unit length: to the right as the player sees the table
  Eigen::Vector2d sight = Eigen::Vector2d::UnitX();    // where the camera's optical axis meets the plane
  Eigen::Vector2d reticle = Eigen::Vector2d::UnitX();  // where it shoots: the sight, steered and assisted
  double steer = 0;                                    // angle by which the dial has turned the reticle (seated)
  int health = 100;
  int reload_ticks = 0, rapid_ticks = 0, shield_ticks = 0, hurt_ticks = 0;
  int bombs = 0;
  bool act_was_down = false;
};

struct Wave {
  int number = 1;
  int pause_ticks = 0;  // until it begins
  int ticks = 0;        // since it began
  int release_ticks = 0;
  std::array<int, kKinds> to_release{};
  std::array<double, 3> gates{};  // directions from which it comes
};

struct State {
  GameDifficulty difficulty = GameDifficulty::normal;
  bool seated = false;
  bool colour_blind_safe = true;
  double horde = 1, aim_assist = 0;  // settings
  double unit_share = 1;             // the unit of length, in radii of the field as it is now
  std::uint64_t random = 0;
  std::int64_t tick = 0;
  std::int64_t score = 0;
  int kills = 0, shots = 0, hits = 0;
  int chain = 0, chain_ticks = 0, best_chain = 0;  // kills in quick succession
  bool over = false;
  Eigen::Vector2d home = Eigen::Vector2d::Zero();  // where the robot began: a plate on the table
  Robot robot;
  Wave wave;
  std::vector<Critter> critters;
  std::vector<Bolt> bolts;
  std::vector<Spit> spits;
  std::vector<Pickup> pickups;
};

// The next number of a generator whose whole state is one number (SplitMix64: Steele, Lea and Flood 2014).
inline std::uint64_t next_random(std::uint64_t* state) {
  std::uint64_t z = (*state += 0x9E3779B97F4A7C15ull);
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
  return z ^ (z >> 31);
}
// In [0, 1).
inline double random_part(std::uint64_t* state) {
  return static_cast<double>(next_random(state) >> 11) * (1.0 / 9007199254740992.0);
}
// In 0 .. count - 1.
inline int random_index(std::uint64_t* state, int count) {
  return static_cast<int>(random_part(state) * static_cast<double>(count));
}

}  // namespace parallax::swarm
