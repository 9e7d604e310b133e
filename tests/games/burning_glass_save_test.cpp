// The saved burning glass: it goes on as the first one, and what is no save is refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "games/burning_glass.h"
#include "games/burning_glass_codec.h"
#include "tests/games/burning_glass_fixture.h"

namespace parallax {
namespace {

using burning::Generator;
using burning::kSheetSize;
using glass_test::above;
using glass_test::kRadius_m;
using glass_test::options_of;
using glass_test::play;
using glass_test::random_input;

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

}  // namespace
}  // namespace parallax
