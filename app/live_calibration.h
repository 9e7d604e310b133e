// Calibrating in the window: a thread looks at the newest frames and takes views by itself (calib/calibration_session),
// solves when there is enough, and says what it found. The window draws coverage, the wanted view and the board as
// seen.
//
// The window's thread calls everything.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "app/live_feed.h"
#include "calib/calibration_session.h"
#include "core/mutex.h"
#include "render/draw_list.h"

namespace parallax {

class LiveCalibration {
 public:
  // Starts the thread. The feed outlives it.
  LiveCalibration(const LiveFeed* feed, const CalibrationTarget& target, int width, int height);
  ~LiveCalibration();
  LiveCalibration(const LiveCalibration&) = delete;
  LiveCalibration& operator=(const LiveCalibration&) = delete;

  struct State {
    CalibrationFrameResult newest;
    CalibrationCoverage coverage;
    WantedView wanted;
    double progress = 0;
    bool solving = false;
    std::optional<CalibrationOutcome> outcome;  // of the last solve
    CalibrationJudgement judgement;
    std::string failure;
  };
  State state() const PARALLAX_EXCLUDES(mutex_);
  const CalibrationTarget& target() const { return target_; }

  // The covered cells, the wanted view's outline and the board's corners as seen, over the camera's image.
  void draw(DrawList* list) const;
  // Solves with the views there are.
  void solve() PARALLAX_EXCLUDES(mutex_);
  void drop_last_view() PARALLAX_EXCLUDES(mutex_);

  enum class Choice { none, use, cancel, print };
  // The panel: what to do next, what was found.
  Choice draw_panel();

 private:
  void run(std::stop_token stop);
  void solve_now(CalibrationSession* session, std::stop_token stop);

  const LiveFeed* feed_;
  CalibrationTarget target_;
  int width_, height_;
  mutable Mutex mutex_;
  State state_ PARALLAX_GUARDED_BY(mutex_);
  bool solve_wanted_ PARALLAX_GUARDED_BY(mutex_) = false, drop_wanted_ PARALLAX_GUARDED_BY(mutex_) = false;
  std::jthread thread_;
};

}  // namespace parallax
