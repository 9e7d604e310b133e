// `parallax eval ESTIMATE TRUTH`: how far a trajectory is from the truth, as a table, as JSON and as a plot.
#include <algorithm>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "app/command.h"
#include "app/eval_canvas.h"
#include "app/eval_plot.h"
#include "app/eval_report.h"
#include "core/error.h"
#include "core/file_io.h"
#include "core/log.h"
#include "core/trajectory.h"
#include "core/trajectory_error.h"

namespace parallax {
namespace {

struct EvalSettings {
  std::string estimate, truth, keyframes;
  std::string alignment = "sim3", delta_unit = "frames";
  std::string json, plot, output;
  TrajectoryErrorOptions error;
};

struct LoadedTrajectory {
  Trajectory poses;
  TrajectoryFormat format = TrajectoryFormat::tum;
};

LoadedTrajectory load(const std::string& path) {
  LoadedTrajectory loaded;
  loaded.poses = read_trajectory(path, &loaded.format);
  if (loaded.poses.empty()) throw InputError(path + ": holds no poses, expected at least one");
  return loaded;
}

EvaluatedFile evaluate(const std::string& path, const LoadedTrajectory& estimate, const std::string& truth_path,
                       const LoadedTrajectory& truth, TrajectoryErrorOptions* options) {
  const bool timed = estimate.format != TrajectoryFormat::kitti, truth_timed = truth.format != TrajectoryFormat::kitti;
  if (timed != truth_timed) {
    throw InputError((timed ? truth_path : path) + ": is in KITTI form, which carries no times, while " +
                     (timed ? path : truth_path) + " has times: expected both with or both without");
  }
  options->match_by_line = !timed;
  try {
    return {path, static_cast<int>(estimate.poses.size()), evaluate_trajectory(estimate.poses, truth.poses, *options)};
  } catch (const InputError& e) {
    throw InputError(path + " against " + truth_path + ": " + e.what());
  }
}

void evaluate_files(EvalSettings settings) {
  if (!settings.plot.empty()) check_canvas_path(settings.plot);
  settings.error.alignment = settings.alignment == "sim3"  ? Alignment::sim3
                             : settings.alignment == "se3" ? Alignment::se3
                                                           : Alignment::none;
  settings.error.relative.in_metres = settings.delta_unit == "m";
  settings.error.validate();
  const LoadedTrajectory truth = load(settings.truth), estimate = load(settings.estimate);

  EvalReport report;
  report.frames = evaluate(settings.estimate, estimate, settings.truth, truth, &settings.error);
  if (!settings.keyframes.empty()) {
    report.keyframes = evaluate(settings.keyframes, load(settings.keyframes), settings.truth, truth, &settings.error);
  }
  report.truth_path = settings.truth;
  report.truth_poses = static_cast<int>(truth.poses.size());
  report.options = settings.error;
  const auto matched = static_cast<int>(report.frames.error.matches.size());
  if (settings.error.frames > 0 && settings.error.frames < matched) {
    throw InputError("--frames: " + std::to_string(settings.error.frames) + " given, but " + std::to_string(matched) +
                     " poses have a true one");
  }

  print_eval_table(report, std::cout);
  if (!settings.json.empty()) {
    write_file_atomically(settings.json, [&](std::ostream& out) {
      // A file name may hold bytes that are no UTF-8.
      out << eval_json(report).dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << '\n';
    });
  }
  if (!settings.output.empty()) write_trajectory_tum(report.frames.error.aligned, settings.output);
  if (!settings.plot.empty()) {
    EvalPlotOptions options;
    options.title = settings.estimate + " (" + alignment_name(settings.error.alignment) + ")";
    options.time_is_frame = settings.error.match_by_line;
    plot_trajectory_error(report.frames.error, truth.poses, options, settings.plot);
  }
}

}  // namespace

void add_eval_command(CLI::App& app, int* exit_code) {
  CLI::App* eval = app.add_subcommand("eval", "Measure a trajectory against the truth, aligned and plotted");
  eval->footer(
      "Trajectories are TUM (t tx ty tz qx qy qz qw), KITTI (3x4 matrices) or EuRoC (csv) files, or a folder that\n"
      "holds its truth. Poses are camera to world.\n\n"
      "  parallax eval trajectory.txt desk/groundtruth.txt --keyframes keyframes.txt --plot error.svg");
  const auto settings = std::make_shared<EvalSettings>();
  eval->add_option("ESTIMATE", settings->estimate, "Estimated trajectory")->required();
  eval->add_option("TRUTH", settings->truth, "True trajectory, or the folder of the recording")->required();
  eval->add_option("--keyframes", settings->keyframes, "Keyframe poses of the same run, aligned and measured apart")
      ->type_name("FILE");
  eval->add_option("--align", settings->alignment, "With scale, rigid (stereo), or not at all")
      ->check(CLI::IsMember({"sim3", "se3", "none"}))
      ->type_name("NAME")
      ->capture_default_str();
  eval->add_option("--max-time-difference", settings->error.max_time_difference_s,
                   "Largest difference in time of two poses that belong together")
      ->type_name("SECONDS")
      ->capture_default_str();
  eval->add_option("--frames", settings->error.frames, "Frames of the recording, for the tracked fraction")
      ->check(CLI::Range(1, 1'000'000'000))
      ->type_name("N");
  eval->add_option("--delta", settings->error.relative.delta, "Step of the relative error")
      ->type_name("STEP")
      ->capture_default_str();
  eval->add_option("--delta-unit", settings->delta_unit, "Unit of the step; metres are along the estimate")
      ->check(CLI::IsMember({"frames", "m"}))
      ->type_name("UNIT")
      ->capture_default_str();
  eval->add_flag("--all-pairs", settings->error.relative.all_pairs,
                 "Relative error from every pose, not one step after the other");
  eval->add_option("--json", settings->json, "Write the figures as JSON")->type_name("FILE");
  eval->add_option("--plot", settings->plot, "Draw the trajectories and the error over time")
      ->type_name("FILE.svg|FILE.png");
  eval->add_option("--output", settings->output, "Write the aligned estimate in TUM form")->type_name("FILE");
  eval->callback([settings, exit_code] {
    evaluate_files(*settings);
    *exit_code = kExitDone;
  });
}

}  // namespace parallax
