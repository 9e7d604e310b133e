// `parallax slam SOURCE`: stereo visual SLAM, headless, on a recording.
#include <iostream>
#include <memory>
#include <string>

#include "app/command.h"
#include "app/named_settings.h"
#include "app/output_steps.h"
#include "app/progress_bar.h"
#include "app/slam_maps.h"
#include "app/slam_outputs.h"
#include "app/slam_session.h"
#include "app/stereo_input.h"
#include "core/error.h"

namespace parallax {
namespace {

struct SlamArguments {
  std::string source, calibration, pace = "realtime";
  std::string trajectory, final_trajectory, keyframes, points, graph, timing, report, truth;
  SlamMapPaths maps;
  int start = 0, count = -1;
  double speed = 1.0;
  std::vector<std::string> settings;
};

void apply_slam_settings(const std::vector<std::string>& settings, SlamOptions* options) {
  StereoTrackerOptions& t = options->tracker;
  StereoWindowOptions& w = options->window;
  apply_named_settings(settings, {{"stereo.features", &t.features},
                                  {"stereo.min_distance_px", &t.min_distance_px},
                                  {"stereo.min_corner_score", &t.min_corner_score},
                                  {"stereo.few_features", &t.few_features},
                                  {"stereo.min_inliers", &t.min_inliers},
                                  {"stereo.min_correlation", &t.min_correlation},
                                  {"stereo.max_round_trip_px", &t.max_round_trip_px},
                                  {"stereo.max_row_difference_px", &t.max_row_difference_px},
                                  {"stereo.nearest_m", &t.nearest_m},
                                  {"stereo.sigma_px", &t.sigma_px},
                                  {"stereo.keyframe_distance_m", &t.keyframe_distance_m},
                                  {"stereo.keyframe_angle_rad", &t.keyframe_angle_rad},
                                  {"stereo.keyframe_kept", &t.keyframe_kept},
                                  {"window.poses", &w.poses},
                                  {"window.kept_poses", &w.kept_poses},
                                  {"window.sigma_px", &w.sigma_px},
                                  {"window.min_poses_per_point", &w.min_poses_per_point},
                                  {"window.max_iterations", &w.solver.max_iterations}});
  t.validate();
  w.validate();
}

int slam(const SlamArguments& args) {
  SlamOptions options;
  options.pace = args.pace == "lockstep" ? Pace::lockstep : Pace::realtime;
  options.speed = args.speed;
  apply_slam_settings(args.settings, &options);
  SourceOptions source_options;
  source_options.start_frame = args.start;
  source_options.max_frames = args.count;
  const StereoInput input = open_stereo_input(args.source, args.calibration, source_options);
  const double fps = input.source->frames_per_second();
  Trajectory truth;
  for (const StampedPose& pose : input.source->ground_truth()) truth.push_back({pose.time, pose.world_from_camera});
  if (!args.truth.empty() && truth.empty()) throw InputError("--truth: " + args.source + " carries no true poses");

  SlamMaps maps(args.maps);
  SlamKeyframeObserver on_keyframe;
  if (args.maps.any())
    on_keyframe = [&](const StereoKeyframe& keyframe, const StereoWindow& window) {
      maps.add(keyframe, window, window.camera());
    };
  SlamResult result;
  {
    ProgressBar progress("tracking", input.source->frame_count());
    int done = 0;
    result = run_slam(
        input.source.get(), input.calibration, options,
        [&](const SlamFrame& frame, const StereoImages&, const StereoOdometry&) {
          progress.update(++done, to_string(frame.result.state));
        },
        on_keyframe);
  }
  OutputSteps steps;
  for (const SourceWarning& w : result.warnings) std::cerr << "parallax: warning: " << w.text << '\n';
  if (!args.trajectory.empty()) steps([&] { write_trajectory_tum(result.live_trajectory(), args.trajectory); });
  if (!args.final_trajectory.empty())
    steps([&] { write_trajectory_tum(result.final_trajectory(), args.final_trajectory); });
  if (!args.keyframes.empty()) steps([&] { write_trajectory_tum(result.keyframe_trajectory(), args.keyframes); });
  if (!args.truth.empty()) steps([&] { write_trajectory_tum(truth, args.truth); });
  if (!args.points.empty()) steps([&] { write_slam_points_ply(result, args.points); });
  if (!args.graph.empty()) steps([&] { write_slam_graph(result, args.graph); });
  if (!args.timing.empty()) steps([&] { write_slam_timing_csv(result, args.timing); });
  if (!args.report.empty()) {
    const SlamReportContext context{args.source, PARALLAX_VERSION, args.pace, fps, &options};
    steps([&] { write_slam_report_json(result, context, args.report); });
  }
  if (args.maps.any() && !result.keyframes.empty()) {
    maps.finish(result.keyframes);
    maps.write(args.source, [&](const std::function<void()>& write) { steps(write); });
  }
  std::cout << slam_summary_text(result);
  steps.finish();
  if (!result.keyframes.empty()) return kExitDone;
  std::cerr << "parallax: tracking never started: "
            << (result.frames.empty() ? "no pair could be read" : result.frames.back().result.reason) << '\n';
  return kExitFailed;
}

}  // namespace

void add_slam_command(CLI::App& app, int* exit_code) {
  auto args = std::make_shared<SlamArguments>();
  CLI::App* command = app.add_subcommand("slam", "Stereo visual SLAM on a recording of two cameras, headless");
  command
      ->add_option("source", args->source, "Folder of a stereo data set (EuRoC or KITTI layout), or synthetic:building")
      ->required();
  command->add_option("--calibration", args->calibration,
                      "Calibration file of both cameras; default: the one the source carries");
  command
      ->add_option("--pace", args->pace,
                   "realtime: frames arrive at their time stamps, two threads; lockstep: deterministic")
      ->check(CLI::IsMember({"realtime", "lockstep"}))
      ->capture_default_str();
  command->add_option("--speed", args->speed, "Realtime: frames arrive so many times faster than their time stamps say")
      ->check(CLI::Range(0.001, 1000.0))
      ->capture_default_str();
  command->add_option("--start", args->start, "First frame")->check(CLI::NonNegativeNumber);
  command->add_option("--frames-limit", args->count, "At most so many frames")->check(CLI::Range(1, 1000000000));
  command->add_option("--trajectory", args->trajectory, "Write every tracked pose as it was known then (TUM form)");
  command->add_option("--final-trajectory", args->final_trajectory,
                      "Write every tracked pose as the windows left it (TUM form)");
  command->add_option("--keyframes", args->keyframes, "Write the poses of the pose graph (TUM form)");
  command->add_option("--points", args->points, "Write the feature map (PLY)");
  command->add_option("--graph", args->graph, "Write the poses and the constraints between them (g2o)");
  command->add_option("--timing", args->timing, "Write a row a frame, then a row a pose (CSV)");
  command->add_option("--report", args->report, "Write counts, timings and settings (JSON)");
  command->add_option("--truth", args->truth, "Write the source's true poses, where it carries them (TUM form)");
  command->add_option("--textured", args->maps.ply, "Write the textured map (PLY)");
  command->add_option("--model", args->maps.glb, "Write the textured map (glTF, .glb)");
  command->add_option("--picture", args->maps.from_above, "Write the map seen from above, with a grid (.png or .svg)");
  command->add_option("--side-picture", args->maps.side, "Write the map seen from the side (.png or .svg)");
  command->add_option("--floor-plan", args->maps.floor_plan,
                      "A floor plan to draw under --picture: YAML with image, resolution and origin");
  command->add_option("--set", args->settings, "NAME=VALUE: an option of the tracker or window (may be repeated)");
  command->callback([args, exit_code] { *exit_code = slam(*args); });
}

}  // namespace parallax
