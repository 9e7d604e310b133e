// `parallax slam SOURCE...`: multi-session stereo visual SLAM, headless, on recordings.
#include <filesystem>
#include <functional>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "app/command.h"
#include "app/named_settings.h"
#include "app/output_steps.h"
#include "app/progress_bar.h"
#include "app/session_outputs.h"
#include "app/session_report_outputs.h"
#include "app/session_view.h"
#include "app/slam_maps.h"
#include "app/slam_outputs.h"
#include "app/slam_sessions.h"
#include "core/error.h"
#include "sessions/lcm_link.h"

namespace parallax {
namespace {

struct SlamArguments {
  std::vector<std::string> sources, names;
  std::string calibration, pace = "realtime";
  std::string trajectory, final_trajectory, keyframes, points, graph, timing, report, truth;
  std::string joint_trajectory, joint_truth, encounters, database, lcm;
  double wait_s = 30;
  SlamMapPaths maps;
  SessionSheetPaths sheets;
  int start = 0, count = -1;
  double speed = 1.0;
  bool view = false, at_once = false, resume = false, no_loops = false, no_meetings = false, no_images = false;
  std::vector<std::string> settings;
};

void apply_slam_settings(const std::vector<std::string>& settings, SlamSessionsOptions* options) {
  StereoTrackerOptions& t = options->slam.tracker;
  StereoWindowOptions& w = options->slam.window;
  PlaceRecogniserOptions& p = options->back_end.places;
  EncounterVoteOptions& v = options->back_end.vote;
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
                                  {"window.max_iterations", &w.solver.max_iterations},
                                  {"window.hand_over_at_loop", &options->link.hand_over_at_loop},
                                  {"sessions.new_after_failure", &options->link.new_session_after_failure},
                                  {"places.alpha_minus", &p.alpha_minus},
                                  {"places.alpha_plus", &p.alpha_plus},
                                  {"places.beta_near", &p.beta_near},
                                  {"places.beta_far", &p.beta_far},
                                  {"places.use_crf", &p.use_crf},
                                  {"places.candidates", &p.candidates},
                                  {"places.min_gap_s", &p.min_gap_s},
                                  {"places.min_gap_keyframes", &p.min_gap_keyframes},
                                  {"vote.within_session", &v.within_session},
                                  {"vote.between_sessions", &v.between_sessions},
                                  {"vote.reach_m", &v.reach_m},
                                  {"vote.gate", &v.gate},
                                  {"vote.drift_part", &v.drift_part}});
  t.validate();
  w.validate();
  options->back_end.validate();
}

// With several sessions an output file is one a session: its name goes before the extension.
std::string output_path(const std::string& path, const SlamSessionOutcome& session, bool several) {
  if (path.empty() || !several) return path;
  const std::filesystem::path file(path);
  return (file.parent_path() / (file.stem().string() + "-" + session.state.start.name + file.extension().string()))
      .string();
}

std::vector<SlamSessionPlan> plan_sessions(const SlamArguments& args) {
  if (!args.names.empty() && args.names.size() != args.sources.size())
    throw InputError("--name: found " + std::to_string(args.names.size()) + " names, expected one for each of the " +
                     std::to_string(args.sources.size()) + " sources");
  if (args.at_once && args.pace == "lockstep")
    throw InputError(
        "--at-once: found --pace lockstep, expected realtime: sessions at once share one back end in the "
        "order in which they come to it");
  if (args.resume && args.database.empty() && args.lcm.empty())
    throw InputError("--resume: expected --database FILE to go on from, or --lcm URL");
  if (!args.lcm.empty() && (!args.database.empty() || args.no_loops || args.no_meetings || args.no_images ||
                            !args.encounters.empty() || !args.joint_trajectory.empty() || !args.joint_truth.empty()))
    throw InputError(
        "--lcm: found an option of the back end beside it, expected it with parallax backend (--database, --no-loops, "
        "--no-meetings, --no-images) or parallax sessions (--joint-trajectory, --joint-truth, --encounters)");
  if (args.view && !args.lcm.empty()) throw InputError("--view: found --lcm, expected a back end in this program");
  if (args.sources.size() > 1 && !args.maps.from_above.empty() && !args.maps.floor_plan.empty())
    throw InputError("--floor-plan: found several sessions with a --picture each, expected one session");
  std::vector<SlamSessionPlan> plans;
  for (std::size_t i = 0; i < args.sources.size(); ++i) {
    SlamSessionPlan plan;
    plan.source = args.sources[i];
    plan.name = args.names.empty() ? session_name_of(plan.source) : args.names[i];
    plan.calibration = args.calibration;
    plan.source_options.start_frame = args.start;
    plan.source_options.max_frames = args.count;
    plans.push_back(std::move(plan));
  }
  return plans;
}

// Links to a back end elsewhere; none is made when there is no address.
SlamLinkMaker make_lcm_links(const SlamArguments& args) {
  if (args.lcm.empty()) return {};
  LcmLinkOptions options;
  options.url = args.lcm;
  options.wait = from_seconds(args.wait_s);
  options.notice = [](const std::string& line) { std::cerr << "parallax: " << line << std::endl; };
  return [options] { return std::make_unique<LcmLink>(options, random_identity()); };
}

void write_session(const SlamArguments& args, const SlamSessionsOptions& options, const SlamSessionPlan& plan,
                   const SlamSessionOutcome& session, bool several, OutputSteps* steps) {
  const SlamResult& result = session.result;
  const auto write = [&](const std::string& path, const auto& writer) {
    if (!path.empty()) (*steps)([&] { writer(output_path(path, session, several)); });
  };
  write(args.trajectory, [&](const std::string& path) { write_trajectory_tum(result.live_trajectory(), path); });
  write(args.final_trajectory, [&](const std::string& path) { write_trajectory_tum(result.final_trajectory(), path); });
  write(args.keyframes, [&](const std::string& path) { write_trajectory_tum(result.keyframe_trajectory(), path); });
  write(args.truth, [&](const std::string& path) { write_trajectory_tum(session.truth, path); });
  write(args.points, [&](const std::string& path) { write_slam_points_ply(result, path); });
  write(args.graph, [&](const std::string& path) { write_slam_graph(result, path); });
  write(args.timing, [&](const std::string& path) { write_slam_timing_csv(result, path); });
  write(args.report, [&](const std::string& path) {
    const SlamReportContext context{plan.source, PARALLAX_VERSION, args.pace, session.frames_per_second, &options.slam};
    write_slam_report_json(result, context, path);
  });
}

int slam(const SlamArguments& args) {
  SlamSessionsOptions options;
  options.slam.pace = args.pace == "lockstep" ? Pace::lockstep : Pace::realtime;
  options.slam.speed = args.speed;
  options.link.lockstep = options.slam.pace == Pace::lockstep;
  options.back_end.loops = !args.no_loops;
  options.back_end.meetings = !args.no_meetings;
  options.back_end.keep_images = !args.no_images;
  options.back_end.keep_refused = true;
  options.database = args.database;
  options.at_once = args.at_once;
  options.resume = args.resume;
  apply_slam_settings(args.settings, &options);
  std::vector<SlamSessionPlan> plans = plan_sessions(args);
  const bool several = plans.size() > 1;
  std::vector<std::unique_ptr<SlamMaps>> maps;
  for (SlamSessionPlan& plan : plans) {
    if (!args.truth.empty() || !args.joint_truth.empty())
      if (open_stereo_input(plan.source, plan.calibration, plan.source_options).source->ground_truth().empty())
        throw InputError((args.truth.empty() ? "--joint-truth: " : "--truth: ") + plan.source +
                         " carries no true poses");
    SlamMapPaths paths = args.maps;
    if (args.sheets.any() && paths.from_above.empty()) paths.floor_plan.clear();  // it lies under those instead
    if (several)
      for (std::string* path : {&paths.ply, &paths.glb, &paths.from_above, &paths.side}) {
        SlamSessionOutcome named;
        named.state.start.name = plan.name;
        *path = output_path(*path, named, true);
      }
    maps.push_back(std::make_unique<SlamMaps>(paths));
    if (args.maps.any()) plan.maps = maps.back().get();
  }
  SessionSheetPaths sheet_paths = args.sheets;
  sheet_paths.floor_plan = args.maps.floor_plan;
  const SessionSheets sheets(sheet_paths);
  SlamSessionsResult run;
  {
    std::unique_ptr<ProgressBar> bar;
    std::size_t shown = plans.size();
    const auto run_all = [&] {
      run = run_slam_sessions(plans, options, make_lcm_links(args),
                              [&](std::size_t k, int done, int total, const std::string& state) {
                                if (k != shown)
                                  bar = std::make_unique<ProgressBar>(several ? plans[k].name : "tracking", total);
                                shown = k;
                                bar->update(done, state);
                              });
    };
    if (args.view) {
      SessionFeed feed(plans.size());
      options.watcher = &feed;
      std::vector<std::string> names;
      for (const SlamSessionPlan& plan : plans) names.push_back(plan.name);
      watch_sessions(&feed, names, run_all);
      options.watcher = nullptr;
    } else {
      run_all();
    }
  }
  OutputSteps steps;
  bool none = true;
  for (std::size_t k = 0; k < plans.size(); ++k) {
    const SlamSessionOutcome& session = run.sessions[k];
    const std::string prefix = several ? session.state.start.name + ": " : "";
    for (const SourceWarning& w : session.result.warnings)
      std::cerr << "parallax: warning: " << prefix << w.text << '\n';
    write_session(args, options, plans[k], session, several, &steps);
    if (plans[k].maps && !session.result.keyframes.empty()) {
      plans[k].maps->finish(session.result.keyframes);
      plans[k].maps->write(plans[k].source, [&](const std::function<void()>& write) { steps(write); });
    }
    if (several) std::cout << (k == 0 ? "" : "\n") << session.state.start.name << ":\n";
    std::cout << slam_summary_text(session.result);
    none &= session.result.keyframes.empty();
  }
  if (!args.joint_trajectory.empty()) steps([&] { write_joint_trajectory(run, args.joint_trajectory); });
  if (!args.joint_truth.empty()) steps([&] { write_joint_truth(run, args.joint_truth); });
  if (!args.encounters.empty()) steps([&] { write_encounters_csv(run, args.encounters); });
  sheets.write(run, options, [&](const std::function<void()>& write) { steps(write); });
  std::cout << meetings_text(run);
  steps.finish();
  if (!none) return kExitDone;
  const SlamResult& last = run.sessions.back().result;
  std::cerr << "parallax: tracking never started: "
            << (last.frames.empty() ? "no pair could be read" : last.frames.back().result.reason) << '\n';
  return kExitFailed;
}

}  // namespace

void add_slam_command(CLI::App& app, int* exit_code) {
  auto args = std::make_shared<SlamArguments>();
  CLI::App* command = app.add_subcommand("slam", "Multi-session visual SLAM on recordings of two cameras, headless");
  command
      ->add_option("sources", args->sources,
                   "Folders of stereo data sets (EuRoC or KITTI layout), or synthetic:building; each is a session")
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
                      "A floor plan to draw under what is seen from above: YAML with image, resolution and origin");
  command->add_option("--sessions-picture", args->sheets.from_above,
                      "Write all sessions in one picture, seen from above (.png or .svg)");
  command->add_option("--elevation-picture", args->sheets.elevation,
                      "Write all sessions one above the other by session time, with their links (.png or .svg)");
  command->add_flag("--view", args->view, "Look on in a window while the sessions run; F1 in it tells its keys");
  command->add_option("--html", args->sheets.html,
                      "Write a report: tables, times, maps and encounters in one page (.html)");
  command->add_option("--database", args->database, "Keep the sessions in FILE, and go on with those that it holds");
  command->add_option("--lcm", args->lcm,
                      "Go to the back end at URL (parallax backend; its default is " + std::string(kDefaultLcmUrl) +
                          "), not to one of its own");
  command->add_option("--wait", args->wait_s, "With --lcm: wait so long for a back end that does not answer, seconds")
      ->check(CLI::Range(1.0, 86400.0))
      ->capture_default_str();
  command->add_option("--name", args->names, "Name of a session, one for each source; default: after the source");
  command->add_flag("--at-once", args->at_once, "Run the sessions at once, not one after the other");
  command->add_flag("--resume", args->resume, "Go on with the session of that name where the database has it end");
  command->add_flag("--no-loops", args->no_loops, "Do not close loops within a session");
  command->add_flag("--no-meetings", args->no_meetings, "Do not look for places of other sessions");
  command->add_flag("--no-images", args->no_images, "Do not keep images in the database");
  command->add_option("--joint-trajectory", args->joint_trajectory,
                      "Write the poses of all sessions in the global frame (TUM form; a million seconds apart)");
  command->add_option("--joint-truth", args->joint_truth, "Write the true poses to go with it (TUM form)");
  command->add_option("--encounters", args->encounters, "Write what place recognition found and refused (CSV)");
  command->add_option("--set", args->settings, "NAME=VALUE: an option of the tracker or window (may be repeated)");
  command->callback([args, exit_code] { *exit_code = slam(*args); });
}

}  // namespace parallax
