// The physics of Marbles against mechanics: the units are marbles' diameters and seconds.
#include "games/marbles_physics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "games/game.h"

namespace parallax {
namespace {

constexpr float kGravity = 120;

Table round_table(float radius) {
  Table table;
  for (int i = 0; i < 16; ++i) {
    const float angle = static_cast<float>(i) * static_cast<float>(M_PI) / 8;
    table.outline.push_back({radius * std::cos(angle), radius * std::sin(angle)});
  }
  return table;
}

std::vector<MarbleMotion> one_marble(const Eigen::Vector3f& position, const Eigen::Vector3f& velocity) {
  std::vector<MarbleMotion> marbles(1);
  marbles[0].position = position;
  marbles[0].velocity = velocity;
  marbles[0].spin = Eigen::Vector3f(-velocity.y(), velocity.x(), 0) / kMarbleRadius;  // it rolls
  return marbles;
}

const Eigen::Vector3f kDown(0, 0, -kGravity);

TEST(MarblesPhysics, RollsDownATiltedTableAsABallDoes) {
  for (const float degrees : {2.0f, 5.0f, 15.0f})
    for (const float resistance : {0.0f, 0.15f}) {
      MarblePhysicsOptions options;
      options.resistance = resistance;
      MarblePhysics physics(options);
      physics.set_table(round_table(40));
      auto marbles = one_marble({-10, 3, kMarbleRadius}, {0, 0, 0});
      const float angle = degrees * static_cast<float>(M_PI) / 180;
      const Eigen::Vector3f gravity(kGravity * std::sin(angle), 0, -kGravity * std::cos(angle));
      for (int tick = 0; tick < kGameTicksPerSecond; ++tick) physics.step(gravity, &marbles, nullptr);
      const float acceleration = 5.0f / 7 * kGravity * std::sin(angle);
      const float expected = resistance > 0 ? acceleration / resistance * (1 - std::exp(-resistance)) : acceleration;
      EXPECT_NEAR(marbles[0].velocity.x() / expected, 1, 0.01) << degrees << " degrees";
      EXPECT_NEAR(marbles[0].spin.y() * kMarbleRadius / expected, 1, 0.02) << "it slips at " << degrees << " degrees";
      EXPECT_NEAR(marbles[0].position.y(), 3, 0.01);
      EXPECT_NEAR(marbles[0].position.z(), kMarbleRadius, 0.01);
    }
}

TEST(MarblesPhysics, ACollisionKeepsMomentumAndEnergyDoesNotGrow) {
  MarblePhysicsOptions options;
  options.resistance = 0;
  for (const float offset : {0.0f, 0.3f, 0.7f}) {
    MarblePhysics physics(options);
    physics.set_table(round_table(40));
    std::vector<MarbleMotion> marbles(2);
    marbles[0].position = {-3, 0, 10};
    marbles[0].velocity = {10, 0, 0};
    marbles[1].position = {0, offset, 10};
    std::vector<MarbleKnock> knocks;
    const auto energy = [&] {
      float sum = 0;
      for (const MarbleMotion& m : marbles)
        sum += 0.5f * m.velocity.squaredNorm() + 0.2f * kMarbleRadius * kMarbleRadius * m.spin.squaredNorm();
      return sum;
    };
    for (int tick = 0; tick < 60; ++tick) {
      const float before = energy();
      physics.step({0, 0, 0}, &marbles, &knocks);
      EXPECT_LE(energy(), before * 1.0001f);
    }
    const Eigen::Vector3f momentum = marbles[0].velocity + marbles[1].velocity;
    EXPECT_LT((momentum - Eigen::Vector3f(10, 0, 0)).norm(), 1e-3f);
    ASSERT_EQ(knocks.size(), 1u);
    EXPECT_EQ(std::minmax(knocks[0].marble, knocks[0].other), std::minmax(0, 1));
    if (offset == 0) {
      EXPECT_NEAR(marbles[1].velocity.x(), 0.5f * (1 + 0.81f) * 10, 0.1);
    }
  }
}

TEST(MarblesPhysics, AMarbleInABoxLosesEnergy) {
  MarblePhysics physics;
  Table table = round_table(40);
  table.boxes = {{{-6, -6}, {-5, 6}, 30}, {{5, -6}, {6, 6}, 30}, {{-5, -6}, {5, -5}, 30}, {{-5, 5}, {5, 6}, 30}};
  physics.set_table(table);
  auto marbles = one_marble({0, 0, 6}, {20, 13, 0});
  marbles.push_back(marbles[0]);
  marbles[1].position = {2, -2, 3};
  const auto energy = [&] {
    float sum = 0;
    for (const MarbleMotion& m : marbles)
      sum += 0.5f * m.velocity.squaredNorm() + 0.2f * kMarbleRadius * kMarbleRadius * m.spin.squaredNorm() +
             kGravity * m.position.z();
    return sum;
  };
  float least = energy();
  for (int tick = 0; tick < 10 * kGameTicksPerSecond; ++tick) {
    physics.step(kDown, &marbles, nullptr);
    EXPECT_LT(energy(), least * 1.01f + 1);
    least = std::min(least, energy());
  }
  EXPECT_LT(marbles[0].velocity.norm(), 10);
}

TEST(MarblesPhysics, AThinWallHoldsTheFastestMarble) {
  for (const float speed : {5.0f, 20.0f, kMarbleGreatestSpeed})
    for (const float angle : {0.0f, 0.5f, 1.0f})
      for (int shift = 0; shift < 4; ++shift) {
        MarblePhysics physics;
        Table table = round_table(40);
        table.boxes = {{{5, -30}, {5.05f, 30}, 3}};
        physics.set_table(table);
        auto marbles = one_marble({0.1f * static_cast<float>(shift), -8, kMarbleRadius},
                                  {speed * std::cos(angle), speed * std::sin(angle), 0});
        float nearest = 10;
        for (int tick = 0; tick < 60; ++tick) {
          physics.step(kDown, &marbles, nullptr);
          nearest = std::min(nearest, 5 - marbles[0].position.x());
        }
        EXPECT_GT(nearest, 0.9f * kMarbleRadius) << speed << " at " << angle;
        EXPECT_LT(marbles[0].position.x(), 5);
      }
}

TEST(MarblesPhysics, RollsOverTheSeamsOfBlocksAndUpARamp) {
  MarblePhysics physics;
  Table table = round_table(60);
  for (int i = -60; i < 60; ++i) {
    const float x = 0.25f * static_cast<float>(i);
    table.boxes.push_back({{x, -3}, {x + 0.25f, 3}, 1});
  }
  TableRamp ramp;
  ramp.foot = {-21, 0};
  table.ramps = {ramp};
  physics.set_table(table);
  auto marbles = one_marble({-25, 0, kMarbleRadius}, {22, 0, 0});
  float highest = 0;
  for (int tick = 0; tick < 4 * kGameTicksPerSecond && marbles[0].position.x() < 13; ++tick) {
    physics.step(kDown, &marbles, nullptr);
    if (marbles[0].position.x() > -5) highest = std::max(highest, marbles[0].position.z());
  }
  EXPECT_GE(marbles[0].position.x(), 13);
  EXPECT_NEAR(marbles[0].position.z(), 1 + kMarbleRadius, 0.02);
  EXPECT_LT(highest, 1 + kMarbleRadius + 0.05f);
}

TEST(MarblesPhysics, FallsOffTheEdgeOnly) {
  MarblePhysics physics;
  physics.set_table(round_table(10));
  auto marbles = one_marble({0, 0, kMarbleRadius}, {6, 0, 0});
  bool fell = false;
  for (int tick = 0; tick < 6 * kGameTicksPerSecond && !fell; ++tick) {
    physics.step(kDown, &marbles, nullptr);
    if (marbles[0].position.x() < 9.8f) {
      EXPECT_NEAR(marbles[0].position.z(), kMarbleRadius, 0.02);
    }
    fell = marbles[0].position.z() < -4;
  }
  EXPECT_TRUE(fell);
}

// A world that has seen every tick and worlds that have seen none of those before agree to the last bit.
// The table has grown over a marble that was falling beside it, and a block stands there now: it does not come up in
// the block, nor on the table.
TEST(MarblesPhysics, WhatIsOverTheEdgeIsNotCaughtByATableThatGrows) {
  for (const float z : {-0.05f, -0.3f, -0.8f}) {
    MarblePhysics physics{MarblePhysicsOptions()};
    Table table = round_table(40);
    table.boxes.push_back({{-2, -2}, {2, 2}, 4});
    physics.set_table(table);
    auto marbles = one_marble({0.5f, 0.5f, z}, {3, 0, -1});
    for (int tick = 0; tick < kGameTicksPerSecond; ++tick) {
      const float before = marbles[0].position.z();
      physics.step(kDown, &marbles, nullptr);
      ASSERT_LT(marbles[0].position.z(), before) << "from " << z << " at tick " << tick;
    }
    EXPECT_LT(marbles[0].position.z(), -10);
  }
}

TEST(MarblesPhysics, RemembersNothing) {
  std::uint32_t seed = 7;
  const auto share = [&] {
    seed = seed * 1664525u + 1013904223u;
    return static_cast<float>(seed >> 8) * 0x1p-24f;
  };
  Table table = round_table(14);
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector2f at(20 * share() - 10, 20 * share() - 10);
    table.boxes.push_back({at, at + Eigen::Vector2f(0.2f + share(), 0.2f + share()), 0.1f + 2 * share()});
  }
  MarblePhysics old_one;
  old_one.set_table(table);
  auto fresh = std::make_unique<MarblePhysics>();
  std::vector<MarbleMotion> a(5);
  for (MarbleMotion& marble : a) marble.position = {16 * share() - 8, 16 * share() - 8, 3};
  std::vector<MarbleMotion> b = a;
  Eigen::Vector3f gravity = kDown;
  float deepest = 0;
  for (int tick = 0; tick < 1500; ++tick) {
    if (tick % 60 == 0) gravity = {50 * share() - 25, 50 * share() - 25, -115};
    if (tick % 37 == 0) {
      fresh = std::make_unique<MarblePhysics>();
      fresh->set_table(table);
    }
    old_one.step(gravity, &a, nullptr);
    fresh->step(gravity, &b, nullptr);
    for (std::size_t i = 0; i < a.size(); ++i) {
      ASSERT_EQ(a[i].position, b[i].position) << "tick " << tick;
      ASSERT_EQ(a[i].velocity, b[i].velocity) << "tick " << tick;
      ASSERT_EQ(a[i].spin, b[i].spin) << "tick " << tick;
      ASSERT_EQ(a[i].rotation.coeffs(), b[i].rotation.coeffs()) << "tick " << tick;
      for (const TableBox& box : table.boxes) {
        Eigen::Vector3f least, most;
        least << box.least, -0.5f;
        most << box.most, box.height;
        const Eigen::Vector3f nearest = a[i].position.cwiseMax(least).cwiseMin(most);
        deepest = std::max(deepest, kMarbleRadius - (a[i].position - nearest).norm());
      }
      if (a[i].position.z() < -5) {
        a[i] = MarbleMotion();
        a[i].position = {0, 0, 4};
        b[i] = a[i];
      }
    }
  }
  EXPECT_LT(deepest, 0.1f * kMarbleRadius);
}

}  // namespace
}  // namespace parallax
