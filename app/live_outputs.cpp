#include "app/live_outputs.h"

#include "app/run_outputs.h"
#include "core/error.h"

namespace parallax {

namespace {

Trajectory truth_of(const FrameSource& frames, const std::string& name) {
  Trajectory out;
  for (const StampedPose& pose : frames.ground_truth()) out.push_back({pose.time, pose.world_from_camera});
  if (out.empty()) throw InputError("--truth: " + name + " carries no true poses");
  return out;
}

}  // namespace

void write_live_outputs(const LiveOptions& options, const LiveSource& source, const RunOptions& run_options,
                        const CameraModel& lens, const RunResult& result, OutputSteps* steps) {
  OutputSteps& step = *steps;
  if (!options.trajectory.empty()) step([&] { write_trajectory_tum(tracked_trajectory(result), options.trajectory); });
  if (!options.keyframes.empty()) step([&] { write_trajectory_tum(keyframe_trajectory(result), options.keyframes); });
  if (!options.truth.empty()) step([&] { write_trajectory_tum(truth_of(*source.frames, source.name), options.truth); });
  if (options.report.empty()) return;
  const ReportContext context{source.name,
                              PARALLAX_VERSION,
                              "live",
                              run_options.manual_initialisation ? "manual" : "auto",
                              source.frames->frames_per_second(),
                              &lens,
                              &run_options};
  step([&] { write_report_json(result, context, options.report); });
}

}  // namespace parallax
