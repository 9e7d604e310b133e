#include "app/run_session.h"

#include "app/session_engine.h"

namespace parallax {
namespace {

constexpr std::size_t kInboxCapacity = 32;

RunResult run_lockstep(FrameSource* source, const CameraModel& camera, const RunOptions& options,
                       const FrameObserver& observer) {
  RunResult out;
  const auto start = SteadyClock::now();
  SharedMap map;
  begin_with(options, &map);
  MapperInbox inbox(kInboxCapacity);
  Mapper mapper(camera, options.mapper, &map, &inbox);
  Tracker tracker(camera, options.tracker, options.automatic_initialisation(), &map, &inbox);
  KeyPresses key_presses(options);
  while (auto frame = source->next()) {
    check_size(*frame, camera, *source);
    ++out.frames_read;
    TrackingResult result = tracker.track(*frame, key_presses.at(frame->index));
    while (mapper.step()) {
    }
    if (observer) observer(*frame, result, tracker.map());
    keep_result(std::move(result), options, &out);
    collect_warnings(source, &out);
  }
  collect_warnings(source, &out);
  out.mapper = mapper.statistics();
  out.wall_seconds = milliseconds_since(start) * 1e-3;
  collect_map(map, options, &out);
  return out;
}

RunResult run_realtime(FrameSource* source, const CameraModel& camera, const RunOptions& options,
                       const FrameObserver& observer) {
  SessionEngine engine(source, camera, options, nullptr);
  engine.start(true);
  KeyPresses key_presses(options);
  engine.track_all([&](int frame) { return key_presses.at(frame); }, observer);
  return engine.finish();
}

}  // namespace

RunResult run_session(FrameSource* source, const CameraModel& camera, const RunOptions& options,
                      const FrameObserver& observer) {
  return options.pace == Pace::lockstep ? run_lockstep(source, camera, options, observer)
                                        : run_realtime(source, camera, options, observer);
}

}  // namespace parallax
