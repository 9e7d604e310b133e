#include "games/swarm_archive.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "core/error.h"
#include "games/swarm_rules.h"

namespace parallax::swarm {
namespace {

using Json = nlohmann::json;

constexpr const char* kFormat = "parallax swarm";
constexpr int kVersion = 2;
constexpr std::size_t kMostText = 1u << 20;  // a full state has about 100 kB
constexpr int kMostNesting = 8;              // a state has five
constexpr int kManyTicks = 1'000'000'000;
constexpr double kFar = 10;         // nothing is further from the middle, in radii
constexpr double kFast = 50;        // nothing is faster, in radii a second
constexpr double kHalfTurn = 3.15;  // radians, and a little

// What is in the state, once for all three that go through it: `a` is a Writer, a Reader or a Hasher.
template <class A>
void describe(A& a, Critter& c) {
  a.choice("kind", c.kind, kKinds);
  a.choice("phase", c.phase, 5);
  a.pair("position", c.position, kFar);
  a.pair("velocity", c.velocity, kFast);
  a.number("height", c.height, -1, 2);
  a.number("rise", c.rise, -kFast, kFast);
  a.number("heading", c.heading, -kHalfTurn, kHalfTurn);
  a.number("walked", c.walked, 0, 2000);
  a.whole("health", c.health, 1, 1000);
  a.whole("full_health", c.full_health, 1, 1000);
  a.whole("phase_ticks", c.phase_ticks, 0, kManyTicks);
  a.whole("rest_ticks", c.rest_ticks, 0, ticks(60));
  a.whole("hurt_ticks", c.hurt_ticks, 0, ticks(60));
  a.whole("side", c.side, -1, 1);
}

template <class A>
void describe(A& a, Bolt& b) {
  a.pair("position", b.position, kFar);
  a.pair("direction", b.direction, 1.001);
  a.whole("ticks_left", b.ticks_left, 0, kBoltLife);
}

template <class A>
void describe(A& a, Spit& s) {
  a.pair("position", s.position, kFar);
  a.pair("velocity", s.velocity, kFast);
  a.number("height", s.height, -1, 5);
  a.number("rise", s.rise, -kFast, kFast);
}

template <class A>
void describe(A& a, Pickup& p) {
  a.choice("kind", p.kind, 4);
  a.pair("position", p.position, kFar);
  a.whole("ticks_left", p.ticks_left, 0, kPickupLife);
}

template <class A>
void describe(A& a, Robot& r) {
  a.pair("position", r.position, kFar);
  a.pair("velocity", r.velocity, kFast);
  a.number("heading", r.heading, -kHalfTurn, kHalfTurn);
  a.number("rolled", r.rolled, 0, 2000);
  a.pair("aim", r.aim, 1.001);
  a.pair("right", r.right, 1.001);
  a.pair("sight", r.sight, kFar);
  a.pair("reticle", r.reticle, kFar);
  a.number("steer", r.steer, -kHalfTurn, kHalfTurn);
  a.whole("health", r.health, 0, kFullHealth);
  a.whole("reload_ticks", r.reload_ticks, 0, kReload);
  a.whole("rapid_ticks", r.rapid_ticks, 0, kRapidTicks);
  a.whole("shield_ticks", r.shield_ticks, 0, kShieldTicks);
  a.whole("hurt_ticks", r.hurt_ticks, 0, kGrace);
  a.whole("bombs", r.bombs, 0, kMostBombs);
  a.flag("act_was_down", r.act_was_down);
}

template <class A>
void describe(A& a, Wave& w) {
  a.whole("number", w.number, 1, 9999);
  a.whole("pause_ticks", w.pause_ticks, 0, kWavePause);
  a.whole("ticks", w.ticks, 0, kManyTicks);
  a.whole("release_ticks", w.release_ticks, 0, ticks(60));
  for (std::size_t k = 0; k < w.to_release.size(); ++k)
    a.whole(rules_of(static_cast<CritterKind>(k)).model, w.to_release[k], 0, kMostInWave);
  a.number("gate_a", w.gates[0], -kHalfTurn, kHalfTurn);
  a.number("gate_b", w.gates[1], -kHalfTurn, kHalfTurn);
  a.number("gate_c", w.gates[2], -kHalfTurn, kHalfTurn);
}

template <class A>
void describe(A& a, State& s) {
  a.choice("difficulty", s.difficulty, 3);
  a.flag("seated", s.seated);
  a.flag("colour_blind_safe", s.colour_blind_safe);
  a.number("horde", s.horde, 0.5, 2);
  a.number("aim_assist", s.aim_assist, 0, 1);
  a.number("unit_share", s.unit_share, kLeastUnitShare, 1);
  a.word("random", s.random);
  a.whole("tick", s.tick, std::int64_t{0}, std::int64_t{1} << 53);
  a.whole("score", s.score, std::int64_t{0}, std::int64_t{1} << 53);
  a.whole("kills", s.kills, 0, kManyTicks);
  a.whole("shots", s.shots, 0, kManyTicks);
  a.whole("hits", s.hits, 0, kManyTicks);
  a.whole("chain", s.chain, 0, kManyTicks);
  a.whole("chain_ticks", s.chain_ticks, 0, kChainTicks);
  a.whole("best_chain", s.best_chain, 0, kManyTicks);
  a.flag("over", s.over);
  a.pair("home", s.home, kFar);
  a.object("robot", s.robot);
  a.object("wave", s.wave);
  a.list("critters", s.critters, kMostCritters);
  a.list("bolts", s.bolts, kMostBolts);
  a.list("spits", s.spits, kMostSpits);
  a.list("pickups", s.pickups, kMostPickups);
}

class Writer {
 public:
  Json json = Json::object();
  template <class T>
  void whole(const char* name, T& value, T, T) {
    json[name] = value;
  }
  void word(const char* name, std::uint64_t& value) { json[name] = value; }
  void number(const char* name, double& value, double, double) { json[name] = value; }
  void flag(const char* name, bool& value) { json[name] = value; }
  void pair(const char* name, Eigen::Vector2d& value, double) { json[name] = Json::array({value.x(), value.y()}); }
  template <class E>
  void choice(const char* name, E& value, int) {
    json[name] = static_cast<int>(value);
  }
  template <class T>
  void object(const char* name, T& value) {
    Writer inner;
    describe(inner, value);
    json[name] = std::move(inner.json);
  }
  template <class T>
  void list(const char* name, std::vector<T>& values, int) {
    Json array = Json::array();
    for (T& value : values) {
      Writer inner;
      describe(inner, value);
      array.push_back(std::move(inner.json));
    }
    json[name] = std::move(array);
  }
};

class Hasher {
 public:
  std::uint64_t hash = 14695981039346656037ull;
  void mix(std::uint64_t value) { hash = (hash ^ value) * 0x9E3779B97F4A7C15ull, hash ^= hash >> 29; }
  template <class T>
  void whole(const char*, T& value, T, T) {
    mix(static_cast<std::uint64_t>(static_cast<std::int64_t>(value)));
  }
  void word(const char*, std::uint64_t& value) { mix(value); }
  void number(const char*, double& value, double, double) { mix(std::bit_cast<std::uint64_t>(value)); }
  void flag(const char*, bool& value) { mix(value ? 1 : 2); }
  void pair(const char*, Eigen::Vector2d& value, double) {
    mix(std::bit_cast<std::uint64_t>(value.x()));
    mix(std::bit_cast<std::uint64_t>(value.y()));
  }
  template <class E>
  void choice(const char*, E& value, int) {
    mix(static_cast<std::uint64_t>(value));
  }
  template <class T>
  void object(const char*, T& value) {
    describe(*this, value);
  }
  template <class T>
  void list(const char*, std::vector<T>& values, int) {
    mix(values.size());
    for (T& value : values) describe(*this, value);
  }
};

class Reader {
 public:
  Reader(const Json& json, std::string where) : json_(json), where_(std::move(where)) {
    if (!json.is_object()) refuse(where_, json, "an object");
  }
  // Nothing that was not asked for.
  void finish() const {
    if (json_.size() == asked_) return;
    throw InputError("saved swarm game: " + name_of("") + ": found " + std::to_string(json_.size()) +
                     " values, expected " + std::to_string(asked_));
  }

  template <class T>
  void whole(const char* name, T& value, T least, T most) {
    const Json& found = at(name);
    const std::string expected = "a whole number from " + std::to_string(least) + " to " + std::to_string(most);
    if (!found.is_number_integer()) refuse(name_of(name), found, expected);
    if (found.is_number_unsigned() && found.get<std::uint64_t>() > static_cast<std::uint64_t>(most))
      refuse(name_of(name), found, expected);
    const auto read = found.get<std::int64_t>();
    if (read < static_cast<std::int64_t>(least) || read > static_cast<std::int64_t>(most))
      refuse(name_of(name), found, expected);
    value = static_cast<T>(read);
  }
  void word(const char* name, std::uint64_t& value) {
    const Json& found = at(name);
    if (!found.is_number_unsigned()) refuse(name_of(name), found, "a whole number of 64 bits");
    value = found.get<std::uint64_t>();
  }
  void number(const char* name, double& value, double least, double most) {
    value = bounded(at(name), name, least, most);
  }
  void flag(const char* name, bool& value) {
    const Json& found = at(name);
    if (!found.is_boolean()) refuse(name_of(name), found, "true or false");
    value = found.get<bool>();
  }
  void pair(const char* name, Eigen::Vector2d& value, double most) {
    const Json& found = at(name);
    if (!found.is_array() || found.size() != 2) refuse(name_of(name), found, "two numbers");
    value = {bounded(found[0], name, -most, most), bounded(found[1], name, -most, most)};
  }
  template <class E>
  void choice(const char* name, E& value, int count) {
    int index = 0;
    whole(name, index, 0, count - 1);
    value = static_cast<E>(index);
  }
  template <class T>
  void object(const char* name, T& value) {
    Reader inner(at(name), name_of(name));
    describe(inner, value);
    inner.finish();
  }
  template <class T>
  void list(const char* name, std::vector<T>& values, int most) {
    const Json& found = at(name);
    if (!found.is_array()) refuse(name_of(name), found, "a list");
    if (found.size() > static_cast<std::size_t>(most))
      throw InputError("saved swarm game: " + name_of(name) + ": found " + std::to_string(found.size()) +
                       " entries, expected at most " + std::to_string(most));
    values.clear();
    for (std::size_t i = 0; i < found.size(); ++i) {
      Reader inner(found[i], name_of(name) + "[" + std::to_string(i) + "]");
      T value;
      describe(inner, value);
      inner.finish();
      values.push_back(value);
    }
  }

 private:
  std::string name_of(const std::string& name) const {
    if (where_.empty()) return name.empty() ? "the game" : name;
    return name.empty() ? where_ : where_ + "." + name;
  }
  [[noreturn]] static void refuse(const std::string& name, const Json& found, const std::string& expected) {
    const bool plain = found.is_number() || found.is_boolean() || found.is_null();
    throw InputError("saved swarm game: " + name + ": found " +
                     (plain ? found.dump() : std::string(found.type_name())) + ", expected " + expected);
  }
  const Json& at(const char* name) {
    const auto found = json_.find(name);
    if (found == json_.end())
      throw InputError("saved swarm game: " + name_of(name) + ": found nothing, expected a value");
    ++asked_;
    return *found;
  }
  double bounded(const Json& found, const char* name, double least, double most) const {
    const double value = found.is_number() ? found.get<double>() : std::numeric_limits<double>::quiet_NaN();
    if (!std::isfinite(value) || value < least || value > most)
      refuse(name_of(name), found, "a number from " + std::to_string(least) + " to " + std::to_string(most));
    return value;
  }

  const Json& json_;
  std::string where_;
  std::size_t asked_ = 0;
};

// What no single value tells.
void check_together(const State& state) {
  const auto refuse = [](const std::string& what) { throw InputError("saved swarm game: " + what); };
  for (const Eigen::Vector2d* direction : {&state.robot.aim, &state.robot.right})
    if (std::abs(direction->norm() - 1) > 1e-6)
      refuse("robot: found a direction of length " + std::to_string(direction->norm()) + ", expected 1");
  for (const Bolt& bolt : state.bolts)
    if (std::abs(bolt.direction.norm() - 1) > 1e-6)
      refuse("bolts: found a direction of length " + std::to_string(bolt.direction.norm()) + ", expected 1");
  for (const Critter& critter : state.critters)
    if (critter.side == 0) refuse("critters: found side 0, expected -1 or 1");
  if (state.over != (state.robot.health == 0)) refuse("over: found a game that is over with health, or the reverse");
}

// Before anything is built of it. No text in a saved game has brackets, so that they need not be told apart.
int nesting_of(const std::string& text) {
  int level = 0, most = 0;
  for (const char c : text) {
    if (c == '[' || c == '{') most = std::max(most, ++level);
    if (c == ']' || c == '}') --level;
  }
  return most;
}

}  // namespace

std::string save_state(const State& state) {
  State copy = state;
  Writer writer;
  describe(writer, copy);
  const Json json = {{"format", kFormat}, {"version", kVersion}, {"game", std::move(writer.json)}};
  return json.dump();
}

State restore_state(const std::string& text) {
  if (text.size() > kMostText)
    throw InputError("saved swarm game: found " + std::to_string(text.size()) + " bytes, expected at most " +
                     std::to_string(kMostText));
  if (nesting_of(text) > kMostNesting)
    throw InputError("saved swarm game: found more than " + std::to_string(kMostNesting) +
                     " levels of brackets, expected a saved game of Swarm");
  const Json json = Json::parse(text, nullptr, false);
  if (json.is_discarded()) throw InputError("saved swarm game: found text that is not JSON, expected a saved game");
  const bool framed = json.is_object() && json.size() == 3 && json.contains("format") && json["format"] == kFormat &&
                      json.contains("version") && json.contains("game");
  if (!framed) throw InputError("saved swarm game: found other JSON, expected a saved game of Swarm");
  if (json["version"] != kVersion)
    throw InputError("saved swarm game: version: found another one, expected " + std::to_string(kVersion));
  State state;
  Reader reader(json["game"], "");
  describe(reader, state);
  reader.finish();
  check_together(state);
  return state;
}

std::uint64_t hash_of(const State& state) {
  State copy = state;
  Hasher hasher;
  describe(hasher, copy);
  return hasher.hash;
}

}  // namespace parallax::swarm
