// `parallax live --headless`: the live engine on any source with no window, for robots, tests and long runs.
#include <iostream>
#include <memory>

#include "app/augmented_interface.h"
#include "app/command.h"
#include "app/live_engine.h"
#include "app/live_options.h"
#include "app/live_outputs.h"
#include "app/live_session.h"
#include "app/map_saver.h"
#include "app/output_steps.h"
#include "app/place_vocabulary.h"
#include "app/progress_bar.h"
#include "app/run_drawing.h"
#include "app/run_outputs.h"
#include "app/run_settings.h"
#include "app/session_maps.h"
#include "app/session_recorder.h"
#include "app/source.h"
#include "app/user_settings.h"
#include "core/error.h"

namespace parallax {

namespace {

constexpr std::chrono::milliseconds kPatience{200};

LiveSource open_source_for(const LiveOptions& options, const UserSettings& settings) {
  LiveSourceOptions source_options;
  source_options.camera.colour = !options.video.empty() || !options.record.empty();
  source_options.by_hand = false;
  source_options.threads = 1;
  auto [source, remark] = open_wanted_source(options, settings, read_program_state(state_path()), source_options);
  if (!remark.empty()) std::cerr << "parallax: " << remark << '\n';
  return source;
}

// The lens to go with; a camera of which nothing is known gets an estimate, and the user is told.
CameraModel lens_for(const LiveSource& source) {
  if (source.lens) return *source.lens;
  if (source.width <= 0) throw InputError(source.name + ": carries no calibration; expected --calibration FILE");
  std::cerr
      << "parallax: warning: " << source.name
      << ": not calibrated; going on with an estimated wide-angle lens (`parallax calibrate` makes a calibration)\n";
  return estimated_lens(source.width, source.height);
}

// Until the source ends, the limit is reached, a signal comes or a thread fails. Goes on without a video that fails.
void watch(const LiveOptions& options, bool limited_by_count, LiveSession* session, RunDrawing* drawing,
           MapSaver* saver, SessionMaps* maps, OutputSteps* steps) {
  const auto start = SteadyClock::now();
  ProgressBar line("live", options.frames_limit);
  int newest = -1;
  while (!end_requested()) {
    const std::shared_ptr<const LiveFrame> frame = session->wait_for_newer(newest, kPatience);
    const LiveSession::Statistics statistics = session->statistics();
    if (frame) {
      newest = frame->frame.index;
      if (maps) maps->frame(frame->frame, frame->tracked);
      if (drawing != nullptr && !steps->failed())
        (*steps)([&] { drawing->draw(frame->frame, frame->tracked, frame->map); });
      line.update(statistics.frames_read, state_line(frame->tracked, frame->frames_per_second));
    }
    for (std::string failure = session->take_failure(); !failure.empty(); failure = session->take_failure()) {
      line.clear();
      std::cerr << "parallax: warning: " << failure << '\n';
    }
    if (const std::string message = saver ? saver->take_message() : std::string(); !message.empty()) {
      line.clear();
      std::cerr << "parallax: warning: " << message << '\n';
    }
    for (const MapNews& news : maps ? maps->take_news() : std::vector<MapNews>()) {
      line.clear();
      (news.problem ? std::cerr << "parallax: warning: " : std::cout) << news.text << '\n';
    }
    if (!frame && statistics.source_ended) break;
    if (limited_by_count && statistics.frames_read >= options.frames_limit) break;
    if (options.seconds > 0 && milliseconds_since(start) >= 1000 * options.seconds) break;
  }
}

}  // namespace

int run_live_headless(const LiveOptions& options) {
  const UserSettings settings = read_user_settings(settings_path());
  RunOptions run_options;
  run_options.manual_initialisation = options.init == "manual";
  run_options.kept_frames = kLiveKeptFrames;
  run_options.keep_trajectory = !options.trajectory.empty();
  run_options.merge_maps = settings.merge_maps && !options.no_merge;
  apply_settings(options.settings, &run_options);
  LiveSource source = open_source_for(options, settings);
  const CameraModel lens = lens_for(source);
  // A camera delivers as time passes and is told when it is enough; a recording ends after exactly so many frames.
  const bool limited = options.frames_limit > 0;
  const bool limited_by_count = limited && source.camera != nullptr;
  const std::shared_ptr<FrameSource> frames =
      limited && !limited_by_count ? make_limited(source.frames, options.frames_limit) : source.frames;
  const std::shared_ptr<const MapLibrary> library = open_live_library(options, settings);
  const MapSaverOptions saving =
      library ? begin_library(library, lens) : begin_map_file(options.map, lens, &run_options);
  std::unique_ptr<SessionRecorder> recorder;
  if (!options.record.empty()) recorder = open_recorder(options.record, source, saving);
  std::unique_ptr<RunDrawing> drawing;
  if (!options.video.empty()) {
    RunDrawingOptions wanted;
    wanted.video_path = options.video;
    wanted.pace = DrawingPace::keep_up;
    wanted.manual = run_options.manual_initialisation;
    drawing = std::make_unique<RunDrawing>(lens, source.frames->frames_per_second(), wanted);
  }
  RunResult result;
  OutputSteps steps;
  bool drawn = false;  // every picture of the video
  {
    LiveSession session(frames, lens, run_options, std::move(recorder), [source] { source.stop(); });
    std::unique_ptr<MapSaver> saver;
    if (!options.map.empty() || library)
      saver = std::make_unique<MapSaver>(saving, [&] { return session.copy_map_and_world(); });
    std::unique_ptr<SessionMaps> maps;
    if (library && options.record.empty()) {
      const SessionMapsOptions wanted = session_maps_options(run_options);
      maps = std::make_unique<SessionMaps>(lens, wanted, library, place_vocabulary(), saver.get(),
                                           SessionPort{&session.inbox(), {}, {}});
    }
    watch(options, limited_by_count, &session, drawing.get(), saver.get(), maps.get(), &steps);
    maps.reset();
    result = session.stop();
    drawn = !steps.failed();
    if (saver) steps([&] { saver->finish(); });
  }
  bool video_written = false;
  if (drawing)
    steps([&] {
      drawing->close();
      video_written = drawn;
    });
  for (const SourceWarning& w : result.warnings) std::cerr << "parallax: warning: " << w.text << '\n';
  write_live_outputs(options, source, run_options, lens, result, &steps);
  std::cout << summary_text(result);
  if (video_written) std::cout << "video: " << options.video << '\n';
  if (!options.record.empty()) std::cout << "recording: " << options.record << '\n';
  steps.finish();
  if (tracked_anything(result)) return kExitDone;
  std::cerr << "parallax: tracking never started: " << why_not_started(result) << '\n';
  return kExitFailed;
}

}  // namespace parallax
