#include "app/game_report.h"

#include <cstdio>
#include <nlohmann/json.hpp>

namespace parallax {
namespace {

double seconds_of(const GameOutcome& outcome) { return static_cast<double>(outcome.ticks) * kGameTick_s; }

std::string hexadecimal(std::uint64_t value) {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(value));
  return text;
}

}  // namespace

GameOutcome outcome_of(const GameSession& session, const GameOptions& options) {
  const GameRunner& runner = session.runner();
  GameOutcome out;
  out.name = session.name();
  out.title = runner.game().info().title;
  out.seed = options.seed;
  if (runner.phase() == GamePhase::idle) return out;
  const GameHud hud = runner.game().hud();
  out.state_hash = runner.game().state_hash();
  out.score = hud.score;
  out.ticks = runner.ticks();
  out.over = runner.phase() == GamePhase::over;
  out.lines = hud.lines;
  out.picture = runner.game().picture();
  return out;
}

nlohmann::json to_json(const GameOutcome& outcome) {
  nlohmann::json out = {{"name", outcome.name},
                        {"seed", outcome.seed},
                        {"score", outcome.score},
                        {"seconds", seconds_of(outcome)},
                        {"state", hexadecimal(outcome.state_hash)},
                        {"over", outcome.over},
                        {"lines", outcome.lines}};
  if (outcome.drift) {
    out["drift"] = {{"frames", outcome.drift->frames},
                    {"things", outcome.drift->things},
                    {"median_px", outcome.drift->median_px},
                    {"largest_px", outcome.drift->largest_px}};
  }
  return out;
}

std::string game_text(const GameOutcome& outcome) {
  if (outcome.ticks == 0) return "game: " + outcome.title + " never began: no table was mapped\n";
  char time[32];
  std::snprintf(time, sizeof time, "%.1f s", seconds_of(outcome));
  std::string text = "game: " + outcome.title + ", " + time + ", score " + std::to_string(outcome.score);
  for (const std::string& line : outcome.lines) text += ", " + line;
  if (outcome.drift) {
    char drift[96];
    std::snprintf(drift, sizeof drift, ", drift %.2f px (median of %d frames)", outcome.drift->median_px,
                  outcome.drift->frames);
    text += drift;
  }
  return text + (outcome.over ? ", over\n" : "\n");
}

}  // namespace parallax
