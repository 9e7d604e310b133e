#include "map/schedule_log.h"

#include <cstring>

#include "core/error.h"

namespace parallax {
namespace {

// A frame asks and sends a handful of times.
constexpr int kMostAnswers = 64;
// The first byte of an entry: a frame's, or a step's kind with this added.
constexpr std::uint8_t kFrameTag = 1, kStepTag = 16;
constexpr std::uint8_t kLastKind = static_cast<std::uint8_t>(StepEntry::Kind::plane);

template <class T>
void put(T value, std::string* bytes) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  bytes->append(raw, sizeof(T));
}

void put_answers(const std::vector<std::uint8_t>& answers, std::string* bytes) {
  put(static_cast<std::uint8_t>(answers.size()), bytes);
  for (std::uint8_t a : answers) put(a, bytes);
}

class Reader {
 public:
  Reader(std::span<const std::uint8_t> bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  bool at_end() const { return at_ == bytes_.size(); }
  template <class T>
  T take() {
    if (bytes_.size() - at_ < sizeof(T)) fail("the end", "more of an entry");
    T value;
    std::memcpy(&value, bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }
  bool take_flag() {
    const auto value = take<std::uint8_t>();
    if (value > 1) fail(std::to_string(value), "0 or 1");
    return value == 1;
  }
  std::vector<std::uint8_t> take_answers() {
    const auto n = take<std::uint8_t>();
    if (n > kMostAnswers) fail(std::to_string(n) + " answers", "at most " + std::to_string(kMostAnswers));
    std::vector<std::uint8_t> out;
    for (int i = 0; i < n; ++i) out.push_back(take_flag() ? 1 : 0);
    return out;
  }
  [[noreturn]] void fail(const std::string& found, const std::string& expected) const {
    throw InputError(name_ + ": schedule, byte " + std::to_string(at_) + ": found " + found + ", expected " + expected);
  }

 private:
  std::span<const std::uint8_t> bytes_;
  const std::string& name_;
  std::size_t at_ = 0;
};

FrameEntry take_frame(Reader* in) {
  FrameEntry e;
  e.frame = in->take<std::int32_t>();
  if (e.frame < 0) in->fail("frame " + std::to_string(e.frame), "0 or more");
  e.key = in->take_flag();
  e.snapshot = in->take<std::uint64_t>();
  e.pushed = in->take_answers();
  e.replied = in->take_answers();
  e.result_hash = in->take<std::uint64_t>();
  return e;
}

StepEntry take_step(std::uint8_t tag, Reader* in) {
  StepEntry e;
  if (tag < kStepTag || tag - kStepTag > kLastKind) in->fail("tag " + std::to_string(tag), "an entry");
  e.kind = static_cast<StepEntry::Kind>(tag - kStepTag);
  if (e.kind == StepEntry::Kind::work) {
    e.stopped_at = in->take<std::int64_t>();
    if (e.stopped_at < 0) in->fail("stop " + std::to_string(e.stopped_at), "0 or more");
  } else if (e.kind == StepEntry::Kind::scale) {
    e.factor = in->take<double>();
  } else if (e.kind == StepEntry::Kind::plane && in->take_flag()) {
    Eigen::Vector3d seed;
    for (int i = 0; i < 3; ++i) seed[i] = in->take<double>();
    e.seed = seed;
  }
  return e;
}

}  // namespace

void write_entry(const ScheduleEntry& entry, std::string* bytes) {
  if (const auto* frame = std::get_if<FrameEntry>(&entry)) {
    PARALLAX_CHECK(frame->pushed.size() <= kMostAnswers && frame->replied.size() <= kMostAnswers,
                   "a frame that asked the mapper too often");
    put(kFrameTag, bytes);
    put(static_cast<std::int32_t>(frame->frame), bytes);
    put(static_cast<std::uint8_t>(frame->key), bytes);
    put(frame->snapshot, bytes);
    put_answers(frame->pushed, bytes);
    put_answers(frame->replied, bytes);
    put(frame->result_hash, bytes);
    return;
  }
  const auto& step = std::get<StepEntry>(entry);
  put(static_cast<std::uint8_t>(kStepTag + static_cast<std::uint8_t>(step.kind)), bytes);
  if (step.kind == StepEntry::Kind::work) {
    put(step.stopped_at, bytes);
  } else if (step.kind == StepEntry::Kind::scale) {
    put(step.factor, bytes);
  } else if (step.kind == StepEntry::Kind::plane) {
    put(static_cast<std::uint8_t>(step.seed.has_value()), bytes);
    if (step.seed)
      for (int i = 0; i < 3; ++i) put((*step.seed)[i], bytes);
  }
}

ScheduleLog parse_schedule(std::span<const std::uint8_t> bytes, const std::string& name) {
  ScheduleLog log;
  Reader in(bytes, name);
  while (!in.at_end()) {
    const auto tag = in.take<std::uint8_t>();
    if (tag != kFrameTag) {
      log.steps.push_back(take_step(tag, &in));
      continue;
    }
    FrameEntry frame = take_frame(&in);
    if (!log.frames.empty() && frame.frame <= log.frames.back().frame)
      in.fail("frame " + std::to_string(frame.frame) + " after " + std::to_string(log.frames.back().frame),
              "frames in order");
    log.frames.push_back(std::move(frame));
  }
  return log;
}

std::shared_ptr<const TrackingSnapshot> RecordingTrackerSchedule::snapshot() {
  auto out = LiveTrackerSchedule::snapshot();
  entry_.snapshot = out->version;
  return out;
}

bool RecordingTrackerSchedule::try_push(MapperMessage& message) {
  const bool pushed = LiveTrackerSchedule::try_push(message);
  entry_.pushed.push_back(pushed ? 1 : 0);
  return pushed;
}

bool RecordingTrackerSchedule::is_ready(const std::future<InitialisationReply>& reply) {
  const bool ready = LiveTrackerSchedule::is_ready(reply);
  entry_.replied.push_back(ready ? 1 : 0);
  return ready;
}

void RecordingMapperSchedule::worked(const Interruption& interruption) {
  StepEntry e;
  e.stopped_at = interruption.stopped_at();
  sink_(e);
}

std::optional<MapperMessage> RecordingMapperSchedule::noted(std::optional<MapperMessage> message) {
  if (!message) return message;
  StepEntry e;
  e.kind = StepEntry::Kind::message;
  if (std::holds_alternative<ResetRequest>(*message)) {
    e.kind = StepEntry::Kind::reset;
  } else if (const auto* scale = std::get_if<ScaleRequest>(&*message)) {
    e.kind = StepEntry::Kind::scale;
    e.factor = scale->factor;
  } else if (const auto* plane = std::get_if<PlaneRequest>(&*message)) {
    e.kind = StepEntry::Kind::plane;
    e.seed = plane->seed;
  }
  sink_(e);
  return message;
}

}  // namespace parallax
