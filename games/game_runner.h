// Time and tracking, turned into ticks: plays a game at its fixed rate for as long as the camera's pose is known, stops
// it when tracking is lost, and counts down before it goes on.
//
// One thread at a time. No clock: time is what advance() is told.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "games/game.h"

namespace parallax {

enum class GamePhase {
  idle,      // start() was not called
  playing,   // ticks pass
  paused,    // by the player
  lost,      // no pose
  resuming,  // the pose is back, or the player is: the count-down runs
  over       // the game has ended
};

// How long the game plays on with the last pose when there is none: a single bad frame is no reason to stop.
inline constexpr double kGameGrace_s = 0.25;
inline constexpr double kGameCountDown_s = 3.0;

class GameRunner {
 public:
  explicit GameRunner(std::unique_ptr<Game> game);  // never null

  Game& game() { return *game_; }
  const Game& game() const { return *game_; }
  const GameOptions& options() const { return options_; }

  // From the beginning; the clock of the game stands at 0.
  void start(const PlayingField& field, const GameOptions& options);
  // The game is in a state of its own making (Game::restore): goes on after a count-down.
  void resume(const GameOptions& options);
  void change_field(const PlayingField& field);

  // Time has passed, with this input all the while. Longer than a quarter of a second counts as that: a stopped program
  // does not make the game run away. Seconds that are not finite or negative count as none.
  void advance(double seconds, const GameInput& input);
  // The script plays in the place of the player's input; only the pose is taken from that.
  void set_scripted(bool scripted) { scripted_ = scripted; }

  void pause();
  void toggle_pause();  // out of it by the count-down

  GamePhase phase() const { return phase_; }
  double resumes_in_s() const { return phase_ == GamePhase::resuming ? count_down_s_ : 0; }
  std::int64_t ticks() const { return ticks_; }
  // Sounds of the count-down and of the game since the last call.
  std::vector<GameSound> take_sounds();

 private:
  void begin_count_down();
  void play(double seconds, GameInput input);

  std::unique_ptr<Game> game_;
  GameOptions options_;
  GamePhase phase_ = GamePhase::idle;
  bool scripted_ = false;
  double without_pose_s_ = 0, count_down_s_ = 0;
  std::int64_t left_ns_ = 0;  // of time, less than a tick
  std::int64_t ticks_ = 0;
  std::optional<RigidTransform> last_pose_;
  std::vector<GameSound> sounds_;
};

}  // namespace parallax
