// The arithmetic of Swarm: aim, damage, points, combos, pick-ups and waves.
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "tests/games/swarm_fixture.h"

namespace parallax::swarm {
namespace {

using Eigen::Vector2d;

int size_of(const std::array<int, kKinds>& wave) { return std::accumulate(wave.begin(), wave.end(), 0); }

TEST(SwarmRules, WavesGrowAndBringNewKindsInTurn) {
  for (const GameDifficulty difficulty : {GameDifficulty::easy, GameDifficulty::normal, GameDifficulty::hard}) {
    int before = 0;
    for (int number = 1; number <= 300; ++number) {
      const auto wave = wave_of(number, difficulty, 1);
      const int size = size_of(wave);
      if (before < kMostInWave)
        EXPECT_GT(size, before);
      else
        EXPECT_EQ(size, kMostInWave);
      before = size;
      for (int k = 0; k < kKinds; ++k)
        EXPECT_EQ(wave[static_cast<std::size_t>(k)] > 0, number >= rules_of(static_cast<CritterKind>(k)).first_wave)
            << "kind " << k << " in wave " << number;
      EXPECT_EQ(size_of(wave_of(number, difficulty, 2)), std::min(2 * size, kMostInWave));
    }
  }
  for (int number = 1; number < 50; ++number) {
    EXPECT_LT(size_of(wave_of(number, GameDifficulty::easy, 1)), size_of(wave_of(number, GameDifficulty::normal, 1)));
    EXPECT_LT(size_of(wave_of(number, GameDifficulty::normal, 1)), size_of(wave_of(number, GameDifficulty::hard, 1)));
  }
  EXPECT_EQ(size_of(wave_of(1, GameDifficulty::normal, 1)), 6);
  EXPECT_EQ(size_of(wave_of(11, GameDifficulty::normal, 1)), 36);
}

TEST(SwarmRules, MultiplierIsOneMoreForEveryFourKills) {
  EXPECT_EQ(multiplier(0), 1);
  EXPECT_EQ(multiplier(3), 1);
  EXPECT_EQ(multiplier(4), 2);
  EXPECT_EQ(multiplier(11), 3);
  EXPECT_EQ(multiplier(28), 8);
  EXPECT_EQ(multiplier(5000), 8);
}

TEST(SwarmRules, ReticleIsWhereTheOpticalAxisMeetsThePlane) {
  GameOptions hard;
  hard.difficulty = GameDifficulty::hard;  // without aim assist
  Simulation game = quiet_game(empty_field(kRadius_m), hard);
  GameInput input = aiming_at(0.37, -0.21, true);
  game.step(input);
  EXPECT_LT((game.state().robot.reticle - Vector2d(0.37, -0.21)).norm(), 1e-9);
  ASSERT_EQ(game.state().bolts.size(), 1u);
  EXPECT_LT((game.state().bolts[0].direction - Vector2d(0.37, -0.21).normalized()).norm(), 1e-9);
  // Lost, or looking over the horizon: it stays.
  input.camera_from_plane.reset();
  game.step(input);
  EXPECT_LT((game.state().robot.reticle - Vector2d(0.37, -0.21)).norm(), 1e-9);
  input.camera_from_plane = looking({0, -0.5, 0.4}, {0, 0, 0.6});
  game.step(input);
  EXPECT_LT((game.state().robot.reticle - Vector2d(0.37, -0.21)).norm(), 1e-9);
}

TEST(SwarmRules, TheRobotMovesAsThePlayerSeesTheTable) {
  const auto moved = [](const Eigen::Vector3d& eye, const Vector2d& keys) {
    Simulation game = quiet_game();
    GameInput input;
    input.camera_from_plane = looking(eye, {0.01, 0.02, 0});
    input.move = keys;
    run(&game, input, 1);
    return game.state().robot.position;
  };
  const Vector2d right = moved({0.01, -0.5, 0.4}, {1, 0}), away = moved({0.01, -0.5, 0.4}, {0, 1});
  EXPECT_NEAR(right.x(), kRobotSpeed * (1 - 1 / kRobotAgility), 0.03);
  EXPECT_NEAR(right.y(), 0, 1e-9);
  EXPECT_NEAR(away.y(), right.x(), 1e-9);
  // From the other side of the table the same key goes the other way; from the right, to the front.
  EXPECT_NEAR(moved({0.01, 0.5, 0.4}, {1, 0}).x(), -right.x(), 1e-9);
  EXPECT_NEAR(moved({0.5, 0.02, 0.4}, {1, 0}).y(), right.x(), 1e-9);
  EXPECT_NEAR(moved({0.5, 0.02, 0.4}, {0, 1}).x(), -right.x(), 1e-9);
  // Both keys are not faster.
  EXPECT_NEAR(moved({0.01, -0.5, 0.4}, {1, 1}).norm(), right.x(), 1e-9);
}

TEST(SwarmRules, BoltsTakeHealthAndKillsGivePoints) {
  Simulation game = quiet_game();
  add(&game, CritterKind::spitter, {0.7, 0});
  run(&game, aiming_at(0.7, 0, true), 0.3);
  ASSERT_EQ(game.state().critters.size(), 1u);
  EXPECT_EQ(game.state().critters[0].health, rules_of(CritterKind::spitter).health - kBoltDamage);
  EXPECT_EQ(game.state().hits, 1);
  EXPECT_EQ(game.state().score, 0);
  run(&game, aiming_at(0.7, 0, true), 0.6);
  EXPECT_TRUE(game.state().critters.empty());
  EXPECT_EQ(game.state().hits, 3);
  EXPECT_EQ(game.state().score, rules_of(CritterKind::spitter).points);
  EXPECT_EQ(game.state().kills, 1);
}

TEST(SwarmRules, QuickKillsMultiplyAndTheWaveGivesABonus) {
  Simulation game = quiet_game();
  game.edit_state().wave.to_release = {0, 0, 0, 0};
  for (int i = 0; i < 5; ++i) add(&game, CritterKind::swarmer, {0.45 + 0.12 * i, 0});
  int chain = 0;
  for (int t = 0; t < ticks(2.2) && !game.state().critters.empty(); ++t) {
    game.step(aiming_at(0.5, 0, true));
    EXPECT_GE(game.state().chain, chain);
    chain = game.state().chain;
  }
  EXPECT_TRUE(game.state().critters.empty());
  EXPECT_EQ(game.state().chain, 5);
  EXPECT_EQ(game.state().score, 10 + 10 + 10 + 2 * 10 + 2 * 10 + kWaveBonus * 1);
  EXPECT_EQ(game.state().wave.number, 2);
  run(&game, aiming_at(0.5, 0), kChainTicks * kGameTick_s + 0.01);
  EXPECT_EQ(game.state().chain, 0);
  EXPECT_EQ(game.state().best_chain, 5);
}

TEST(SwarmRules, BitesHurtByDifficultyAndEndTheCombo) {
  const std::array<int, 3> damage{3, 5, 8};
  for (int d = 0; d < 3; ++d) {
    GameOptions options;
    options.difficulty = static_cast<GameDifficulty>(d);
    Simulation game = quiet_game(empty_field(kRadius_m), options);
    game.edit_state().chain = 9;
    game.edit_state().chain_ticks = ticks(2);
    for (const double angle : {0.0, 2.0, 4.0})
      add(&game, CritterKind::swarmer, 0.1 * Vector2d(std::cos(angle), std::sin(angle)));
    game.step(aiming_at(0.9, 0));
    // Three bites at once are one hit: the grace after it.
    EXPECT_EQ(game.state().robot.health, kFullHealth - damage[static_cast<std::size_t>(d)]);
    EXPECT_EQ(game.state().chain, 0);
    EXPECT_EQ(game.state().robot.hurt_ticks, kGrace - 1);
  }
}

TEST(SwarmRules, PickUpsDoWhatTheySay) {
  const auto after = [](PickupKind kind) {
    Simulation game = quiet_game();
    game.edit_state().robot.health = 50;
    game.edit_state().robot.bombs = 1;
    game.edit_state().pickups.push_back({kind, {0.05, 0}, 500});
    game.step(aiming_at(0.5, 0));
    EXPECT_TRUE(game.state().pickups.empty());
    return game;
  };
  EXPECT_EQ(after(PickupKind::heal).state().robot.health, 50 + kHeal);
  EXPECT_EQ(after(PickupKind::bomb).state().robot.bombs, 2);

  Simulation rapid = after(PickupKind::rapid), plain = after(PickupKind::heal);
  run(&rapid, aiming_at(0.5, 0, true), 2);
  run(&plain, aiming_at(0.5, 0, true), 2);
  EXPECT_EQ(rapid.state().shots, 20);  // every 0.1 s
  EXPECT_EQ(plain.state().shots, 10);  // every 0.22 s (26 ticks)

  Simulation shield = after(PickupKind::shield);
  add(&shield, CritterKind::swarmer, {-0.1, 0});
  run(&shield, aiming_at(0.9, 0), kShieldTicks * kGameTick_s - 0.1);
  EXPECT_EQ(shield.state().robot.health, 50);
  run(&shield, aiming_at(0.9, 0), 2);
  EXPECT_LT(shield.state().robot.health, 50);

  Simulation game = quiet_game();
  game.edit_state().pickups.push_back({PickupKind::heal, {0.8, 0}, 100});
  game.edit_state().robot.health = 90;
  run(&game, aiming_at(0.5, 0), 1);
  EXPECT_TRUE(game.state().pickups.empty()) << "it does not lie there for ever";
  EXPECT_EQ(game.state().robot.health, 90);
}

TEST(SwarmRules, ABombReachesItsRadiusOncePerPress) {
  Simulation game = quiet_game();
  game.edit_state().robot.bombs = 2;
  add(&game, CritterKind::swarmer, {0.3, 0});
  add(&game, CritterKind::spitter, {0, -0.5});
  add(&game, CritterKind::swarmer, {0, kBombRadius + 0.05});
  GameInput input = aiming_at(0.9, 0);
  input.act = true;
  run(&game, input, 0.1);
  EXPECT_EQ(game.state().robot.bombs, 1) << "held down is one press";
  ASSERT_EQ(game.state().critters.size(), 1u);
  EXPECT_GT(game.state().critters[0].position.y(), kBombRadius - 0.01);
  EXPECT_EQ(game.state().score, 10 + 40);
}

TEST(SwarmRules, SeatedAimsAllRoundWithoutMovingTheCamera) {
  // A ring of critters that stand still for the test; the camera looks at one place all the time.
  const auto kills = [](bool seated) {
    GameOptions options;
    options.seated = seated;
    options.difficulty = GameDifficulty::hard;
    Simulation game = quiet_game(empty_field(kRadius_m), options);
    for (int k = 0; k < 6; ++k) {
      const double angle = k * std::acos(-1.0) / 3;
      add(&game, CritterKind::swarmer, 0.6 * Vector2d(std::cos(angle), std::sin(angle)));
    }
    for (int t = 0; t < ticks(6); ++t) {
      game.edit_state().robot.health = kFullHealth;
      GameInput input = play_patiently(game.state(), game.ground(), looking_at(0.5, 0.1));
      input.move = Vector2d::Zero();
      game.step(input);
    }
    return game.state().kills;
  };
  EXPECT_EQ(kills(true), 6);
  EXPECT_LE(kills(false), 3);
}

TEST(SwarmRules, AimAssistDrawsTheReticleOntoWhoIsNearIt) {
  Simulation game = quiet_game();
  game.set("aim_assist", 1);
  add(&game, CritterKind::swarmer, {0.6, 0.2});
  game.step(aiming_at(0.6, 0));
  EXPECT_LT((game.state().robot.reticle - Vector2d(0.6, 0.2)).norm(), 0.1);
  game.set("aim_assist", -3);  // clamped
  EXPECT_EQ(game.state().aim_assist, 0);
  game.set("aim_assist", std::nan(""));
  game.set("no such setting", 1);
  EXPECT_EQ(game.state().aim_assist, 0);
  game.step(aiming_at(0.6, 0));
  EXPECT_LT((game.state().robot.reticle - Vector2d(0.6, 0)).norm(), 1e-9);
}

}  // namespace
}  // namespace parallax::swarm
