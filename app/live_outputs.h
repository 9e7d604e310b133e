// The files a live session leaves: trajectories, report.
#pragma once

#include "app/live_options.h"
#include "app/output_steps.h"
#include "app/run_session.h"
#include "app/source.h"

namespace parallax {

// Writes what `options` name, each a step of its own: RunError, and InputError when truth is asked for and there is
// none.
void write_live_outputs(const LiveOptions& options, const LiveSource& source, const RunOptions& run_options,
                        const CameraModel& lens, const RunResult& result, OutputSteps* steps);

}  // namespace parallax
