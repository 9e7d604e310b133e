// A live session on a synthetic recording, recorded to a file, and its replay: for the tests of both.
#pragma once

#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "app/live_session.h"
#include "app/replay_session.h"
#include "app/session_hash.h"
#include "app/session_recorder.h"
#include "render/synthetic_source.h"

namespace parallax::testing {

// Frames that were made beforehand, so that a session runs at the pace of its time stamps and not of the renderer.
class KeptSource final : public FrameSource {
 public:
  KeptSource(std::shared_ptr<const std::vector<Frame>> frames, const CameraModel& camera)
      : frames_(std::move(frames)), camera_(camera) {}
  std::optional<Frame> next() override {
    return next_ < frames_->size() ? std::optional<Frame>((*frames_)[next_++]) : std::nullopt;
  }
  std::vector<SourceWarning> take_warnings() override { return {}; }
  int frame_count() const override { return static_cast<int>(frames_->size()); }
  double frames_per_second() const override { return 30; }
  std::string description() const override { return "kept frames"; }
  std::optional<CameraModel> calibration() const override { return camera_; }

 private:
  std::shared_ptr<const std::vector<Frame>> frames_;
  CameraModel camera_;
  std::size_t next_ = 0;
};

struct KeptDesk {
  CameraModel camera;
  std::shared_ptr<const std::vector<Frame>> frames;
};

// The synthetic desk from where its slide begins.
inline const KeptDesk& kept_desk() {
  static const KeptDesk desk = [] {
    SourceOptions options;
    options.colour = true;
    options.start_frame = 28;
    options.max_frames = 130;
    const auto source = open_synthetic_source("synthetic:desk", options, 2);
    auto frames = std::make_shared<std::vector<Frame>>();
    while (auto frame = source->next()) frames->push_back(std::move(*frame));
    return KeptDesk{*source->calibration(), frames};
  }();
  return desk;
}

inline void write_bytes(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

// Plays the desk through a live session; `act` is called with every new frame on this thread. Recorded when a recorder
// is given.
inline RunResult run_live(std::unique_ptr<SessionRecorder> recorder, const RunOptions& options,
                          const std::function<void(LiveSession*, const LiveFrame&)>& act,
                          std::vector<std::string>* failures = nullptr) {
  const auto source = std::make_shared<KeptSource>(kept_desk().frames, kept_desk().camera);
  LiveSession session(source, kept_desk().camera, options, std::move(recorder), {});
  int index = -1;
  while (!session.statistics().source_ended) {
    const auto frame = session.wait_for_newer(index, std::chrono::milliseconds(200));
    if (!frame) continue;
    index = frame->frame.index;
    if (act) act(&session, *frame);
  }
  RunResult result = session.stop();
  if (failures) {
    for (std::string failure = session.take_failure(); !failure.empty(); failure = session.take_failure())
      failures->push_back(failure);
  }
  return result;
}

struct Replayed {
  RunResult result;
  ReplayReport report;
};

inline Replayed replay(const std::string& path, const FrameObserver& observer = {}) {
  RecordingSource source(path, {});
  Replayed out;
  out.result = replay_session(&source, RunOptions(), observer, &out.report);
  return out;
}

}  // namespace parallax::testing
