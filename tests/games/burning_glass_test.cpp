// The burning glass as a game: what burns and what does not, strokes and undo, the scripted player, long random play,
// and how it is drawn.
#include "games/burning_glass.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "tests/games/burning_glass_fixture.h"

namespace parallax {
namespace {

using burning::Generator;
using burning::kFullChar;
using burning::kSheetCells;
using burning::SheetGrid;
using Eigen::Vector2d;
using glass_test::above;
using glass_test::char_at;
using glass_test::char_sum;
using glass_test::kRadius_m;
using glass_test::look_at;
using glass_test::options_of;
using glass_test::play;
using glass_test::random_input;

TEST(BurningGlass, BurnsAtTheFocalLengthWithinASecondAndNotElsewhere) {
  for (int material = 0; material < 3; ++material) {
    BurningGlass game;
    game.start(empty_field(kRadius_m), options_of(material));
    const double focal_length = game.focal_length_m();
    EXPECT_NEAR(focal_length, 1.5 * kRadius_m, 1e-12);
    play(&game, above(0.03, -0.02, focal_length), 1);
    EXPECT_GT(char_at(game, 0.03, -0.02), 0.5) << material;
    double away = 0;
    for (int row = 0; row < kSheetCells; ++row) {
      for (int column = 0; column < kSheetCells; ++column) {
        const double distance = (game.grid().centre_of(column, row) - Vector2d(0.03, -0.02)).norm();
        if (distance > 0.1 * kRadius_m) away += game.sheet().charred()[SheetGrid::index(column, row)];
      }
    }
    EXPECT_EQ(away, 0) << material;
    EXPECT_EQ(game.stroke_count(), 1u);

    for (const double share : {0.4, 0.67, 1.33, 1.8}) {  // a third out of focus
      game.start(empty_field(kRadius_m), options_of(material));
      play(&game, above(0.03, -0.02, share * focal_length), 5);
      EXPECT_EQ(char_sum(game), 0) << material << " at " << share;
    }
    // Neither with the lens covered, nor while the camera is lost.
    game.start(empty_field(kRadius_m), options_of(material));
    GameInput covered = above(0, 0, focal_length);
    covered.fire = true;
    play(&game, covered, 2);
    play(&game, GameInput(), 2);
    EXPECT_EQ(char_sum(game), 0);
  }
}

TEST(BurningGlass, ACircleOfTheCameraLeavesACircle) {
  for (int material = 0; material < 3; ++material) {
    BurningGlass game;
    game.start(empty_field(kRadius_m), options_of(material));
    const double radius = 0.5 * kRadius_m, seconds = 10;
    for (int i = 0; i <= seconds * kGameTicksPerSecond; ++i) {
      const double angle = 2 * std::numbers::pi * i / (seconds * kGameTicksPerSecond);
      game.step(above(radius * std::cos(angle), radius * std::sin(angle), game.focal_length_m()));
    }
    // The centre of the char in each of 72 sectors.
    std::vector<double> weight(72, 0.0), distance(72, 0.0);
    for (int row = 0; row < kSheetCells; ++row) {
      for (int column = 0; column < kSheetCells; ++column) {
        const double there = game.sheet().charred()[SheetGrid::index(column, row)];
        const Vector2d at = game.grid().centre_of(column, row);
        if (there > 0 && material != 1) {  // paper's edge smoulders on
          ASSERT_NEAR(at.norm(), radius, 8 * game.grid().cell_m());
        }
        const double turn = std::atan2(at.y(), at.x()) / (2 * std::numbers::pi) + 0.5;
        const auto sector = static_cast<std::size_t>(std::min(71.0, turn * 72));
        weight[sector] += there;
        distance[sector] += there * at.norm();
      }
    }
    for (std::size_t sector = 0; sector < 72; ++sector) {
      ASSERT_GT(weight[sector], 0.5 * kFullChar) << material << " sector " << sector;
      if (material == 1) continue;
      EXPECT_NEAR(distance[sector] / weight[sector], radius, 1.5 * game.grid().cell_m()) << material;
    }
    EXPECT_EQ(game.stroke_count(), 1u);
  }
}

TEST(BurningGlass, UndoTakesBackStrokeByStrokeToTheLastBit) {
  BurningGlass game;
  game.start(empty_field(kRadius_m), options_of(0));
  const double height = game.focal_length_m();
  std::vector<std::vector<std::uint16_t>> sheets{game.sheet().charred()};
  std::vector<cv::Mat4b> pictures{game.export_picture()};
  for (int stroke = 0; stroke < 3; ++stroke) {
    // The strokes cross.
    for (int i = 0; i < 60; ++i) game.step(above(0.001 * (i - 30), 0.02 * (stroke - 1) * (30 - i) / 30.0, height));
    play(&game, above(0, 0, 2 * height), 2);
    ASSERT_EQ(game.stroke_count(), static_cast<std::size_t>(stroke + 1));
    sheets.push_back(game.sheet().charred());
    pictures.push_back(game.export_picture());
    ASSERT_NE(sheets.back(), sheets[sheets.size() - 2]);
  }
  // One more that is still going on.
  play(&game, above(0.1, 0.1, height), 0.5);
  ASSERT_EQ(game.stroke_count(), 4u);
  for (int left = 3; left >= 0; --left) {
    GameInput press = above(0, 0, 2 * height);
    press.act = true;
    play(&game, press, 0.3);  // held: once
    play(&game, above(0, 0, 2 * height), 0.2);
    ASSERT_EQ(game.stroke_count(), static_cast<std::size_t>(left));
    EXPECT_EQ(game.sheet().charred(), sheets[static_cast<std::size_t>(left)]);
    EXPECT_EQ(cv::norm(game.export_picture(), pictures[static_cast<std::size_t>(left)], cv::NORM_INF), 0);
  }
  EXPECT_FALSE(game.undo());
}

// Paper goes on smouldering for a while when the light has gone: that is part of the stroke, and no reason for the next
// one to be the same stroke.
TEST(BurningGlass, PaperThatSmouldersIsUndoneStrokeByStroke) {
  BurningGlass game;
  game.start(empty_field(kRadius_m), options_of(1));
  const double height = game.focal_length_m();
  const auto dark = [&](double seconds) {
    GameInput covered = above(0, 0, 2 * height);
    covered.fire = true;
    play(&game, covered, seconds);
  };
  std::vector<std::vector<std::uint16_t>> sheets{game.sheet().charred()};
  for (int stroke = 0; stroke < 2; ++stroke) {
    for (int i = 0; i < 120; ++i) game.step(above(0.0008 * (i - 60), 0.08 * stroke - 0.04, height));
    const double lit = char_sum(game);
    dark(0.75);
    ASSERT_EQ(game.stroke_count(), static_cast<std::size_t>(stroke + 1));
    ASSERT_GT(char_sum(game), 1.02 * lit) << "it smouldered in the dark";
    if (stroke == 0) dark(6);
    sheets.push_back(game.sheet().charred());
  }
  dark(6);
  EXPECT_GT(char_sum(game), 0);
  BurningGlass other;
  other.restore(game.save(), empty_field(kRadius_m));
  for (BurningGlass* one : {&game, &other}) {
    ASSERT_EQ(one->stroke_count(), 2u);
    ASSERT_TRUE(one->undo());
    EXPECT_EQ(one->sheet().charred(), sheets[1]);
    ASSERT_TRUE(one->undo());
    EXPECT_EQ(one->sheet().charred(), sheets[0]);
  }
}

TEST(BurningGlass, ScriptedPlayerTurnsTheSunAndBurns) {
  for (const bool seated : {false, true}) {
    BurningGlass game;
    GameOptions options;
    options.seated = seated;
    options.settings = {{"sun_elevation", 80}, {"sun_azimuth", 60}};
    game.start(empty_field(kRadius_m), options);
    const RigidTransform camera = look_at({0.05, -0.22, 0.26}, {0.02, 0.03, 0});
    double hottest = 0;
    for (int i = 0; i < 6 * kGameTicksPerSecond; ++i) {
      const GameInput input = game.scripted_input(camera);
      ASSERT_LE(input.move.cwiseAbs().maxCoeff(), 1);
      game.step(input);
      hottest = std::max<double>(hottest, game.sheet().last().hottest_k);
    }
    EXPECT_GT(char_at(game, 0.02, 0.03), 0.9) << seated << " " << hottest;
    EXPECT_GT(game.hud().score, 0);
    EXPECT_FALSE(game.take_sounds().empty());
    EXPECT_TRUE(game.take_sounds().empty());
  }
}

// Long trials: bench/game_endurance.
TEST(BurningGlass, ThreeMinutesOfRandomPlayStayFiniteAndBounded) {
  BurningGlass game;
  game.start(empty_field(kRadius_m), options_of(1, 4));
  Generator generator(2);
  GameInput input;
  std::size_t longest = 0;
  for (int i = 0; i < 3 * 60 * kGameTicksPerSecond; ++i) {
    input = random_input(&generator, input);
    game.step(input);
    if (i % 3600 == 0) {
      game.set("material", static_cast<double>(i / 3600 % 3));
      game.set("lens_shape", static_cast<double>(i / 3600 % 2));
      game.change_field(empty_field(generator.uniform(0.1, 0.3)));
      longest = std::max(longest, game.save().size());
      for (const float value : game.sheet().temperature_k()) ASSERT_TRUE(value >= 0 && value <= 1400);
      const GameHud hud = game.hud();
      for (const GameGauge& gauge : hud.gauges) ASSERT_TRUE(gauge.value >= 0 && gauge.value <= 1);
      ASSERT_LE(game.take_sounds().size(), 64u);
      DrawList list;
      game.draw(ModelSet(), &list);
      ASSERT_LE(list.sprites.size(), 200u);
      for (const Sprite& sprite : list.sprites) ASSERT_TRUE(sprite.position.allFinite());
    }
  }
  EXPECT_LE(game.stroke_count(), 65u);
  EXPECT_LT(longest, 2u << 20);
}

TEST(BurningGlass, SettingsAreClampedAndTheFieldMayChange) {
  BurningGlass game;
  game.start(empty_field(kRadius_m), options_of(0));
  for (const GameSetting& setting : game.info().settings) {
    game.set(setting.name, 1e9);
    game.set(setting.name, std::nan(""));
  }
  game.set("nonsense", 3);
  EXPECT_NEAR(game.focal_length_m(), 4 * kRadius_m, 1e-12);
  EXPECT_NEAR(game.towards_sun().z(), 1, 1e-9);
  for (const std::string& line : game.info().explanation) EXPECT_LE(line.size(), 48u);
  EXPECT_LE(game.info().explanation.size(), 10u);

  game.start(empty_field(kRadius_m), options_of(0));
  game.change_field(empty_field(0.3));
  EXPECT_EQ(game.half_extent_m(), 0.3);  // nothing was burnt yet
  play(&game, above(0.03, 0.06, game.focal_length_m()), 1);
  const double before = char_at(game, 0.03, 0.06);
  ASSERT_GT(before, 0.5);
  game.change_field(empty_field(0.5));
  EXPECT_EQ(char_at(game, 0.03, 0.06), before);
  EXPECT_EQ(game.half_extent_m(), 0.3) << "the sheet keeps its size when the table grows";
  // The map is scaled: what is burnt stays where it is on the table.
  PlayingField twice = empty_field(1.0);
  twice.scale = 2;
  game.change_field(twice);
  EXPECT_EQ(char_at(game, 0.06, 0.12), before);
  EXPECT_NEAR(game.half_extent_m(), 0.6, 1e-12);
  EXPECT_NEAR(game.landmark()->position_m.x(), 0.06, 0.02);
  // Tables that grow while they are mapped, one after the other: the sheet does not dwindle.
  for (int number = 1; number <= 60; ++number) {
    for (const double radius : {0.2, 0.4}) {
      PlayingField next = empty_field(radius);
      next.number = number;
      game.change_field(next);
    }
    ASSERT_GE(game.half_extent_m(), 0.1) << number;
    ASSERT_LE(game.half_extent_m(), 0.4) << number;
  }
}

TEST(BurningGlass, DrawsTheBurnWhereItIs) {
  BurningGlass game;
  game.start(empty_field(kRadius_m), options_of(0));
  play(&game, above(0.1, 0.05, game.focal_length_m()), 1);
  DrawList list;
  list.camera = CameraModel(CameraModelKind::pinhole, 640, 480, {500, 500}, {319.5, 239.5});
  game.draw(ModelSet(), &list);
  ASSERT_GE(list.meshes.size(), 2u);
  EXPECT_FALSE(list.screen_lines.empty());
  const Mesh& burn = *list.meshes[0].mesh;
  // The place on the mesh where the picture is darkest and opaque.
  Vector2d middle = Vector2d::Zero();
  double weight = 0;
  for (int y = 0; y < burn.texture.rows; ++y) {
    for (int x = 0; x < burn.texture.cols; ++x) {
      const double alpha = burn.texture(y, x)[3];
      middle += alpha * Vector2d((x + 0.5) / burn.texture.cols, (y + 0.5) / burn.texture.rows);
      weight += alpha;
    }
  }
  ASSERT_GT(weight, 0);
  middle /= weight;
  EXPECT_NEAR(middle.x(), 0.75, 0.005);
  EXPECT_NEAR(middle.y(), 0.375, 0.005);
  for (const MeshVertex& vertex : burn.vertices) {
    EXPECT_NEAR(vertex.uv.x(), vertex.position.x() / (2 * kRadius_m) + 0.5, 1e-5);
    EXPECT_NEAR(vertex.uv.y(), 0.5 - vertex.position.y() / (2 * kRadius_m), 1e-5);
  }
  // Nothing new: the same pictures, not uploaded again.
  DrawList again;
  game.draw(ModelSet(), &again);
  EXPECT_EQ(again.meshes[0].mesh, list.meshes[0].mesh);
  EXPECT_EQ(again.meshes[1].mesh, list.meshes[1].mesh);
}

}  // namespace
}  // namespace parallax
