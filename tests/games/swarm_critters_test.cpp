// How each kind of critter behaves, and that real things stand in everybody's way.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/games/swarm_fixture.h"

namespace parallax::swarm {
namespace {

using Eigen::Vector2d;

double angle_off_aim(const Simulation& game) {
  const Robot& robot = game.state().robot;
  const Vector2d to_critter = (game.state().critters[0].position - robot.position).normalized();
  return std::acos(std::clamp(robot.aim.dot(to_critter), -1.0, 1.0));
}

// The angle off the line of fire at which the first critter bites for the first time.
double angle_of_bite(CritterKind kind) {
  Simulation game = quiet_game();
  add(&game, kind, {0.9, 0.02});
  for (int t = 0; t < ticks(15); ++t) {
    game.step(aiming_at(0.9, 0));
    if (game.state().robot.health < kFullHealth) return angle_off_aim(game);
  }
  ADD_FAILURE() << "never bitten";
  return 0;
}

TEST(SwarmCritters, SwarmersComeStraightAndFlankersFromBehind) {
  EXPECT_LT(angle_of_bite(CritterKind::swarmer), 0.3);
  EXPECT_GT(angle_of_bite(CritterKind::flanker), 1.6);
}

TEST(SwarmCritters, SwarmersKeepTogetherAndApart) {
  Simulation game = quiet_game();
  for (int k = 0; k < 5; ++k) add(&game, CritterKind::swarmer, {0.95, -0.3 + 0.15 * k});
  const auto width = [&] {
    double low = 1, high = -1;
    for (const Critter& critter : game.state().critters) {
      // As seen from the robot, so that coming nearer alone changes nothing.
      const double angle = std::atan2(critter.position.y(), critter.position.x());
      low = std::min(low, angle);
      high = std::max(high, angle);
    }
    return high - low;
  };
  const double before = width();
  run(&game, aiming_at(0, 0.9), 1.5);
  EXPECT_LT(width(), before - 0.05) << "a flock draws together";
  for (std::size_t a = 0; a < 5; ++a)
    for (std::size_t b = 0; b < a; ++b)
      EXPECT_GT((game.state().critters[a].position - game.state().critters[b].position).norm(), 0.03);

  // In the very same place they come apart.
  Simulation heap = quiet_game();
  for (int k = 0; k < 10; ++k) add(&heap, CritterKind::swarmer, {0.95, 0});
  run(&heap, aiming_at(0, 0.9), 1.5);
  for (std::size_t a = 0; a < 10; ++a)
    for (std::size_t b = 0; b < a; ++b)
      EXPECT_GT((heap.state().critters[a].position - heap.state().critters[b].position).norm(), 0.02);
}

TEST(SwarmCritters, JumpersLeapOverBoltsAndLandOnTheRobot) {
  Simulation game = quiet_game();
  add(&game, CritterKind::jumper, {0.6, 0});
  double highest = 0, hurt_height = -1;
  int leaping = 0;
  for (int t = 0; t < ticks(4) && hurt_height < 0; ++t) {
    game.step(aiming_at(0, 0.9));
    const Critter& critter = game.state().critters[0];
    EXPECT_EQ(critter.height > 0, critter.phase == CritterPhase::leaping && critter.height != 0);
    highest = std::max(highest, critter.height);
    leaping += critter.phase == CritterPhase::leaping ? 1 : 0;
    if (game.state().robot.health < kFullHealth) hurt_height = critter.height;
  }
  EXPECT_NEAR(highest, kLeapHeight, 0.01);
  EXPECT_NEAR(leaping, kLeap, 3);
  EXPECT_EQ(hurt_height, 0);
  EXPECT_EQ(game.state().robot.health, kFullHealth - rules_of(CritterKind::jumper).damage);

  // A bolt under one at the top of its leap goes on; the same one on the ground is hit.
  for (const bool high : {true, false}) {
    Simulation shot = quiet_game();
    Critter& jumper = add(&shot, CritterKind::jumper, {0.3, 0});
    jumper.phase = CritterPhase::leaping;
    jumper.height = high ? kLeapHeight : 0.01;
    jumper.rise = high ? 1.0 : 0.1;
    run(&shot, aiming_at(0.9, 0, true), 0.12);
    EXPECT_EQ(shot.state().hits, high ? 0 : 1);
  }
}

TEST(SwarmCritters, SpittersKeepTheirDistanceAndSpit) {
  for (const double start : {0.2, 0.95}) {
    Simulation game = quiet_game();
    add(&game, CritterKind::spitter, {start, 0});
    run(&game, aiming_at(0, 0.9), 4);
    double nearest = 9, farthest = 0;
    std::size_t spits = 0;
    for (int t = 0; t < ticks(10); ++t) {
      game.step(aiming_at(0, 0.9));
      const double distance = game.state().critters[0].position.norm();
      nearest = std::min(nearest, distance);
      farthest = std::max(farthest, distance);
      spits = std::max(spits, game.state().spits.size());
      EXPECT_EQ(game.state().critters[0].height, 0);
    }
    EXPECT_GT(nearest, kSpitNear - 0.06);
    EXPECT_LT(farthest, kSpitFar + 0.06);
    EXPECT_EQ(spits, 1u);
    EXPECT_LE(game.state().robot.health, kFullHealth - 4 * rules_of(CritterKind::spitter).damage);
  }
}

TEST(SwarmCritters, WhoMovesIsNotHitBySpit) {
  Simulation game = quiet_game();
  add(&game, CritterKind::spitter, {0.7, 0});
  for (int t = 0; t < ticks(12); ++t) {
    GameInput input = aiming_at(0, 0.9);
    input.move.y() = (t / ticks(1.2)) % 2 == 0 ? 1 : -1;
    game.step(input);
  }
  EXPECT_GE(game.state().robot.health, kFullHealth - 2 * rules_of(CritterKind::spitter).damage);
}

TEST(SwarmCritters, TheyClimbInOverTheEdge) {
  GameOptions options;
  options.seed = 7;
  Simulation game;
  game.start(empty_field(kRadius_m), options);
  bool seen = false;
  for (int t = 0; t < ticks(6); ++t) {
    game.step(aiming_at(0.5, 0));
    for (const Critter& critter : game.state().critters) {
      if (critter.phase != CritterPhase::climbing) continue;
      seen = true;
      EXPECT_GE(critter.position.lpNorm<Eigen::Infinity>(), 0.9) << "at the edge";
      EXPECT_LE(critter.height, 0);
      EXPECT_GE(critter.height, -kClimbDepth);
    }
  }
  EXPECT_TRUE(seen);
}

// A wall between, and a hook that would catch whoever goes straight for the robot.
PlayingField hooked_table() {
  return table_with({{0.3, 0.4, -0.5, 0.5}, {0.4, 0.7, 0.4, 0.5}, {0.4, 0.7, -0.5, -0.4}, {-0.6, -0.4, 0.2, 0.45}});
}

TEST(SwarmCritters, EveryKindFindsTheWayRoundThings) {
  for (int k = 0; k < kKinds; ++k) {
    Simulation game = quiet_game(hooked_table());
    add(&game, static_cast<CritterKind>(k), {0.55, 0});
    int t = 0;
    for (; t < ticks(25) && game.state().robot.health == kFullHealth; ++t) game.step(aiming_at(0, -0.9));
    EXPECT_LT(game.state().robot.health, kFullHealth) << rules_of(static_cast<CritterKind>(k)).name;
  }
}

TEST(SwarmCritters, ThingsStopBolts) {
  for (const bool wall : {true, false}) {
    Simulation game = quiet_game(wall ? hooked_table() : empty_field(kRadius_m));
    add(&game, CritterKind::spitter, {0.55, 0});
    run(&game, aiming_at(0.9, 0, true), 0.3);
    EXPECT_EQ(game.state().hits, wall ? 0 : 1);
  }
}

TEST(SwarmCritters, NobodyEntersThings) {
  const PlayingField field = hooked_table();
  const double limit_m = Ground::kObstacleHeight * kRadius_m;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    GameOptions options;
    options.seed = seed;
    Simulation game;
    game.start(field, options);
    game.edit_state().wave.number = 12;
    RandomPlayer player(seed);
    for (int t = 0; t < ticks(60) && !game.state().over; ++t) {
      game.edit_state().robot.health = kFullHealth;
      game.step(player.next());
      const auto height = [&](const Vector2d& at) { return field.surface->height_at(at * kRadius_m); };
      ASSERT_LE(height(game.state().robot.position), limit_m);
      ASSERT_TRUE(inside_outline(field, game.state().robot.position * kRadius_m));
      for (const Critter& critter : game.state().critters) {
        ASSERT_LE(height(critter.position), limit_m) << rules_of(critter.kind).name;
        ASSERT_TRUE(critter.phase == CritterPhase::climbing || inside_outline(field, critter.position * kRadius_m))
            << rules_of(critter.kind).name;
      }
      for (const Pickup& pickup : game.state().pickups) ASSERT_LE(height(pickup.position), limit_m);
    }
  }
}

TEST(SwarmGround, WaysLeadToTheGoalFromEverywhere) {
  Ground ground;
  ground.rebuild(hooked_table());
  const Vector2d goal(0.55, 0.1);
  ASSERT_TRUE(ground.walkable(goal));
  ground.set_goal(goal);
  int walkable = 0;
  for (double x = -0.975; x < 1; x += 0.05)
    for (double y = -0.975; y < 1; y += 0.05) {
      Vector2d at(x, y);
      if (!ground.walkable(at)) continue;
      ++walkable;
      double walked = 0;
      while ((at - goal).norm() > 0.03 && walked < 8) {
        at = ground.slide(at, at + 0.01 * ground.way_from(at));
        walked += 0.01;
      }
      EXPECT_LT(walked, 5) << "from " << x << ", " << y;
    }
  EXPECT_GT(walkable, 1000);
}

TEST(SwarmGround, TablesThatAreHardToPlayOnStillHaveGround) {
  // Covered all over; a sliver; an outline without area; an island that is cut off.
  std::vector<PlayingField> fields{table_with({{-1, 1, -1, 1}}), empty_field(kRadius_m), empty_field(kRadius_m),
                                   table_with({{-1, 1, -0.05, 0.05}})};
  fields[1].outline_m = {{-0.25, 0}, {0.25, 0}, {0.25, 0.011}};
  fields[2].outline_m = {{0, 0}, {0, 0}, {0, 0}};
  for (const PlayingField& field : fields) {
    Simulation game;
    game.start(field, {});
    RandomPlayer player(3);
    for (int t = 0; t < ticks(20); ++t) {
      game.step(player.next());
      ASSERT_TRUE(game.ground().walkable(game.state().robot.position));
      for (const Critter& critter : game.state().critters)
        ASSERT_TRUE(critter.phase == CritterPhase::climbing || game.ground().walkable(critter.position));
    }
    EXPECT_GT(game.state().tick, 0);
  }
}

}  // namespace
}  // namespace parallax::swarm
