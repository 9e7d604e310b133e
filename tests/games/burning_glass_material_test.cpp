// What the sheet of the burning glass is made of: when wood, paper and a disc char, how they burn on, look and smoke.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "games/burning_glass.h"
#include "tests/games/burning_glass_fixture.h"

namespace parallax {
namespace {

using burning::kSheetSize;
using burning::LightOnSheet;
using burning::Material;
using burning::materials;
using burning::Sheet;
using burning::SheetGrid;
using glass_test::above;
using glass_test::char_sum;
using glass_test::kRadius_m;
using glass_test::options_of;
using glass_test::play;

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

}  // namespace
}  // namespace parallax
