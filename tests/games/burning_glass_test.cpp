// The burning glass as a game: what burns and what does not, strokes and undo, saving, hostile saves, long random play.
#include "games/burning_glass.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "games/burning_glass_codec.h"
#include "games/burning_glass_noise.h"

namespace parallax {
namespace {

using burning::Generator;
using burning::kFullChar;
using burning::kSheetCells;
using burning::kSheetSize;
using burning::LightOnSheet;
using burning::Material;
using burning::materials;
using burning::Sheet;
using burning::SheetGrid;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kRadius_m = 0.2;

RigidTransform look_at(const Vector3d& eye, const Vector3d& target) {
  const Vector3d z = (target - eye).normalized();
  const Vector3d x = z.cross(std::abs(z.y()) > 0.9 ? Vector3d::UnitX().eval() : Vector3d::UnitY().eval()).normalized();
  Eigen::Matrix3d R;
  R.row(0) = x;
  R.row(1) = z.cross(x);
  R.row(2) = z;
  return {R, -R * eye};
}

// The sun overhead.
GameOptions options_of(int material, std::uint64_t seed = 1) {
  GameOptions options;
  options.seed = seed;
  options.settings = {{"sun_elevation", 90}, {"sun_azimuth", -90}, {"material", material}};
  return options;
}

GameInput above(double x, double y, double height) {
  GameInput input;
  input.camera_from_plane = look_at({x, y, height}, {x, y, 0});
  return input;
}

void play(BurningGlass* game, const GameInput& input, double seconds) {
  const int ticks = static_cast<int>(std::lround(seconds * kGameTicksPerSecond));
  for (int i = 0; i < ticks; ++i) game->step(input);
}

double char_sum(const BurningGlass& game) {
  double sum = 0;
  for (const std::uint16_t value : game.sheet().charred()) sum += value;
  return sum / kFullChar;
}

double char_at(const BurningGlass& game, double x, double y) {
  const Vector2d cell = game.grid().cell_at({x, y});
  return game.sheet().charred()[SheetGrid::index(static_cast<int>(std::lround(cell.x())),
                                                 static_cast<int>(std::lround(cell.y())))] /
         static_cast<double>(kFullChar);
}

GameInput random_input(Generator* generator, const GameInput& last) {
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
      const Vector3d at(generator->uniform(-0.2, 0.2), generator->uniform(-0.2, 0.2), 0);
      const Vector3d eye =
          at + Vector3d(generator->uniform(-0.2, 0.2), generator->uniform(-0.2, 0.2), generator->uniform(-0.05, 0.5));
      input.camera_from_plane = look_at(eye, at);
    }
  }
  return input;
}

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

// A square of even light, 30 cells wide.
struct Patch {
  Sheet sheet;
  LightOnSheet light;
  explicit Patch(double suns, std::uint64_t seed = 1) {
    sheet.clear(seed);
    light.box = {110, 110, 140, 140};
    for (int row = 110; row < 140; ++row) {
      for (int column = 110; column < 140; ++column) {
        light.concentration[SheetGrid::index(column, row)] = static_cast<float>(suns);
      }
    }
  }
  // The time until a cell chars; -1: it does not within `most_s`.
  double time_to_char(const Material& material, double most_s) {
    for (int tick = 1; tick <= most_s * kGameTicksPerSecond; ++tick) {
      if (!sheet.advance(material, &light, 1, kGameTick_s).fresh.empty()) return tick * kGameTick_s;
    }
    return -1;
  }
};

// Each as its substance says: the light that it takes to char it, and how long that takes, by the closed form of
// dT/dt = w a C - k T, which holds in the middle of a wide patch of light.
TEST(BurningGlassMaterial, CharsWhereAndWhenItsSubstanceSays) {
  std::array<double, 3> suns_to_char{}, warming{};
  for (std::size_t m = 0; m < 3; ++m) {
    const Material& material = materials()[m];
    const burning::Substance& substance = burning::substance_of(material.kind);
    const double capacity = substance.density_kg_m3 * substance.heat_capacity_J_kgK * substance.heated_depth_m;
    EXPECT_NEAR(material.warming_k_per_s, burning::kHurry * 1000 / capacity, 1e-9) << material.name;
    EXPECT_NEAR(material.cooling_per_s / material.warming_k_per_s, substance.loss_W_m2K / 1000, 1e-12);
    // In the steady state the sun's heat is what is lost; time does not matter to it.
    suns_to_char[m] = material.ignition_k * substance.loss_W_m2K / (1000 * material.absorption);
    warming[m] = material.warming_k_per_s;
    // Scorched places take more light: below that, nothing happens.
    EXPECT_LT(
        Patch(0.95 * burning::kScorchShare * (1 - material.unevenness) * suns_to_char[m]).time_to_char(material, 5), 0)
        << material.name;
    const double suns = 5 * suns_to_char[m], least_k = material.ignition_k * (1 - 0.8 * material.unevenness);
    const double steady_k = material.warming_k_per_s * material.absorption * suns / material.cooling_per_s;
    const double expected_s = -std::log(1 - least_k / steady_k) / material.cooling_per_s;
    EXPECT_NEAR(Patch(suns).time_to_char(material, 5), expected_s, 0.15 * expected_s + kGameTick_s) << material.name;
  }
  EXPECT_GT(warming[1], 2 * warming[0]) << "a sheet of paper holds far less heat than a board";
  EXPECT_GT(warming[0], 1.2 * warming[2]);
  EXPECT_GT(suns_to_char[1], 1.2 * suns_to_char[0]) << "white paper throws most of the light back";
  EXPECT_GT(suns_to_char[0], 1.05 * suns_to_char[2]) << "a disc gives way at its glass transition";
}

TEST(BurningGlassMaterial, PaperSmouldersOnAndGoesOutAndTheOthersDoNot) {
  for (int material = 0; material < 3; ++material) {
    double drawn = 0, later = 0;
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      BurningGlass game;
      game.start(empty_field(kRadius_m), options_of(material, seed));
      for (int i = 0; i < 360; ++i) game.step(above(0.16 * (i - 180) / 360, 0, game.focal_length_m()));
      const double before = char_sum(game);
      drawn += before;
      GameInput covered = above(0, 0, game.focal_length_m());
      covered.fire = true;
      play(&game, covered, 20);
      const double out = char_sum(game);
      later += out;
      EXPECT_LT(out, 0.12 * kSheetSize) << "it never takes the whole sheet";
      play(&game, covered, 4);
      EXPECT_EQ(char_sum(game), out) << material << " " << seed << ": out";
      EXPECT_EQ(game.sheet().last().hottest_k, 0) << material << " " << seed;
    }
    if (material == 1) {
      EXPECT_GT(later, 1.2 * drawn);
    } else {
      EXPECT_LT(later, 1.06 * drawn) << material;
    }
  }
}

TEST(BurningGlassMaterial, LooksAsItself) {
  std::array<cv::Scalar, 3> mean{}, deviation{};
  std::array<double, 3> hues{};
  for (int material = 0; material < 3; ++material) {
    const auto m = static_cast<std::size_t>(material);
    BurningGlass game;
    game.start(empty_field(kRadius_m), options_of(material));
    for (int i = 0; i < 240; ++i)
      game.step(above(0.06 * std::cos(0.01 * i), 0.06 * std::sin(0.01 * i), game.focal_length_m()));
    const cv::Mat4b picture = game.export_picture();
    cv::Mat alpha, mask;
    cv::extractChannel(picture, alpha, 3);
    cv::threshold(alpha, mask, 128, 255, cv::THRESH_BINARY);
    ASSERT_GT(cv::countNonZero(mask), 100);
    cv::meanStdDev(picture, mean[m], deviation[m], mask);
    // How differently the channels go up and down: grey things have none of it.
    double sum = 0;
    int count = 0;
    for (int y = 0; y < picture.rows; ++y) {
      for (int x = 0; x < picture.cols; ++x) {
        if (mask.at<std::uint8_t>(y, x) == 0) continue;
        const cv::Vec4b& p = picture(y, x);
        sum += std::max({p[0], p[1], p[2]}) - std::min({p[0], p[1], p[2]});
        ++count;
      }
    }
    hues[m] = sum / count;
  }
  const auto brightness = [&](std::size_t m) { return (mean[m][0] + mean[m][1] + mean[m][2]) / 3; };
  EXPECT_LT(brightness(0), 80) << "wood goes black";
  EXPECT_LT(brightness(1), 90) << "paper too";
  EXPECT_GT(brightness(2), 100) << "a disc goes milky";
  EXPECT_GT(hues[2], 1.3 * hues[0]) << "and shimmers";
  EXPECT_GT(hues[2], 1.3 * hues[1]);
  for (const std::size_t channel : {0u, 1u, 2u}) {
    EXPECT_GT(deviation[2][static_cast<int>(channel)], 40) << "in every colour";
  }
}

// Sprites that a few charring cells give off, for each cell's worth of char.
TEST(BurningGlassMaterial, SmokesAsItself) {
  std::array<double, 3> smoke{}, sparks{};
  for (std::size_t m = 0; m < 3; ++m) {
    Patch patch(400);
    patch.light.box = {120, 120, 124, 124};
    burning::Particles particles;
    particles.clear(1);
    double charred = 0;
    Material material = materials()[m];
    material.spread_k = 0;                   // only the cells in the light
    for (int tick = 0; tick < 40; ++tick) {  // a third of a second: the smoke is all there yet
      charred += patch.sheet.advance(material, &patch.light, 1, kGameTick_s).charred;
      sparks[m] += particles.advance(patch.sheet, material, kGameTick_s);
    }
    DrawList list;
    particles.draw(Eigen::Affine3f::Identity(), kRadius_m, &list);
    for (const Sprite& sprite : list.sprites) smoke[m] += !sprite.additive;
    ASSERT_GT(charred, 10);
    smoke[m] /= charred;
  }
  EXPECT_GT(smoke[1], 1.3 * smoke[0]) << "paper smokes most";
  EXPECT_GT(smoke[0], 1.5 * smoke[2]);
  EXPECT_GT(sparks[0], 0);
  EXPECT_EQ(sparks[2], 0) << "plastic has no sparks";
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

TEST(BurningGlass, SameSeedAndInputsGiveTheSameStateAndASavedGameGoesOnAsTheFirst) {
  BurningGlass first, second, third;
  const PlayingField field = empty_field(kRadius_m);
  first.start(field, options_of(1, 5));
  second.start(field, options_of(1, 5));
  third.start(field, options_of(2, 6));
  Generator generator(17);
  GameInput input;
  std::size_t most_strokes = 0;
  for (int i = 0; i < 30 * kGameTicksPerSecond; ++i) {
    if (i % 1200 == 0) {
      for (BurningGlass* game : {&first, &second}) game->set("sun_elevation", 90);
    }
    input = i % 1200 < 500 ? above(0.1 * std::sin(0.004 * i), 0.05, first.focal_length_m())
                           : random_input(&generator, input);
    first.step(input);
    second.step(input);
    most_strokes = std::max(most_strokes, first.stroke_count());
    if (i % 301 == 0) {
      ASSERT_EQ(first.state_hash(), second.state_hash()) << i;
      const std::string text = first.save();
      third.restore(text, field);
      ASSERT_EQ(third.state_hash(), first.state_hash()) << i;
      ASSERT_EQ(third.save(), text);
      std::swap(second, third);
    }
  }
  EXPECT_EQ(first.state_hash(), second.state_hash());
  EXPECT_GT(most_strokes, 0u);
  EXPECT_EQ(cv::norm(first.export_picture(), second.export_picture(), cv::NORM_INF), 0);
  BurningGlass other;
  other.start(field, options_of(1, 6));
  EXPECT_NE(other.state_hash(), first.state_hash());
}

TEST(BurningGlass, RefusesWhatIsNotASaveAndStaysAsItWas) {
  BurningGlass game;
  game.start(empty_field(kRadius_m), options_of(1));
  play(&game, above(0, 0, game.focal_length_m()), 1);
  play(&game, above(0, 0, 2 * game.focal_length_m()), 2);
  play(&game, above(0.05, 0, game.focal_length_m()), 1);
  const std::string good = game.save();
  const std::uint64_t hash = game.state_hash();
  const auto refused = [&](const std::string& text) {
    try {
      game.restore(text, empty_field(kRadius_m));
    } catch (const InputError& error) {
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      EXPECT_LT(std::string(error.what()).size(), 200u);
      EXPECT_EQ(game.state_hash(), hash);
      return true;
    }
    return false;
  };
  for (const char* text : {"", "{", "[]", "null", "{}", "{\"game\":\"swarm\"}", "\xff\xfe", "{\"game\":{\"\n\":1}}"}) {
    EXPECT_TRUE(refused(text)) << text;
  }
  EXPECT_TRUE(refused(std::string(100'000, '[')));
  EXPECT_TRUE(refused(std::string(5u << 20, ' ')));
  const nlohmann::json state = nlohmann::json::parse(good);
  for (const auto& [key, value] : state.items()) {
    nlohmann::json broken = state;
    broken.erase(key);
    EXPECT_TRUE(refused(broken.dump())) << key;
    for (const nlohmann::json& wrong : {nlohmann::json(-7), nlohmann::json(1e300), nlohmann::json("AAAA"),
                                        nlohmann::json(nullptr), nlohmann::json::array({1, "x"})}) {
      broken[key] = wrong;
      EXPECT_TRUE(refused(broken.dump())) << key << " " << wrong;
    }
  }
  // Layers of the wrong length, with values that cannot be, and truncated ones.
  const auto with = [&](const char* key, const nlohmann::json& value) {
    nlohmann::json broken = state;
    broken[key] = value;
    return broken.dump();
  };
  EXPECT_TRUE(refused(with("char", burning::encode_layer(std::vector<std::uint16_t>(kSheetSize + 1, 3)))));
  EXPECT_TRUE(refused(with("char", burning::encode_layer(std::vector<std::uint16_t>(kSheetSize - 1, 3)))));
  for (const float value : {-1.0f, 1e9f, std::nanf("")}) {
    EXPECT_TRUE(refused(with("temperature", burning::encode_layer(std::vector<float>(kSheetSize, value)))));
  }
  EXPECT_TRUE(refused(with("strokes", {burning::encode_cells({{70'000, 1}})})));
  EXPECT_TRUE(refused(with("strokes", std::vector<std::string>(1000, ""))));
  // Any damage to the text is refused or is another state that can be played.
  Generator generator(3);
  int accepted = 0;
  for (int i = 0; i < 100; ++i) {
    std::string text = good;
    text[generator.next() % text.size()] = static_cast<char>(generator.next() % 256);
    if (i % 3 == 0) text.resize(generator.next() % text.size());
    BurningGlass other;
    try {
      other.restore(text, empty_field(kRadius_m));
      play(&other, above(0, 0, 0.3), 0.05);
      other.undo();
      ++accepted;
    } catch (const InputError&) {
    }
  }
  EXPECT_LT(accepted, 100);
  game.restore(good, empty_field(kRadius_m));
  EXPECT_EQ(game.state_hash(), hash);
}

TEST(BurningGlass, LayersComeBackFromTheirText) {
  Generator generator(8);
  for (int kind = 0; kind < 4; ++kind) {
    std::vector<std::uint16_t> values(3001);
    for (auto& value : values) {
      value = static_cast<std::uint16_t>(kind == 0 ? 0 : kind == 1 ? generator.next() : generator.next() % 40 / 38);
    }
    std::vector<std::uint16_t> back;
    ASSERT_TRUE(burning::decode_layer(burning::encode_layer(values), values.size(), &back));
    EXPECT_EQ(back, values);
    EXPECT_FALSE(burning::decode_layer(burning::encode_layer(values), values.size() + 1, &back));
  }
  std::vector<std::uint8_t> bytes;
  ASSERT_TRUE(burning::from_base64("TWFueQ==", &bytes));
  EXPECT_EQ(std::string(bytes.begin(), bytes.end()), "Many");
  EXPECT_EQ(burning::base64(bytes), "TWFueQ==");
  for (const char* text : {"TWF", "TWF*", "=AAA", "TW=u"}) EXPECT_FALSE(burning::from_base64(text, &bytes)) << text;
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
