// `parallax run SOURCE`: the tracker and the mapper, headless, on a recording.
#include <iostream>
#include <memory>
#include <string>

#include "app/asset_folder.h"
#include "app/command.h"
#include "app/game_session.h"
#include "app/map_saver.h"
#include "app/output_steps.h"
#include "app/progress_bar.h"
#include "app/replay_session.h"
#include "app/run_drawing.h"
#include "app/run_outputs.h"
#include "app/run_session.h"
#include "app/run_settings.h"
#include "app/screenshot.h"
#include "app/session_maps.h"
#include "app/source.h"
#include "core/error.h"

namespace parallax {
namespace {

struct RunArguments {
  std::string source, calibration, init = "auto", pace;
  std::string trajectory, keyframes, points, map, maps, from, timing, report, video, frames, truth, game, game_picture;
  bool no_occlusion = false, no_loops = false, no_merge = false;
  int start = 0, count = -1, threads = 1;
  double speed = 1.0;
  std::vector<std::string> settings;
};

std::optional<std::pair<int, int>> parse_init(const std::string& text) {
  if (text == "auto") return std::nullopt;
  const auto comma = text.find(',');
  const auto number = [&](const std::string& part) {
    std::size_t used = 0;
    int value = -1;
    try {
      value = std::stoi(part, &used);
    } catch (const std::exception&) {
      used = 0;
    }
    if (part.empty() || used != part.size() || value < 0)
      throw InputError("--init: found '" + text + "', expected auto or two frame numbers A,B");
    return value;
  };
  if (comma == std::string::npos)
    throw InputError("--init: found '" + text + "', expected auto or two frame numbers A,B");
  const std::pair<int, int> frames{number(text.substr(0, comma)), number(text.substr(comma + 1))};
  if (frames.first >= frames.second)
    throw InputError("--init: found '" + text + "', expected the second frame after the first");
  return frames;
}

// Frame numbers that the source does not have; a source of unknown length is believed.
void check_frame_numbers(const RunArguments& args, const RunOptions& options, int frames) {
  if (frames == 0) throw InputError(args.source + ": found no frame at or after --start " + std::to_string(args.start));
  if (!options.key_presses) return;
  const auto [first, second] = *options.key_presses;
  if (first < args.start)
    throw InputError("--init: found '" + args.init + "', expected frames from " + std::to_string(args.start) +
                     " on, where --start begins");
  if (frames > 0 && second >= args.start + frames)
    throw InputError("--init: found '" + args.init + "', expected frames up to " +
                     std::to_string(args.start + frames - 1) + ", the last of " + args.source);
}

Trajectory true_trajectory(const FrameSource& frames, const std::string& name) {
  Trajectory out;
  for (const StampedPose& pose : frames.ground_truth()) out.push_back({pose.time, pose.world_from_camera});
  if (out.empty()) throw InputError("--truth: " + name + " carries no true poses");
  return out;
}

// A recorded session is replayed as it ran, unless something else is asked for: null then.
RecordingSource* source_to_replay(const RunArguments& args, const OpenedSource& opened) {
  auto* recording = dynamic_cast<RecordingSource*>(opened.frames.get());
  const bool possible = recording && can_replay(*recording);
  const bool changed = args.init != "auto" || args.start > 0 || !args.calibration.empty() || !args.settings.empty() ||
                       !args.from.empty() || !args.maps.empty() || args.no_loops;
  if (args.pace == "replay") {
    if (!possible) throw InputError("--pace replay: " + args.source + " is no recorded session");
    if (changed) throw InputError("--pace replay: a session is replayed with its own settings, found others");
  }
  return possible && !changed && (args.pace.empty() || args.pace == "replay") ? recording : nullptr;
}

int run(RunArguments args) {
  RunOptions options;
  options.key_presses = parse_init(args.init);
  options.speed = args.speed;
  options.mapper.threads = args.threads;
  options.mapper.close_loops = !args.no_loops;
  options.merge_maps = !args.no_merge;
  apply_settings(args.settings, &options);
  const std::optional<GameRequest> game =
      args.game.empty() ? std::nullopt : std::optional(parse_game_request(args.game));
  const bool draws = !args.video.empty() || !args.frames.empty();
  SourceOptions source_options;
  source_options.colour = draws;
  source_options.start_frame = args.start;
  source_options.max_frames = args.count;
  OpenedSource opened = open_source(args.source, args.calibration, source_options);
  RecordingSource* const replayed = source_to_replay(args, opened);
  if (args.pace.empty()) args.pace = replayed ? "replay" : "realtime";
  options.pace = args.pace == "lockstep" ? Pace::lockstep : Pace::realtime;
  if (!args.from.empty()) options.initial_map = open_initial_map(args.from, opened.camera);
  if (replayed) options = recorded_options(*replayed, options);
  const int total = opened.frames->frame_count();
  check_frame_numbers(args, options, total);
  const double fps = opened.frames->frames_per_second();
  const Trajectory truth = args.truth.empty() ? Trajectory{} : true_trajectory(*opened.frames, args.source);
  const std::vector<StampedPose> true_poses = game ? opened.frames->ground_truth() : std::vector<StampedPose>{};
  std::unique_ptr<FrameSource> source = std::move(opened.frames);
  if (!replayed) source = make_read_ahead(std::move(source));
  std::unique_ptr<RunDrawing> drawing;
  if (draws || game) {
    RunDrawingOptions wanted;
    wanted.video_path = args.video;
    wanted.frames_folder = args.frames;
    wanted.pace = args.pace == "realtime" ? DrawingPace::keep_up : DrawingPace::wait;
    wanted.manual = !options.automatic_initialisation();
    wanted.occlusion = !args.no_occlusion;
    wanted.game = game;
    if (game) wanted.models = std::make_shared<const ModelSet>(ModelSet::load(asset_folder("models")));
    drawing = std::make_unique<RunDrawing>(opened.camera, fps, wanted);
  }
  std::unique_ptr<RunMaps> maps;
  if (!args.maps.empty()) {
    check_map_folder(args.maps);
    maps = std::make_unique<RunMaps>(opened.camera, options, std::make_shared<const MapLibrary>(args.maps));
  }
  RunResult result;
  ReplayReport replay;
  OutputSteps steps;
  {
    ProgressBar progress("tracking", total);
    int done = 0;
    const FrameObserver observer = [&](const Frame& frame, const TrackingResult& tracked,
                                       const std::shared_ptr<const TrackingSnapshot>& map) {
      if (drawing && !steps.failed()) steps([&] { drawing->draw(frame, tracked, map); });
      progress.update(++done, to_string(tracked.state));
    };
    result = replayed ? replay_session(replayed, options, observer, &replay)
                      : run_session(source.get(), opened.camera, options, observer, maps.get());
  }
  if (drawing) steps([&] { drawing->close(); });
  const bool video_written = !args.video.empty() && !steps.failed();
  std::optional<GameOutcome> played = drawing ? drawing->game() : std::nullopt;
  if (played) played->drift = measure_drift(played->sights, true_poses, opened.camera);
  for (const SourceWarning& w : result.warnings) std::cerr << "parallax: warning: " << w.text << '\n';
  if (!args.trajectory.empty()) steps([&] { write_trajectory_tum(tracked_trajectory(result), args.trajectory); });
  if (!args.truth.empty()) steps([&] { write_trajectory_tum(truth, args.truth); });
  if (!args.keyframes.empty()) steps([&] { write_trajectory_tum(keyframe_trajectory(result), args.keyframes); });
  if (!args.points.empty()) steps([&] { write_points_ply(result.map, args.points); });
  if (!args.map.empty()) steps([&] { write_run_map(result, opened.camera, args.map); });
  if (!args.game_picture.empty()) {
    if (played && !played->picture.empty())
      steps([&] { write_game_picture(played->picture, args.game_picture); });
    else
      std::cerr << "parallax: warning: --game-picture: the game left no picture\n";
  }
  if (!args.timing.empty()) steps([&] { write_timing_csv(result, args.timing); });
  if (!args.report.empty()) {
    const ReportContext context{args.source, PARALLAX_VERSION, args.pace, args.init, fps, &opened.camera, &options};
    steps([&] { write_report_json(result, context, args.report, played ? &*played : nullptr); });
  }
  std::cout << summary_text(result);
  for (const MapNews& news : maps ? maps->news() : std::vector<MapNews>())
    std::cout << (news.frame >= 0 ? "frame " + std::to_string(news.frame) + ": " : "") << news.text << '\n';
  if (played) std::cout << game_text(*played);
  if (video_written) std::cout << "video: " << args.video << '\n';
  if (drawing && drawing->left_out() > 0)
    std::cerr << "parallax: warning: " << drawing->left_out() << " frames were not drawn, which took too long\n";
  steps.finish();
  if (replayed && replay.verdict == ReplayReport::Verdict::different) {
    std::cerr << "parallax: " << replay.text << '\n';
    return kExitFailed;
  }
  if (replayed) std::cout << replay.text << '\n';
  if (tracked_anything(result)) return kExitDone;
  std::cerr << "parallax: tracking never started: " << why_not_started(result) << '\n';
  return kExitFailed;
}

}  // namespace

void add_run_command(CLI::App& app, int* exit_code) {
  auto args = std::make_shared<RunArguments>();
  CLI::App* command = app.add_subcommand("run", "Track and map a recording, headless");
  command
      ->add_option("source", args->source,
                   "Video file, data-set folder, image folder, recorded session, or synthetic:NAME")
      ->required();
  command->add_option("--calibration", args->calibration, "Calibration file; default: the one the source carries");
  command->add_option("--init", args->init, "auto, or the frame numbers A,B of the two key presses")
      ->capture_default_str();
  command
      ->add_option("--pace", args->pace,
                   "realtime: frames arrive at their time stamps; lockstep: deterministic; replay: as a recorded "
                   "session ran, the default for those, else realtime")
      ->check(CLI::IsMember({"realtime", "lockstep", "replay"}));
  command->add_option("--speed", args->speed, "Realtime: frames arrive so many times faster than their time stamps say")
      ->check(CLI::Range(0.001, 1000.0))
      ->capture_default_str();
  command->add_option("--start", args->start, "First frame")->check(CLI::NonNegativeNumber);
  command->add_option("--frames-limit", args->count, "At most so many frames")->check(CLI::Range(1, 1000000000));
  command->add_option("--threads", args->threads, "Threads of one bundle adjustment")->check(CLI::Range(1, 64));
  command->add_flag("--no-loops", args->no_loops, "Do not close loops");
  command->add_option("--trajectory", args->trajectory, "Write every tracked pose (TUM form)");
  command->add_option("--keyframes", args->keyframes, "Write the keyframes' poses (TUM form)");
  command->add_option("--points", args->points, "Write the map's points (PLY)");
  CLI::Option* map =
      command->add_option("--map", args->map, "Write the map, to go on with later (`parallax map info`)");
  CLI::Option* from =
      command->add_option("--from", args->from, "Begin with this saved map, and with finding the place on it");
  command
      ->add_option("--maps", args->maps,
                   "Keep every map in this folder, and go over to the one that knows the place: several maps")
      ->excludes(map)
      ->excludes(from);
  command->add_flag("--no-merge", args->no_merge, "With --maps: do not merge maps that meet");
  command->add_option("--timing", args->timing, "Write a row a frame (CSV)");
  command->add_option("--report", args->report, "Write counts, timings and settings (JSON)");
  command->add_option("--truth", args->truth, "Write the source's true poses, where it carries them (TUM form)");
  command->add_option("--video", args->video, "Write the recording with the overlay drawn in (.mp4 or .avi)");
  command->add_option("--frames", args->frames, "Write each drawn frame as a PNG into this folder");
  command->add_option(
      "--game", args->game,
      "A game played by its script on the mapped table: swarm, burning_glass or marbles, with settings as "
      "in swarm?seed=3&difficulty=hard");
  command
      ->add_option("--game-picture", args->game_picture,
                   "With --game burning_glass: what was burnt, as a PNG with transparency")
      ->needs("--game");
  command->add_flag("--no-occlusion", args->no_occlusion, "With --game: real things do not hide virtual ones");
  command->add_option("--set", args->settings, "NAME=VALUE: an option of the tracker or mapper (may be repeated)");
  command->callback([args, exit_code] { *exit_code = run(*args); });
}

}  // namespace parallax
