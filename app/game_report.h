// How a game went: for the report and for the reader of `run --game`.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "app/game_session.h"

namespace parallax {

struct GameOutcome {
  std::string name, title;
  std::uint64_t seed = 0, state_hash = 0;  // of the last state; 0: it never began
  std::int64_t score = 0, ticks = 0;
  bool over = false;
  std::vector<std::string> lines;  // of its display
  cv::Mat4b picture;               // what it leaves: Game::picture()
  std::vector<GameSight> sights;   // of its landmarks, frame by frame
  std::optional<GameDrift> drift;  // of them; where the source has true poses
};

GameOutcome outcome_of(const GameSession& session, const GameOptions& options);
// {"name": "swarm", "seed": 1, "score": 1200, "seconds": 42.5, "state": "9f3c...", "over": false, "lines": [...],
//  "drift": {"frames": 300, "things": 1, "median_px": 0.8, "largest_px": 2.1}}; the drift where it is known
nlohmann::json to_json(const GameOutcome& outcome);
// A line for the user.
std::string game_text(const GameOutcome& outcome);

}  // namespace parallax
