// What `parallax run` writes.
#pragma once

#include <string>

#include "app/run_session.h"
#include "core/trajectory.h"

namespace parallax {

struct GameOutcome;

// Every tracked frame as it was known at that frame, put into the last world (TUM form).
Trajectory tracked_trajectory(const RunResult& result);
// Keyframes after the last adjustment.
Trajectory keyframe_trajectory(const RunResult& result);

void write_points_ply(const Map& map, const std::string& path);
// The map as a map file. `camera` is the lens it was made with. RunError when there is no map.
void write_run_map(const RunResult& result, const CameraModel& camera, const std::string& path);
void write_timing_csv(const RunResult& result, const std::string& path);

struct ReportContext {
  std::string source, version, pace, initialisation;
  double frames_per_second = 0;
  const CameraModel* camera = nullptr;
  const RunOptions* options = nullptr;
};
// `game` may be null.
void write_report_json(const RunResult& result, const ReportContext& context, const std::string& path,
                       const GameOutcome* game = nullptr);

// Whether any frame was tracked, and if not, what the user was last told.
bool tracked_anything(const RunResult& result);
std::string why_not_started(const RunResult& result);

// A few lines for the user.
std::string summary_text(const RunResult& result);

}  // namespace parallax
