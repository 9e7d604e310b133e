#include "games/game_runner.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "core/check.h"

namespace parallax {
namespace {

constexpr double kLongestStep_s = 0.25;
// Ticks are counted in whole nanoseconds, so that frames of 33.3 ms give the same ticks on every machine.
constexpr std::int64_t kTick_ns = 1'000'000'000 / kGameTicksPerSecond;

}  // namespace

GameRunner::GameRunner(std::unique_ptr<Game> game) : game_(std::move(game)) {
  PARALLAX_CHECK(game_ != nullptr, "a runner needs a game");
}

void GameRunner::start(const PlayingField& field, const GameOptions& options) {
  options_ = options;
  game_->start(field, options);
  phase_ = GamePhase::playing;
  without_pose_s_ = count_down_s_ = 0;
  left_ns_ = ticks_ = 0;
  last_pose_.reset();
  sounds_.clear();
}

void GameRunner::resume(const GameOptions& options) {
  options_ = options;
  left_ns_ = ticks_ = 0;
  last_pose_.reset();
  begin_count_down();
}

void GameRunner::change_field(const PlayingField& field) {
  if (phase_ != GamePhase::idle) game_->change_field(field);
}

void GameRunner::begin_count_down() {
  phase_ = GamePhase::resuming;
  count_down_s_ = kGameCountDown_s;
  sounds_.push_back({"countdown", 1, 1, std::nullopt});
}

void GameRunner::pause() {
  if (phase_ == GamePhase::playing || phase_ == GamePhase::resuming || phase_ == GamePhase::lost)
    phase_ = GamePhase::paused;
}

void GameRunner::toggle_pause() {
  if (phase_ == GamePhase::paused) {
    without_pose_s_ = 0;
    begin_count_down();
  } else {
    pause();
  }
}

void GameRunner::advance(double seconds, const GameInput& input) {
  if (!std::isfinite(seconds) || seconds < 0) seconds = 0;
  seconds = std::min(seconds, kLongestStep_s);
  if (input.camera_from_plane) {
    last_pose_ = input.camera_from_plane;
    without_pose_s_ = 0;
  } else {
    without_pose_s_ += seconds;
  }
  // Before the first pose there is none to go on with.
  const bool posed = input.camera_from_plane || (last_pose_ && without_pose_s_ <= kGameGrace_s);
  switch (phase_) {
    case GamePhase::idle:
    case GamePhase::paused:
    case GamePhase::over:
      return;
    case GamePhase::lost:
      if (input.camera_from_plane) begin_count_down();
      return;
    case GamePhase::resuming: {
      if (!posed) {
        phase_ = GamePhase::lost;
        return;
      }
      const double before = count_down_s_;
      count_down_s_ -= seconds;
      if (count_down_s_ <= 0) {
        phase_ = GamePhase::playing;
        sounds_.push_back({"resume", 1, 1, std::nullopt});
      } else if (std::ceil(count_down_s_) < std::ceil(before)) {
        sounds_.push_back({"countdown", 1, 1, std::nullopt});
      }
      return;
    }
    case GamePhase::playing:
      if (!posed) {
        phase_ = GamePhase::lost;
        return;
      }
      break;
  }
  play(seconds, input);
}

void GameRunner::play(double seconds, GameInput input) {
  if (!input.camera_from_plane) input.camera_from_plane = last_pose_;
  left_ns_ += std::llround(seconds * 1e9);
  while (left_ns_ >= kTick_ns) {
    left_ns_ -= kTick_ns;
    ++ticks_;
    game_->step(scripted_ ? game_->scripted_input(input.camera_from_plane) : input);
    if (game_->is_over()) {
      phase_ = GamePhase::over;
      left_ns_ = 0;
      return;
    }
  }
}

std::vector<GameSound> GameRunner::take_sounds() {
  std::vector<GameSound> out = game_->take_sounds();
  out.insert(out.end(), std::make_move_iterator(sounds_.begin()), std::make_move_iterator(sounds_.end()));
  sounds_.clear();
  return out;
}

}  // namespace parallax
