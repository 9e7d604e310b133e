// The numbers of Swarm: sizes, speeds, damage, points, waves. Lengths are in units of the field's radius, times in
// ticks unless the name says otherwise.
#pragma once

#include <array>

#include "games/swarm_state.h"

namespace parallax::swarm {

// Bounds: nothing grows beyond these.
inline constexpr int kMostCritters = 200;
inline constexpr int kMostBolts = 64;
inline constexpr int kMostSpits = 64;
inline constexpr int kMostPickups = 8;
inline constexpr int kMostInWave = 400;

constexpr int ticks(double seconds) { return static_cast<int>(seconds * kGameTicksPerSecond + 0.5); }

// The robot.
inline constexpr int kFullHealth = 100;
inline constexpr double kRobotLength = 0.13;
inline constexpr double kRobotSpeed = 0.55;
inline constexpr double kRobotAgility = 14;  // of the difference to the wanted speed, a second
inline constexpr double kRobotRadius = 0.055;
inline constexpr int kReload = ticks(0.22);
inline constexpr int kRapidReload = ticks(0.10);
inline constexpr int kGrace = ticks(0.25);  // after a hit the next one does nothing for so long
inline constexpr double kBoltSpeed = 3.0;
inline constexpr double kBoltHeight = 0.045;
inline constexpr int kBoltLife = ticks(0.9);
inline constexpr int kBoltDamage = 10;
inline constexpr double kSteerSpeed = 3.0;      // radians a second with the dial fully turned
inline constexpr double kSeatedAssist = 0.35;   // added to the radius of aim assist when seated
inline constexpr double kSettingAssist = 0.35;  // the same for the setting at its most

// Pick-ups.
inline constexpr int kPickupLife = ticks(14);
inline constexpr double kPickupReach = 0.11;
inline constexpr int kHeal = 30;
inline constexpr int kRapidTicks = ticks(8);
inline constexpr int kShieldTicks = ticks(7);
inline constexpr int kMostBombs = 3;
inline constexpr int kBombDamage = 60;
inline constexpr double kBombRadius = 0.55;

// Critters.
inline constexpr double kCritterLength = 0.08;
inline constexpr double kCritterRadius = 0.04;
inline constexpr int kClimb = ticks(0.9);
inline constexpr double kClimbDepth = 0.1;   // below the edge, where it starts
inline constexpr double kClimbReach = 0.05;  // outside the edge
inline constexpr double kBiteReach = 0.115;
inline constexpr int kBiteRest = ticks(0.8);
inline constexpr double kFlankRing = 0.5;        // the distance at which a flanker goes round
inline constexpr double kFlankAngle = 1.8;       // off the line of fire, from where it charges (103 degrees)
inline constexpr int kFlankPatience = ticks(7);  // and then it charges from wherever it is
inline constexpr double kLeapFrom = 0.5;
inline constexpr int kCrouch = ticks(0.35);
inline constexpr int kLeap = ticks(0.55);
inline constexpr double kLeapHeight = 0.16;
inline constexpr int kLeapRest = ticks(1.3);
inline constexpr double kSpitNear = 0.6, kSpitFar = 0.8;  // a spitter keeps between these
inline constexpr double kSpitReach = 1.1;
inline constexpr double kSpitSpeed = 0.9, kSpitGravity = 1.5, kSpitHeight = 0.05, kSpitSplash = 0.1;
inline constexpr int kSpitRest = ticks(2.2);

// A wave that lasts makes the critters frantic: faster, harder, bolder; so that it ends.
inline constexpr int kFrenzyAfter = ticks(45);
inline constexpr int kFrenzyFull = ticks(60);  // from the one to the other

// Combos: a kill within kChainTicks of the last one lengthens the chain; being hurt ends it.
inline constexpr int kChainTicks = ticks(2.5);
inline constexpr int kChainStep = 4;  // kills for each step of the multiplier
inline constexpr int kMostMultiplier = 8;

inline constexpr int kWavePause = ticks(3);
inline constexpr int kWaveBonus = 50;  // times the wave's number
inline constexpr int kWaveHeal = 5;

struct KindRules {
  const char* model;  // of assets/models
  const char* name;   // in this world, plural
  int health;
  int damage;
  int points;
  double speed;
  int first_wave;
};
const KindRules& rules_of(CritterKind kind);

struct DifficultyRules {
  double speed = 1, damage = 1;
  int first_wave_size = 6, growth = 3;
  double pickup_chance = 0.12;  // of a kill
  double assist = 0;            // radius about the sight within which the nearest critter is aimed at
  int bombs = 0;                // at the start
  double release_s = 0.6;       // between two critters, in the first wave
};
const DifficultyRules& rules_of(GameDifficulty difficulty);

int multiplier(int chain);
// How many of each kind wave `number` (from 1) has; never fewer than the one before. `horde` multiplies.
std::array<int, kKinds> wave_of(int number, GameDifficulty difficulty, double horde);
int release_interval(int number, GameDifficulty difficulty);
double wave_speed(int number);  // factor on the critters' speed
int wave_health(int number, CritterKind kind);
// 0 calm .. 2 frantic.
double frenzy(const Wave& wave);

}  // namespace parallax::swarm
