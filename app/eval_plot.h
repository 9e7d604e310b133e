// Draws an evaluated trajectory: truth and estimate seen along the axis in which they extend least, at equal scale, and
// the errors over time below.
#pragma once

#include <string>

#include "core/trajectory.h"
#include "core/trajectory_error.h"

namespace parallax {

struct EvalPlotOptions {
  std::string title;
  bool time_is_frame = false;  // the trajectories carry line numbers, not seconds
};

// The path ends in .svg or .png (InputError otherwise). Throws RunError when it cannot be written.
void plot_trajectory_error(const TrajectoryError& error, const Trajectory& truth, const EvalPlotOptions& options,
                           const std::string& path);

}  // namespace parallax
