#include "app/game_store.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "app/game_palette.h"
#include "app/user_settings.h"
#include "core/error.h"
#include "core/file_io.h"

namespace parallax {
namespace {

constexpr std::array<const char*, 3> kDifficulties{"easy", "normal", "hard"};
// A few kilobytes as it is written here.
constexpr std::uintmax_t kLargestFile = 32u << 20;

std::string key_of(const std::string& game, GameDifficulty difficulty) {
  return game + "/" + difficulty_name(difficulty);
}

// The value of a key when it is there and of the kind of `out`.
void take(const nlohmann::json& from, const char* key, bool* out) {
  const auto it = from.find(key);
  if (it != from.end() && it->is_boolean()) *out = it->get<bool>();
}

void take_share(const nlohmann::json& from, const char* key, double* out) {
  const auto it = from.find(key);
  if (it == from.end() || !it->is_number()) return;
  const double share = it->get<double>();
  if (std::isfinite(share)) *out = std::clamp(share, 0.0, 1.0);
}

void take_palette(const nlohmann::json& from, GameStore* store) {
  const auto it = from.find("palette");
  if (it != from.end() && it->is_string()) {
    store->palette = game_palette(it->get<std::string>()).name;
    return;
  }
  bool safe = true;  // how it was kept before palettes had names
  take(from, "colour_blind_safe", &safe);
  if (!safe) store->palette = "vivid";
}

void take_scores(const nlohmann::json& from, GameStore* store) {
  if (!from.is_object()) return;
  for (const auto& [name, list] : from.items()) {
    if (!list.is_array()) continue;
    std::vector<GameScore>& scores = store->scores[name];
    for (const auto& entry : list) {
      if (!entry.is_object() || !entry.contains("score") || !entry["score"].is_number_integer()) continue;
      GameScore score{entry["score"].get<std::int64_t>(), ""};
      if (entry.contains("when") && entry["when"].is_string())
        score.when = entry["when"].get<std::string>().substr(0, 10);
      if (scores.size() < GameStore::kScoresKept) scores.push_back(score);
    }
    std::stable_sort(scores.begin(), scores.end(), [](const auto& a, const auto& b) { return a.score > b.score; });
  }
}

GameStore parse(const nlohmann::json& json) {
  GameStore store;
  if (!json.is_object()) return store;
  take_share(json, "volume", &store.volume);
  take_share(json, "effects", &store.effects);
  take(json, "mute", &store.mute);
  take(json, "occlusion", &store.occlusion);
  take(json, "seated", &store.seated);
  take_palette(json, &store);
  if (const auto it = json.find("explained"); it != json.end() && it->is_array())
    for (const auto& name : *it)
      if (name.is_string()) store.explained.insert(name.get<std::string>());
  if (json.contains("difficulty") && json["difficulty"].is_string()) {
    store.difficulty = difficulty_of(json["difficulty"].get<std::string>()).value_or(store.difficulty);
  }
  if (json.contains("settings") && json["settings"].is_object()) {
    for (const auto& [game, values] : json["settings"].items()) {
      if (!values.is_object()) continue;
      for (const auto& [name, value] : values.items())
        if (value.is_number() && std::isfinite(value.get<double>())) store.settings[game][name] = value.get<double>();
    }
  }
  if (json.contains("scores")) take_scores(json["scores"], &store);
  return store;
}

}  // namespace

const char* difficulty_name(GameDifficulty difficulty) { return kDifficulties[static_cast<std::size_t>(difficulty)]; }

std::optional<GameDifficulty> difficulty_of(const std::string& name) {
  const auto at = std::find(kDifficulties.begin(), kDifficulties.end(), name);
  if (at == kDifficulties.end()) return std::nullopt;
  return static_cast<GameDifficulty>(at - kDifficulties.begin());
}

int GameStore::add_score(const std::string& game, GameDifficulty scored_at, std::int64_t score,
                         const std::string& when) {
  if (score <= 0) return 0;
  std::vector<GameScore>& list = scores[key_of(game, scored_at)];
  const auto place =
      std::find_if(list.begin(), list.end(), [&](const GameScore& other) { return other.score < score; });
  const auto index = static_cast<std::size_t>(place - list.begin());
  if (index >= kScoresKept) return 0;
  list.insert(place, {score, when});
  if (list.size() > kScoresKept) list.resize(kScoresKept);
  return static_cast<int>(index) + 1;
}

const std::vector<GameScore>& GameStore::best(const std::string& game, GameDifficulty scored_at) const {
  static const std::vector<GameScore> none;
  const auto it = scores.find(key_of(game, scored_at));
  return it != scores.end() ? it->second : none;
}

GameOptions GameStore::options(const std::string& game, std::uint64_t seed) const {
  GameOptions out;
  out.seed = seed;
  out.difficulty = difficulty;
  out.seated = seated;
  if (const auto it = settings.find(game); it != settings.end())
    for (const auto& [name, value] : it->second) out.settings.emplace_back(name, value);
  return out;
}

std::string game_store_path() {
  const std::string state = state_path();
  if (state.empty()) return "";
  return (std::filesystem::path(state).parent_path() / "games.json").string();
}

GameStore read_game_store(const std::string& path) {
  std::error_code error;
  const std::uintmax_t size = path.empty() ? 0 : std::filesystem::file_size(path, error);
  if (path.empty() || error || size > kLargestFile) return {};
  std::ifstream in(path);
  const nlohmann::json json = nlohmann::json::parse(in, nullptr, false);
  return json.is_discarded() ? GameStore{} : parse(json);
}

void write_game_store(const GameStore& store, const std::string& path) {
  if (path.empty()) return;
  nlohmann::json json;
  json["volume"] = store.volume;
  json["effects"] = store.effects;
  json["mute"] = store.mute;
  json["occlusion"] = store.occlusion;
  json["difficulty"] = difficulty_name(store.difficulty);
  json["seated"] = store.seated;
  json["palette"] = store.palette;
  json["explained"] = store.explained;
  json["settings"] = store.settings;
  json["scores"] = nlohmann::json::object();
  for (const auto& [name, list] : store.scores) {
    nlohmann::json& out = json["scores"][name] = nlohmann::json::array();
    for (const GameScore& score : list) out.push_back({{"score", score.score}, {"when", score.when}});
  }
  std::error_code error;
  std::filesystem::create_directories(std::filesystem::path(path).parent_path(), error);
  write_file_atomically(path, [&](std::ostream& out) {
    out << json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
  });
}

}  // namespace parallax
