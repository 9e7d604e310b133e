// `--set NAME=VALUE`: any option of the tracker, the mapper or several maps by name, for experiments.
#pragma once

#include <string>
#include <vector>

#include "app/run_session.h"

namespace parallax {

// Throws InputError for an unknown name (naming the known ones), a value that is no number, or one out of range.
void apply_settings(const std::vector<std::string>& settings, RunOptions* options);

}  // namespace parallax
