// What is kept of the games from one time to the next: high scores, and how the player likes them. JSON, beside the
// program's state ($XDG_DATA_HOME/parallax/games.json). Games that were left are not here but with the map they were
// left on (map/map_document.h).
//
// A value. What cannot be read is none: it is only a convenience.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "games/game.h"

namespace parallax {

struct GameScore {
  std::int64_t score = 0;
  std::string when;  // "2026-11-22", empty: not known
};

struct GameStore {
  static constexpr std::size_t kScoresKept = 10;

  double volume = 0.7;   // of all sounds, 0..1
  double effects = 1.0;  // of what is heard of a game, beside the signals of the program
  bool mute = false, occlusion = true;
  GameDifficulty difficulty = GameDifficulty::normal;
  bool seated = false;
  std::string palette = "okabe_ito";                              // app/game_palette.h
  std::set<std::string> explained;                                // games whose explanation was shown
  std::map<std::string, std::map<std::string, double>> settings;  // by game and name
  std::map<std::string, std::vector<GameScore>> scores;           // by "game/difficulty", best first

  // Keeps a score when it is among the best; its place from 1, 0: it is not. Scores of 0 are none.
  int add_score(const std::string& game, GameDifficulty scored_at, std::int64_t score, const std::string& when);
  const std::vector<GameScore>& best(const std::string& game, GameDifficulty scored_at) const;
  GameOptions options(const std::string& game, std::uint64_t seed) const;
};

const char* difficulty_name(GameDifficulty difficulty);  // "easy"
std::optional<GameDifficulty> difficulty_of(const std::string& name);

// $XDG_DATA_HOME/parallax/games.json; empty when there is no home.
std::string game_store_path();
GameStore read_game_store(const std::string& path);
// Written beside and renamed. Throws RunError.
void write_game_store(const GameStore& store, const std::string& path);

}  // namespace parallax
