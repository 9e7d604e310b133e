#include "app/run_session.h"

#include "app/session_engine.h"

namespace parallax {
namespace {

constexpr std::size_t kInboxCapacity = 32;

// However a run ends, its companion lets go of the map before that goes.
class CompanionEnd {
 public:
  explicit CompanionEnd(SessionCompanion* companion) : companion_(companion) {}
  ~CompanionEnd() {
    if (companion_ == nullptr) return;
    try {
      companion_->end();
      companion_->finish();
    } catch (const std::exception&) {
      // What the run itself failed of is being told.
    }
  }
  CompanionEnd(const CompanionEnd&) = delete;
  CompanionEnd& operator=(const CompanionEnd&) = delete;

 private:
  SessionCompanion* companion_;
};

RunResult run_lockstep(FrameSource* source, const CameraModel& camera, const RunOptions& options,
                       const FrameObserver& observer, SessionCompanion* companion) {
  RunResult out;
  const auto start = SteadyClock::now();
  SharedMap map;
  begin_with(options, &map);
  MapperInbox inbox(kInboxCapacity);
  Mapper mapper(camera, with_vocabulary(options.mapper), &map, &inbox);
  Tracker tracker(camera, options.tracker, options.automatic_initialisation(), &map, &inbox);
  KeyPresses key_presses(options);
  const auto work = [&] {
    while (mapper.step()) {
    }
  };
  const CompanionEnd at_end(companion);
  if (companion) companion->begin(&map, &inbox, work);
  while (auto frame = source->next()) {
    check_size(*frame, camera, *source);
    ++out.frames_read;
    TrackingResult result = tracker.track(*frame, key_presses.at(frame->index));
    work();
    if (companion) companion->frame(*frame, result);
    if (observer) observer(*frame, result, tracker.map());
    keep_result(std::move(result), options, &out);
    collect_warnings(source, &out);
  }
  collect_warnings(source, &out);
  if (companion) {
    companion->end();
    companion->finish();
  }
  out.mapper = mapper.statistics();
  out.wall_seconds = milliseconds_since(start) * 1e-3;
  collect_map(map, options, &out);
  return out;
}

RunResult run_realtime(FrameSource* source, const CameraModel& camera, const RunOptions& options,
                       const FrameObserver& observer, SessionCompanion* companion) {
  SessionEngine engine(source, camera, options, nullptr);
  const CompanionEnd at_end(companion);
  if (companion) companion->begin(&engine.map(), &engine.inbox(), {});
  engine.start(true);
  KeyPresses key_presses(options);
  const FrameObserver both = [&](const Frame& frame, const TrackingResult& tracked,
                                 const std::shared_ptr<const TrackingSnapshot>& map) {
    if (companion) companion->frame(frame, tracked);
    if (observer) observer(frame, tracked, map);
  };
  engine.track_all([&](int frame) { return key_presses.at(frame); }, both);
  if (companion) companion->end();
  RunResult result = engine.finish();
  if (companion) companion->finish();
  return result;
}

}  // namespace

RunResult run_session(FrameSource* source, const CameraModel& camera, const RunOptions& options,
                      const FrameObserver& observer, SessionCompanion* companion) {
  return options.pace == Pace::lockstep ? run_lockstep(source, camera, options, observer, companion)
                                        : run_realtime(source, camera, options, observer, companion);
}

}  // namespace parallax
