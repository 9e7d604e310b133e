#include "app/session_recorder.h"

#include <chrono>
#include <utility>

#include "app/session_options.h"
#include "camera/recording_source.h"
#include "core/error.h"

namespace parallax {
namespace {

// The schedule is written at this interval at the latest.
constexpr std::chrono::milliseconds kFlush{300};

}  // namespace

SessionRecorder::SessionRecorder(const std::string& path, const RecordingDescription& description)
    : path_(path), description_(description), writer_(path) {}

SessionRecorder::~SessionRecorder() { end_thread(); }

void SessionRecorder::begin(const CameraModel& camera, const RunOptions& options, double frames_per_second) {
  RecordingHeader header;
  header["program"] = std::string("parallax ") + PARALLAX_VERSION;
  header["source"] = description_.source;
  header["frames_per_second"] = std::to_string(frames_per_second);
  header["calibration"] = exact_text(camera);
  header["options"] = exact_text(options);
  if (!description_.map.empty()) header["map"] = description_.map;
  for (const auto& [name, value] : description_.camera) header["camera." + name] = value;
  writer_.write_header(header);
  thread_ = std::jthread([this] { run(); });
}

std::unique_ptr<TrackerSchedule> SessionRecorder::tracker_schedule(const SharedMap* map, MapperInbox* inbox) {
  auto out = std::make_unique<RecordingTrackerSchedule>(map, inbox);
  tracking_ = out.get();
  return out;
}

std::unique_ptr<MapperSchedule> SessionRecorder::mapper_schedule(MapperInbox* inbox) {
  return std::make_unique<RecordingMapperSchedule>(inbox, [this](const StepEntry& entry) { add_entry(entry); });
}

void SessionRecorder::add_frame(const Frame& frame) {
  {
    MutexLock lock(mutex_);
    if (failed_ || ended_) return;
    if (frames_.size() >= description_.queue) {
      ++dropped_;
      return;
    }
    frames_.push_back(frame);
  }
  wake_.notify_one();
}

void SessionRecorder::frame_tracked(int frame, bool key, std::uint64_t result_hash) {
  FrameEntry entry = tracking_->take_entry();
  entry.frame = frame;
  entry.key = key;
  entry.result_hash = result_hash;
  add_entry(entry);
}

void SessionRecorder::add_entry(const ScheduleEntry& entry) {
  MutexLock lock(mutex_);
  if (failed_ || ended_) return;
  write_entry(entry, &entries_);
}

// Frames one by one; the entries that have gathered go before the frame that follows them in time, or after a while.
void SessionRecorder::run() {
  for (auto flushed = SteadyClock::now();;) {
    std::optional<Frame> frame;
    std::string entries;
    bool ended = false;
    {
      MutexLock lock(mutex_);
      wake_.wait_until(mutex_, flushed + kFlush,
                       [this]() PARALLAX_REQUIRES(mutex_) { return ended_ || failed_ || !frames_.empty(); });
      if (!frames_.empty()) {
        frame = std::move(frames_.front());
        frames_.pop_front();
      }
      ended = ended_ && frames_.empty();
      if (ended || SteadyClock::now() - flushed >= kFlush) {
        entries.swap(entries_);
        flushed = SteadyClock::now();
      }
    }
    if (!write_some(std::move(frame), entries) || ended) return;
  }
}

bool SessionRecorder::write_some(std::optional<Frame> frame, const std::string& entries) {
  try {
    if (frame) writer_.write_frame(*frame);
    if (!entries.empty()) writer_.write_schedule(entries);
    MutexLock lock(mutex_);
    if (frame) ++written_;
    return true;
  } catch (const std::exception& e) {
    MutexLock lock(mutex_);
    failed_ = true;
    failure_ = std::string("recording ended, the session goes on without: ") + e.what();
    frames_.clear();
    entries_.clear();
    entries_.shrink_to_fit();
    return false;
  }
}

void SessionRecorder::end_thread() {
  {
    MutexLock lock(mutex_);
    ended_ = true;
  }
  wake_.notify_one();
  if (thread_.joinable()) thread_.join();
}

void SessionRecorder::finish(std::uint64_t map_hash) {
  end_thread();
  MutexLock lock(mutex_);
  if (failed_) return;
  RecordingHeader summary;
  summary["map_hash"] = std::to_string(map_hash);
  summary["frames"] = std::to_string(written_);
  summary["frames_dropped"] = std::to_string(dropped_);
  try {
    writer_.write_end(summary);
  } catch (const std::exception& e) {
    failed_ = true;
    failure_ = e.what();
  }
}

int SessionRecorder::frames_dropped() const {
  MutexLock lock(mutex_);
  return dropped_;
}

bool SessionRecorder::recording() const {
  MutexLock lock(mutex_);
  return !failed_ && !ended_;
}

std::string SessionRecorder::take_failure() {
  MutexLock lock(mutex_);
  return std::exchange(failure_, {});
}

}  // namespace parallax
