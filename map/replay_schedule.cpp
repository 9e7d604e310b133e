#include "map/replay_schedule.h"

#include <utility>

namespace parallax {

class ReplaySchedule::Tracking final : public TrackerSchedule {
 public:
  explicit Tracking(ReplaySchedule* replay) : replay_(*replay) {}

  std::shared_ptr<const TrackingSnapshot> snapshot() override {
    const auto it = replay_.published_.find(replay_.frame_->snapshot);
    PARALLAX_CHECK(it != replay_.published_.end(), "a frame whose map is not ready");
    replay_.published_.erase(replay_.published_.begin(), it);  // frames see newer and newer versions
    return it->second;
  }
  bool try_push(MapperMessage& message) override {
    if (replay_.pushes_ >= replay_.frame_->pushed.size()) replay_.differs("more messages to the mapper");
    if (!replay_.frame_->pushed[replay_.pushes_++]) return false;
    replay_.sent_.push_back(std::move(message));
    return true;
  }
  bool is_ready(const std::future<InitialisationReply>& reply) override {
    if (replay_.questions_ >= replay_.frame_->replied.size()) replay_.differs("more questions to the mapper");
    if (!replay_.frame_->replied[replay_.questions_++]) return false;
    while (reply.wait_for(std::chrono::seconds(0)) != std::future_status::ready)
      if (!replay_.run_step()) replay_.differs("an answer of the mapper is missing");
    return true;
  }

 private:
  ReplaySchedule& replay_;
};

class ReplaySchedule::Mapping final : public MapperSchedule {
 public:
  explicit Mapping(ReplaySchedule* replay) : replay_(*replay) {}

  std::optional<MapperMessage> try_pop() override {
    const StepEntry& step = entry();
    if (step.kind == StepEntry::Kind::work) return std::nullopt;
    take();
    switch (step.kind) {
      case StepEntry::Kind::reset:
        return ResetRequest();
      case StepEntry::Kind::scale: {
        ScaleRequest request;
        request.factor = step.factor;
        return request;
      }
      case StepEntry::Kind::plane: {
        PlaneRequest request;
        request.seed = step.seed;
        return request;
      }
      default:
        break;
    }
    if (replay_.sent_.empty()) replay_.differs("a message of the tracker is missing");
    MapperMessage message = std::move(replay_.sent_.front());
    replay_.sent_.pop_front();
    return message;
  }
  std::optional<MapperMessage> pop(std::stop_token) override { return try_pop(); }
  Interruption interruption() override {
    const StepEntry& step = entry();
    if (step.kind != StepEntry::Kind::work) replay_.differs("the mapper works where it took a message");
    take();
    stop_at_ = step.stopped_at;
    return Interruption::at_poll(step.stopped_at);
  }
  void worked(const Interruption& interruption) override {
    if (interruption.stopped_at() != stop_at_) replay_.differs("the mapper's work took another course");
  }
  void interrupt() override {}

 private:
  const StepEntry& entry() const {
    PARALLAX_CHECK(replay_.next_step_ < replay_.log_.steps.size(), "a step beyond the log");
    return replay_.log_.steps[replay_.next_step_];
  }
  void take() {
    ++replay_.next_step_;
    replay_.step_taken_ = true;
  }
  ReplaySchedule& replay_;
  std::int64_t stop_at_ = 0;
};

ReplaySchedule::ReplaySchedule(ScheduleLog log, SharedMap* map)
    : log_(std::move(log)),
      map_(map),
      tracking_(std::make_unique<Tracking>(this)),
      mapping_(std::make_unique<Mapping>(this)) {
  const auto first = map_->snapshot();
  published_.emplace(first->version, first);
  map_->set_publication_listener([this](std::shared_ptr<const TrackingSnapshot> snapshot) {
    const std::uint64_t version = snapshot->version;
    published_.emplace(version, std::move(snapshot));
  });
}

ReplaySchedule::~ReplaySchedule() { map_->set_publication_listener({}); }

TrackerSchedule* ReplaySchedule::tracker() { return tracking_.get(); }
MapperSchedule* ReplaySchedule::mapper() { return mapping_.get(); }

bool ReplaySchedule::run_step() {
  if (next_step_ >= log_.steps.size()) return false;
  step_taken_ = false;
  mapper_step_();
  if (!step_taken_) differs("the mapper is idle where it worked");
  return true;
}

const FrameEntry* ReplaySchedule::begin_frame(int frame, bool* ended) {
  *ended = at_end();
  if (*ended) return nullptr;
  const FrameEntry& entry = log_.frames[next_frame_];
  if (frame < entry.frame) return nullptr;
  frame_ = &entry;
  pushes_ = questions_ = 0;
  if (frame > entry.frame) {
    // Its images were lost: what comes after cannot be the same.
    *ended = true;
    return nullptr;
  }
  while (!published_.contains(entry.snapshot)) {
    if (published_.rbegin()->first > entry.snapshot) differs("the map it saw is not there");
    if (run_step()) continue;
    *ended = true;
    return nullptr;
  }
  ++next_frame_;
  return &entry;
}

void ReplaySchedule::end_frame() {
  if (pushes_ != frame_->pushed.size()) differs("fewer messages to the mapper");
  if (questions_ != frame_->replied.size()) differs("fewer questions to the mapper");
}

void ReplaySchedule::finish() {
  while (run_step()) {
  }
}

void ReplaySchedule::differs(const std::string& how) const {
  throw ReplayDifference("replay differs at frame " + std::to_string(frame_ ? frame_->frame : 0) + ": " + how);
}

}  // namespace parallax
