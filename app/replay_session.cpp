#include "app/replay_session.h"

#include "app/session_engine.h"
#include "app/session_hash.h"
#include "app/session_options.h"
#include "core/error.h"
#include "map/map_file.h"
#include "map/replay_schedule.h"

namespace parallax {
namespace {

const std::string* entry(const RecordingHeader& header, const std::string& name) {
  const auto it = header.find(name);
  return it == header.end() ? nullptr : &it->second;
}

// One replay: tracker, mapper and what they answer each other.
class Replay {
 public:
  Replay(RecordingSource* source, const RunOptions& options)
      : source_(*source),
        camera_(camera_of(*source)),
        options_(recorded_options(*source, options)),
        schedule_(parse_schedule(source->contents().schedule, source->description()), &map_),
        mapper_(camera_, with_vocabulary(options_.mapper), &map_, schedule_.mapper()),
        tracker_(camera_, options_.tracker, options_.automatic_initialisation(), schedule_.tracker()) {
    begin_with(options_, &map_);
    schedule_.set_mapper_step([this] { return mapper_.step(); });
  }

  RunResult run(const FrameObserver& observer, ReplayReport* report) {
    const auto start = SteadyClock::now();
    try {
      run_frames(observer, report);
    } catch (const ReplayDifference& difference) {
      *report = {ReplayReport::Verdict::different, report->frames_compared, difference.what()};
    }
    collect_warnings(&source_, &out_);
    out_.mapper = mapper_.statistics();
    out_.wall_seconds = milliseconds_since(start) * 1e-3;
    collect_map(map_, options_, &out_);
    return std::move(out_);
  }

 private:
  static CameraModel camera_of(const RecordingSource& source) {
    if (const auto camera = source.calibration()) return *camera;
    throw InputError(source.description() + ": found no calibration, expected the one it was recorded with");
  }

  void run_frames(const FrameObserver& observer, ReplayReport* report) {
    bool ended = false;
    while (!ended) {
      const auto frame = source_.next();
      if (!frame) break;
      ++out_.frames_read;
      const FrameEntry* logged = schedule_.begin_frame(frame->index, &ended);
      if (ended) break;
      if (!logged) {
        ++out_.frames_dropped;  // the tracker was not ready for it then
        continue;
      }
      TrackingResult result = tracker_.track(*frame, logged->key);
      schedule_.end_frame();
      const bool same = hash_of(result) == logged->result_hash;
      if (same) ++report->frames_compared;
      if (observer) observer(*frame, result, tracker_.map());
      keep_result(std::move(result), options_, &out_);
      if (!same) throw ReplayDifference("replay differs at frame " + std::to_string(frame->index) + ": another result");
      collect_warnings(&source_, &out_);
    }
    finish(report);
  }

  void finish(ReplayReport* report) {
    const auto& summary = source_.contents().summary;
    const std::string frames = std::to_string(report->frames_compared) + " frames";
    if (!summary || !schedule_.at_end()) {
      report->verdict = ReplayReport::Verdict::incomplete;
      report->text = "replay: identical for " + frames + "; there the recording " +
                     (summary ? "lacks a frame" : "ends, as the session was cut off");
      return;
    }
    schedule_.finish();
    const std::string* hash = entry(*summary, "map_hash");
    const bool same_map = hash && *hash == std::to_string(hash_of(map_.read([](const Map& m) { return m; })));
    report->verdict = same_map ? ReplayReport::Verdict::identical : ReplayReport::Verdict::different;
    report->text = same_map ? "replay: identical, " + frames + " and the map"
                            : "replay: " + frames + " are identical, the last map differs";
  }

  RecordingSource& source_;
  CameraModel camera_;
  RunOptions options_;
  SharedMap map_;
  ReplaySchedule schedule_;
  Mapper mapper_;
  Tracker tracker_;
  RunResult out_;
};

}  // namespace

bool can_replay(const RecordingSource& source) {
  return !source.contents().schedule.empty() && entry(source.contents().header, "options") != nullptr;
}

RunOptions recorded_options(const RecordingSource& source, const RunOptions& others) {
  RunOptions out = others;
  const std::string* text = entry(source.contents().header, "options");
  if (!text) throw InputError(source.description() + ": found no settings, expected those it was recorded with");
  const RunOptions recorded = parse_exact_options(*text, source.description());
  out.tracker = recorded.tracker;
  out.mapper = recorded.mapper;
  out.initial_map.reset();
  if (const std::string* map = entry(source.contents().header, "map"))
    out.initial_map = std::make_shared<const MapDocument>(
        read_map_bytes(std::as_bytes(std::span(*map)), source.description() + ": the map it began with"));
  out.key_presses.reset();
  out.manual_initialisation = recorded.manual_initialisation;
  return out;
}

RunResult replay_session(RecordingSource* source, const RunOptions& options, const FrameObserver& observer,
                         ReplayReport* report) {
  *report = ReplayReport();
  return Replay(source, options).run(observer, report);
}

}  // namespace parallax
