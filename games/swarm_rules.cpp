#include "games/swarm_rules.h"

#include <algorithm>
#include <cmath>

namespace parallax::swarm {

const KindRules& rules_of(CritterKind kind) {
  static const std::array<KindRules, kKinds> rules{{
      {"swarmer", "Nippers", 10, 5, 10, 0.24, 1},
      {"flanker", "Sidlers", 20, 8, 20, 0.27, 2},
      {"jumper", "Hoppets", 20, 12, 30, 0.20, 3},
      {"spitter", "Dribblers", 30, 10, 40, 0.18, 4},
  }};
  return rules[static_cast<std::size_t>(kind)];
}

const DifficultyRules& rules_of(GameDifficulty difficulty) {
  static const std::array<DifficultyRules, 3> rules{{
      {0.8, 0.6, 5, 2, 0.18, 0.10, 2, 0.8},
      {1.0, 1.0, 6, 3, 0.12, 0.05, 1, 0.6},
      {1.2, 1.5, 8, 4, 0.08, 0.0, 0, 0.45},
  }};
  return rules[static_cast<std::size_t>(difficulty)];
}

int multiplier(int chain) { return std::clamp(1 + chain / kChainStep, 1, kMostMultiplier); }

std::array<int, kKinds> wave_of(int number, GameDifficulty difficulty, double horde) {
  const DifficultyRules& rules = rules_of(difficulty);
  const double plain = rules.first_wave_size + static_cast<double>(rules.growth) * (number - 1);
  const int all = std::clamp(static_cast<int>(std::lround(plain * horde)), 1, kMostInWave);
  // Of the kinds that have come: the later ones a share that grows to a fifth each, swarmers the rest.
  std::array<int, kKinds> count{};
  int others = 0;
  for (int k = 1; k < kKinds; ++k) {
    const int first = rules_of(static_cast<CritterKind>(k)).first_wave;
    if (number < first) continue;
    const double share = std::min(0.2, 0.12 + 0.02 * (number - first));
    count[static_cast<std::size_t>(k)] = std::max(1, static_cast<int>(all * share));
    others += count[static_cast<std::size_t>(k)];
  }
  count[0] = std::max(all - others, 1);
  return count;
}

int release_interval(int number, GameDifficulty difficulty) {
  const double first = rules_of(difficulty).release_s;
  return std::max(ticks(first * std::pow(0.93, number - 1)), ticks(0.08));
}

double wave_speed(int number) { return std::min(1 + 0.03 * (number - 1), 1.6); }

int wave_health(int number, CritterKind kind) {
  return rules_of(kind).health + kBoltDamage * std::min((number - 1) / 8, 3);
}

double frenzy(const Wave& wave) {
  return std::clamp(static_cast<double>(wave.ticks - kFrenzyAfter) / kFrenzyFull, 0.0, 2.0);
}

}  // namespace parallax::swarm
