#include <cmath>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "games/marbles_state.h"

namespace parallax {
namespace {

using nlohmann::json;

constexpr std::size_t kLongestText = 1 << 20;
constexpr double kFarthest = 1000;  // coordinates, units
constexpr int kLongestWait_ticks = 10'000;
constexpr int kLongestPhase_ticks = 1'000'000'000;

[[noreturn]] void refuse(const std::string& key, const std::string& found, const std::string& expected) {
  throw InputError("saved game of marbles: " + key + ": found " + found + ", expected " + expected);
}

std::string describe(const json& value) {
  if (value.is_number()) return value.dump();
  if (value.is_boolean()) return value.get<bool>() ? "true" : "false";
  return std::string(value.type_name());
}

std::string format(double value) { return json(value).dump(); }

const json& member(const json& from, const std::string& key) {
  if (!from.is_object()) refuse(key, describe(from), "an object that has it");
  const auto found = from.find(key);
  if (found == from.end()) refuse(key, "nothing", "a value");
  return *found;
}

double number(const json& value, const std::string& key, double least, double most) {
  const std::string expected = "a number from " + format(least) + " to " + format(most);
  if (!value.is_number()) refuse(key, describe(value), expected);
  const double found = value.get<double>();
  if (!(found >= least && found <= most)) refuse(key, describe(value), expected);
  return found;
}

double number_of(const json& from, const std::string& key, double least, double most) {
  return number(member(from, key), key, least, most);
}

float real_of(const json& from, const std::string& key, double least, double most) {
  return static_cast<float>(number_of(from, key, least, most));
}

std::int64_t whole_of(const json& from, const std::string& key, std::int64_t least, std::int64_t most) {
  const json& value = member(from, key);
  const std::string expected = "a whole number from " + std::to_string(least) + " to " + std::to_string(most);
  if (!value.is_number_integer()) refuse(key, describe(value), expected);
  if (value.is_number_unsigned() && value.get<std::uint64_t>() > static_cast<std::uint64_t>(INT64_MAX))
    refuse(key, describe(value), expected);
  const std::int64_t found = value.get<std::int64_t>();
  if (found < least || found > most) refuse(key, describe(value), expected);
  return found;
}

int int_of(const json& from, const std::string& key, int least, int most) {
  return static_cast<int>(whole_of(from, key, least, most));
}

bool bool_of(const json& from, const std::string& key) {
  const json& value = member(from, key);
  if (!value.is_boolean()) refuse(key, describe(value), "true or false");
  return value.get<bool>();
}

template <int Size>
json list(const Eigen::Matrix<float, Size, 1>& v) {
  json out = json::array();
  for (int i = 0; i < Size; ++i) out.push_back(static_cast<double>(v[i]));
  return out;
}

template <int Size>
Eigen::Matrix<float, Size, 1> vector_from(const json& value, const std::string& key, double most) {
  if (!value.is_array() || value.size() != Size)
    refuse(key, describe(value), "a list of " + std::to_string(Size) + " numbers");
  Eigen::Matrix<float, Size, 1> out;
  for (int i = 0; i < Size; ++i)
    out[i] = static_cast<float>(number(value[static_cast<std::size_t>(i)], key, -most, most));
  return out;
}

template <int Size>
Eigen::Matrix<float, Size, 1> vector_of(const json& from, const std::string& key, double most) {
  return vector_from<Size>(member(from, key), key, most);
}

const json& list_of(const json& from, const std::string& key, std::size_t least, std::size_t most) {
  const json& value = member(from, key);
  if (!value.is_array() || value.size() < least || value.size() > most)
    refuse(key, value.is_array() ? std::to_string(value.size()) + " entries" : describe(value),
           "a list of " + std::to_string(least) + " to " + std::to_string(most));
  return value;
}

json level_to_json(const MarblesLevel& level) {
  json out = {{"start", list(level.start)},       {"start_height", level.start_height},
              {"goal", list(level.goal)},         {"goal_height", level.goal_height},
              {"goal_radius", level.goal_radius}, {"coins", json::array()},
              {"ramps", json::array()},           {"loose", json::array()}};
  for (const MarblesCoin& coin : level.coins)
    out["coins"].push_back({{"place", list(coin.place)}, {"height", coin.height}, {"taken", coin.taken}});
  for (const TableRamp& ramp : level.ramps)
    out["ramps"].push_back({{"foot", list(ramp.foot)},
                            {"uphill", list(ramp.uphill)},
                            {"length", ramp.length},
                            {"landing", ramp.landing},
                            {"half_width", ramp.half_width},
                            {"height", ramp.height}});
  for (const Eigen::Vector2f& place : level.loose) out["loose"].push_back(list(place));
  return out;
}

MarblesLevel level_from_json(const json& from) {
  MarblesLevel level;
  level.start = vector_of<2>(from, "start", kFarthest);
  level.start_height = real_of(from, "start_height", 0, kFarthest);
  level.goal = vector_of<2>(from, "goal", kFarthest);
  level.goal_height = real_of(from, "goal_height", 0, kFarthest);
  level.goal_radius = real_of(from, "goal_radius", 0.1, 10);
  for (const json& coin : list_of(from, "coins", 0, kMarblesMostCoins))
    level.coins.push_back(
        {vector_of<2>(coin, "place", kFarthest), real_of(coin, "height", 0, kFarthest), bool_of(coin, "taken")});
  for (const json& item : list_of(from, "ramps", 0, kMarblesMostRamps)) {
    TableRamp ramp;
    ramp.foot = vector_of<2>(item, "foot", kFarthest);
    ramp.uphill = vector_of<2>(item, "uphill", 1.001);
    if (std::abs(ramp.uphill.norm() - 1) > 1e-3f) refuse("uphill", format(ramp.uphill.norm()), "a vector of length 1");
    ramp.length = real_of(item, "length", 0.1, 100);
    ramp.landing = real_of(item, "landing", 0, 100);
    ramp.half_width = real_of(item, "half_width", 0.1, 100);
    ramp.height = real_of(item, "height", 0.01, 100);
    level.ramps.push_back(ramp);
  }
  for (const json& place : list_of(from, "loose", 0, kMarblesMostLoose))
    level.loose.push_back(vector_from<2>(place, "loose", kFarthest));
  return level;
}

json marble_to_json(const MarbleMotion& marble) {
  return {{"position", list(marble.position)},
          {"velocity", list(marble.velocity)},
          {"spin", list(marble.spin)},
          {"rotation", list(Eigen::Vector4f(marble.rotation.coeffs()))}};
}

MarbleMotion marble_from_json(const json& from) {
  MarbleMotion marble;
  marble.position = vector_of<3>(from, "position", kFarthest);
  marble.velocity = vector_of<3>(from, "velocity", 2 * kMarbleGreatestSpeed);
  marble.spin = vector_of<3>(from, "spin", 1e4);
  const Eigen::Vector4f rotation = vector_of<4>(from, "rotation", 1.001);
  if (std::abs(rotation.norm() - 1) > 1e-3f) refuse("rotation", format(rotation.norm()), "a quaternion of length 1");
  marble.rotation.coeffs() = rotation;
  return marble;
}

}  // namespace

std::string marbles_to_text(const MarblesState& state) {
  json out = {{"game", "marbles"},
              {"version", 1},
              {"seed", state.seed},
              {"difficulty", static_cast<int>(state.difficulty)},
              {"seated", state.seated},
              {"colour_blind_safe", state.colour_blind_safe},
              {"control", static_cast<int>(state.control)},
              {"sensitivity", state.sensitivity},
              {"loose_marbles", state.loose_marbles},
              {"outlines", state.outlines},
              {"unit_m", state.unit_m},
              {"with_obstacles", state.with_obstacles},
              {"phase", static_cast<int>(state.phase)},
              {"news", static_cast<int>(state.news)},
              {"news_ticks", state.news_ticks},
              {"phase_ticks", state.phase_ticks},
              {"level_number", state.level_number},
              {"lives", state.lives},
              {"score", state.score},
              {"ticks_left", state.ticks_left},
              {"level", level_to_json(state.level)},
              {"marbles", json::array()},
              {"respawn_ticks", state.respawn_ticks},
              {"trapped_ticks", state.trapped_ticks},
              {"tilt", list(state.tilt)},
              {"heading", list(state.heading)},
              {"level_attitude", state.level_attitude ? list(*state.level_attitude) : json(nullptr)},
              {"keys_ticks", state.keys_ticks},
              {"charge_ticks", state.charge_ticks}};
  for (const MarbleMotion& marble : state.marbles) out["marbles"].push_back(marble_to_json(marble));
  return out.dump();
}

MarblesState marbles_from_text(const std::string& text) {
  if (text.size() > kLongestText)
    refuse("text", std::to_string(text.size()) + " bytes", "at most " + std::to_string(kLongestText));
  const json from = json::parse(text, nullptr, false);
  if (from.is_discarded()) refuse("text", "no JSON", "an object");
  const json& game = member(from, "game");
  if (!game.is_string() || game.get<std::string>() != "marbles") refuse("game", "another", "marbles");
  whole_of(from, "version", 1, 1);

  MarblesState state;
  const json& seed = member(from, "seed");
  if (!seed.is_number_unsigned()) refuse("seed", describe(seed), "a whole number that is not negative");
  state.seed = seed.get<std::uint64_t>();
  state.difficulty = static_cast<GameDifficulty>(int_of(from, "difficulty", 0, 2));
  state.seated = bool_of(from, "seated");
  state.colour_blind_safe = bool_of(from, "colour_blind_safe");
  state.control = static_cast<MarblesControl>(int_of(from, "control", 0, 1));
  state.sensitivity = number_of(from, "sensitivity", 0.01, 100);
  state.loose_marbles = int_of(from, "loose_marbles", 0, kMarblesMostLoose);
  state.outlines = bool_of(from, "outlines");
  state.unit_m = number_of(from, "unit_m", 1e-9, 1e9);
  state.with_obstacles = bool_of(from, "with_obstacles");
  state.phase = static_cast<MarblesPhase>(int_of(from, "phase", 0, 3));
  state.news = static_cast<MarblesNews>(int_of(from, "news", 0, 7));
  state.news_ticks = int_of(from, "news_ticks", 0, kLongestWait_ticks);
  state.phase_ticks = int_of(from, "phase_ticks", 0, kLongestPhase_ticks);
  state.level_number = int_of(from, "level_number", 1, 1'000'000);
  state.lives = int_of(from, "lives", 0, 99);
  state.score = whole_of(from, "score", 0, 1'000'000'000'000);
  state.ticks_left = int_of(from, "ticks_left", 0, 1'000'000);
  state.level = level_from_json(member(from, "level"));
  for (const json& marble : list_of(from, "marbles", 1, kMarblesMostLoose + 1))
    state.marbles.push_back(marble_from_json(marble));
  state.respawn_ticks = int_of(from, "respawn_ticks", 0, kLongestWait_ticks);
  state.trapped_ticks = int_of(from, "trapped_ticks", 0, kLongestWait_ticks);
  state.tilt = vector_of<2>(from, "tilt", 0.7);
  state.heading = vector_of<2>(from, "heading", 1.001);
  if (std::abs(state.heading.norm() - 1) > 1e-3f)
    refuse("heading", format(state.heading.norm()), "a vector of length 1");
  if (!member(from, "level_attitude").is_null()) state.level_attitude = vector_of<2>(from, "level_attitude", 7);
  state.keys_ticks = int_of(from, "keys_ticks", 0, kLongestWait_ticks);
  state.charge_ticks = int_of(from, "charge_ticks", 0, kLongestWait_ticks);
  return state;
}

}  // namespace parallax
