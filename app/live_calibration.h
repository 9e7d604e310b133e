// Calibrating in the window: a thread looks at the newest frames and takes views by itself (calib/calibration_session);
// another solves when there is enough, while views go on being taken. The window draws coverage, the wanted view and
// the board as seen over the camera's image, and a panel under it that says what to do next and what was found.
//
// The window's thread calls everything.
#pragma once

#include <future>
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
    SteadyClock::time_point newest_time{}, kept_time{};  // when it came, and when the last view was taken
    CalibrationCoverage coverage;
    WantedView wanted;
    double progress = 0;
    bool solving = false;
    std::optional<CalibrationOutcome> outcome;  // of the last solve
    CalibrationJudgement judgement;
    std::string failure;
    // The lens is known well enough: nothing more has to be shown.
    bool enough() const { return outcome && outcome->ok && judgement.enough; }
  };
  State state() const PARALLAX_EXCLUDES(mutex_);
  // The last solve was good enough.
  bool enough() const PARALLAX_EXCLUDES(mutex_);

  // The covered cells, the wanted view's outline, the board's corners as seen, and a frame around the image when a view
  // was taken, all over the camera's image.
  void draw(DrawList* list) const;
  // Solves with the views there are.
  void solve() PARALLAX_EXCLUDES(mutex_);
  void drop_last_view() PARALLAX_EXCLUDES(mutex_);

  enum class Choice { none, use, cancel, print };
  // The panel, along the lower edge of the window: what to do next, what was found.
  Choice draw_panel();
  // How much of the window it takes, in the interface's pixels: the picture is drawn above it, so that nothing of the
  // board is hidden.
  float panel_height() const { return panel_height_; }

 private:
  void run(std::stop_token stop);
  void take_outcome(CalibrationSession* session, CalibrationOutcome outcome);

  const LiveFeed* feed_;
  CalibrationTarget target_;
  int width_, height_;
  float panel_height_ = 110;  // until it has been drawn
  mutable Mutex mutex_;
  State state_ PARALLAX_GUARDED_BY(mutex_);
  bool solve_wanted_ PARALLAX_GUARDED_BY(mutex_) = false, drop_wanted_ PARALLAX_GUARDED_BY(mutex_) = false;
  std::jthread thread_;
};

}  // namespace parallax
