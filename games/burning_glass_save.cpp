// The state of the burning glass as text, and back. What is read may have been written by anybody.
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <numbers>

#include "core/error.h"
#include "games/burning_glass.h"
#include "games/burning_glass_codec.h"
#include "games/burning_glass_info.h"

namespace parallax {

using namespace burning;

namespace {

using nlohmann::json;

constexpr int kSaveVersion = 1;
// A sheet that is hot and burnt all over with every stroke kept takes some 1.3 MB.
constexpr std::size_t kLongestText = 4u << 20;
constexpr double kSmallestHalfExtent_m = 1e-6, kLargestHalfExtent_m = 1e6;
constexpr std::uint64_t kMostTicks = std::uint64_t{1} << 53;

[[noreturn]] void refuse(const std::string& key, const std::string& found, const std::string& expected) {
  throw InputError("saved burning glass: " + key + ": found " + found + ", expected " + expected);
}

// What was found, short enough for one line.
std::string shown(const json& value) {
  std::string text = value.dump(-1, ' ', true, json::error_handler_t::replace);
  if (text.size() > 40) text = text.substr(0, 40) + "...";
  return text;
}

const json& member(const json& state, const char* key) {
  const auto it = state.find(key);
  if (it == state.end()) refuse(key, "nothing", "a value");
  return *it;
}

double number(const json& state, const char* key, double least, double most) {
  const json& value = member(state, key);
  const double out = value.is_number() ? value.get<double>() : std::nan("");
  if (!(out >= least && out <= most)) {
    char range[80];
    std::snprintf(range, sizeof range, "a number from %g to %g", least, most);
    refuse(key, shown(value), range);
  }
  return out;
}

std::uint64_t whole(const json& state, const char* key, std::uint64_t most) {
  const json& value = member(state, key);
  if (!value.is_number_unsigned() || value.get<std::uint64_t>() > most) {
    refuse(key, shown(value), "a whole number from 0 to " + std::to_string(most));
  }
  return value.get<std::uint64_t>();
}

bool truth(const json& state, const char* key) {
  const json& value = member(state, key);
  if (!value.is_boolean()) refuse(key, shown(value), "true or false");
  return value.get<bool>();
}

std::string words(const json& value, const std::string& key) {
  if (!value.is_string()) refuse(key, shown(value), "text");
  return value.get<std::string>();
}

template <typename Value>
std::vector<Value> layer(const json& state, const char* key) {
  std::vector<Value> out;
  if (!decode_layer(words(member(state, key), key), kSheetSize, &out)) {
    refuse(key, "damaged data", "a layer of " + std::to_string(kSheetSize) + " cells");
  }
  return out;
}

// FNV-1a over words of eight bytes.
class Hash {
 public:
  void add(std::uint64_t value) { sum_ = (sum_ ^ value) * 0x100000001b3ull ^ (sum_ >> 47); }
  void add(double value) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    add(bits);
  }
  template <typename Value>
  void add(const std::vector<Value>& values) {
    constexpr std::size_t kPerWord = sizeof(std::uint64_t) / sizeof(Value);
    for (std::size_t i = 0; i + kPerWord <= values.size(); i += kPerWord) {
      std::uint64_t bits = 0;
      std::memcpy(&bits, values.data() + i, sizeof bits);
      add(bits);
    }
  }
  std::uint64_t sum() const { return sum_; }

 private:
  std::uint64_t sum_ = 0xcbf29ce484222325ull;
};

}  // namespace

std::string BurningGlass::save() const {
  json state;
  state["game"] = info().name;
  state["version"] = kSaveVersion;
  state["tick"] = tick_;
  state["seed"] = seed_;
  state["half_extent_m"] = grid_.half_extent_m;
  state["azimuth_rad"] = controls_.azimuth_rad;
  state["elevation_rad"] = controls_.elevation_rad;
  state["focal_length"] = controls_.focal_length;
  state["lens_diameter"] = controls_.lens_diameter;
  state["lens_shape"] = static_cast<std::uint64_t>(controls_.lens_shape);
  state["material"] = static_cast<std::uint64_t>(controls_.material);
  state["sun_placed"] = controls_.sun_placed;
  state["covered_ticks"] = static_cast<std::uint64_t>(covered_ticks_);
  state["act_held"] = act_held_;
  state["seated"] = seated_;
  state["difficulty"] = static_cast<std::uint64_t>(difficulty_);
  state["cells"] = static_cast<std::uint64_t>(kSheetCells);
  state["char"] = encode_layer(sheet_.charred());
  state["temperature"] = encode_layer(sheet_.temperature_k());
  json strokes = json::array();
  for (const Strokes::Cells& cells : strokes_.closed()) strokes.push_back(encode_cells(cells));
  state["strokes"] = std::move(strokes);
  state["stroke_open"] = strokes_.open();
  state["quiet_ticks"] = static_cast<std::uint64_t>(strokes_.quiet_ticks());
  if (strokes_.open()) state["char_before_stroke"] = encode_layer(strokes_.base());
  return state.dump();
}

void BurningGlass::restore(const std::string& text, const PlayingField& field) {
  if (text.size() > kLongestText) {
    refuse("length", std::to_string(text.size()) + " bytes", "at most " + std::to_string(kLongestText));
  }
  // Nothing of ours is nested deeper; a text that is cannot exhaust the stack.
  const json state = json::parse(
      text, [](int depth, json::parse_event_t, json&) { return depth <= 3; }, false);
  if (!state.is_object()) refuse("text", "no JSON object", "a saved game");
  const json& game = member(state, "game");
  if (game != info().name) refuse("game", shown(game), "\"" + info().name + "\"");
  if (whole(state, "version", 1'000'000) != kSaveVersion) {
    refuse("version", shown(state["version"]), std::to_string(kSaveVersion));
  }
  if (whole(state, "cells", 1'000'000) != kSheetCells) {
    refuse("cells", shown(state["cells"]), std::to_string(kSheetCells));
  }
  const std::uint64_t tick = whole(state, "tick", kMostTicks);
  const std::uint64_t seed = whole(state, "seed", ~std::uint64_t{0});
  SheetGrid grid;
  grid.half_extent_m = number(state, "half_extent_m", kSmallestHalfExtent_m, kLargestHalfExtent_m);
  const double degree = std::numbers::pi / 180, rounding = 1e-9;
  Controls controls;
  controls.azimuth_rad = number(state, "azimuth_rad", -std::numbers::pi - rounding, std::numbers::pi + rounding);
  controls.elevation_rad =
      number(state, "elevation_rad", kLeastElevation_deg * degree - rounding, kMostElevation_deg * degree + rounding);
  controls.focal_length = number(state, "focal_length", kLeastFocalLength, kMostFocalLength);
  controls.lens_diameter = number(state, "lens_diameter", kLeastDiameter, kMostDiameter);
  controls.lens_shape = static_cast<int>(whole(state, "lens_shape", 1));
  controls.material = static_cast<int>(whole(state, "material", materials().size() - 1));
  controls.sun_placed = truth(state, "sun_placed");
  const int covered_ticks = static_cast<int>(whole(state, "covered_ticks", 1000));
  const bool act_held = truth(state, "act_held"), seated = truth(state, "seated");
  const auto difficulty = static_cast<GameDifficulty>(whole(state, "difficulty", 2));
  std::vector<std::uint16_t> charred = layer<std::uint16_t>(state, "char");
  std::vector<float> temperature = layer<float>(state, "temperature");
  for (const float value : temperature) {
    if (!(value >= 0 && value <= static_cast<float>(kHottest_k))) {
      refuse("temperature", "a cell that is not so", "0 to " + std::to_string(static_cast<int>(kHottest_k)) + " K");
    }
  }
  const json& list = member(state, "strokes");
  if (!list.is_array() || list.size() > kMostStrokes) {
    refuse("strokes", shown(list), "a list of at most " + std::to_string(kMostStrokes));
  }
  std::deque<Strokes::Cells> strokes;
  for (const json& item : list) {
    const std::string key = "strokes[" + std::to_string(strokes.size()) + "]";
    Strokes::Cells cells;
    if (!decode_cells(words(item, key), kSheetSize, &cells)) refuse(key, "damaged data", "rising cells of the sheet");
    strokes.push_back(std::move(cells));
  }
  const bool open = truth(state, "stroke_open");
  const int quiet = static_cast<int>(whole(state, "quiet_ticks", kQuietTicks));
  Strokes::Char base = open ? layer<std::uint16_t>(state, "char_before_stroke") : charred;

  // From here on nothing can fail.
  field_ = field;
  grid_ = grid;
  controls_ = controls;
  tick_ = tick;
  seed_ = seed;
  covered_ticks_ = covered_ticks;
  act_held_ = act_held;
  seated_ = seated;
  difficulty_ = difficulty;
  sheet_.clear(seed);
  sheet_.set_char(std::move(charred));
  sheet_.set_temperature(std::move(temperature));
  strokes_ = Strokes::from_parts(std::move(strokes), std::move(base), open, quiet);
  bundle_ = RayBundle(kRaysPerTick, seed);
  forget_moment();
}

std::uint64_t BurningGlass::state_hash() const {
  Hash hash;
  hash.add(tick_);
  hash.add(seed_);
  hash.add(grid_.half_extent_m);
  hash.add(controls_.azimuth_rad);
  hash.add(controls_.elevation_rad);
  hash.add(controls_.focal_length);
  hash.add(controls_.lens_diameter);
  const auto flags = {controls_.lens_shape,  controls_.material, int{controls_.sun_placed},     covered_ticks_,
                      int{act_held_},        int{seated_},       static_cast<int>(difficulty_), int{strokes_.open()},
                      strokes_.quiet_ticks()};
  for (const int flag : flags) hash.add(static_cast<std::uint64_t>(flag));
  hash.add(sheet_.charred());
  hash.add(sheet_.temperature_k());
  if (strokes_.open()) hash.add(strokes_.base());
  for (const Strokes::Cells& cells : strokes_.closed()) {
    hash.add(static_cast<std::uint64_t>(cells.size()));
    for (const CellValue& cell : cells) hash.add(std::uint64_t{cell.cell} << 16 | cell.value);
  }
  return hash.sum();
}

}  // namespace parallax
