// What a stereo session leaves behind: trajectories are written by core/trajectory; these are the rest. World of the
// session (its first keyframe's left camera), metres, milliseconds. Files are written beside and renamed; RunError when
// one cannot be. Plain functions, safe from any thread.
#pragma once

#include <string>

#include "app/slam_session.h"

namespace parallax {

void write_slam_points_ply(const SlamResult& result, const std::string& path);
// The constraints between the keyframes, as a pose graph in g2o form (EDGE_SE3:QUAT, information from the windows).
void write_slam_graph(const SlamResult& result, const std::string& path);
void write_slam_timing_csv(const SlamResult& result, const std::string& path);

struct SlamReportContext {
  std::string source, version, pace;
  double frames_per_second = 0;
  const SlamOptions* options = nullptr;
};
void write_slam_report_json(const SlamResult& result, const SlamReportContext& context, const std::string& path);

// A few lines for the user: frames, poses, path, times in the form of MS Table 2.
std::string slam_summary_text(const SlamResult& result);

}  // namespace parallax
