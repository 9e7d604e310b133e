// Reads a live source on a thread of its own, so that it can be shown before (and between) sessions: the newest frame
// for the preview and the calibration, and a tap for the session that tracks it. Sessions come and go, the source stays
// open.
//
// Public members may be called from any thread.
#pragma once

#include <chrono>
#include <condition_variable>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "app/source.h"
#include "core/bounded_queue.h"
#include "core/mutex.h"

namespace parallax {

class LiveFeed {
 public:
  // Starts reading. A recording is played at the pace of its time stamps.
  explicit LiveFeed(LiveSource source);
  ~LiveFeed();  // stops the source
  LiveFeed(const LiveFeed&) = delete;
  LiveFeed& operator=(const LiveFeed&) = delete;

  const LiveSource& source() const { return source_; }
  // The newest frame; null before the first.
  std::shared_ptr<const Frame> newest() const PARALLAX_EXCLUDES(mutex_);
  // Waits for another frame than this one, at most so long; null when none came.
  std::shared_ptr<const Frame> wait_for_other(const std::shared_ptr<const Frame>& than,
                                              std::chrono::milliseconds at_most) const PARALLAX_EXCLUDES(mutex_);
  // The frames from now on, for one session: a camera whose stop() ends the tap and not the source. The tap before it
  // ends. Frames nobody takes are dropped, the oldest first.
  std::shared_ptr<LiveCamera> tap() PARALLAX_EXCLUDES(mutex_);

  CameraStatus status() const;
  bool ended() const PARALLAX_EXCLUDES(mutex_);
  // What the source complained of, or failed of, since the last call: one line each.
  std::vector<std::string> take_messages() PARALLAX_EXCLUDES(mutex_);

 private:
  class Tap;
  void read(std::stop_token stop);
  void publish(Frame frame);

  LiveSource source_;
  mutable Mutex mutex_;
  mutable std::condition_variable_any arrived_;
  std::shared_ptr<const Frame> newest_ PARALLAX_GUARDED_BY(mutex_);
  std::shared_ptr<Tap> tap_ PARALLAX_GUARDED_BY(mutex_);
  bool ended_ PARALLAX_GUARDED_BY(mutex_) = false;
  std::vector<std::string> messages_ PARALLAX_GUARDED_BY(mutex_);
  std::jthread thread_;
};

}  // namespace parallax
