// The sub-commands of `parallax sessions` that tie monocular maps to stereo sessions (attach, detach, content, place),
// and `recognise`, which looks for meetings among sessions that were merged.
#pragma once

#include <CLI/CLI.hpp>

namespace parallax {

void add_sessions_maps_commands(CLI::App* sessions, int* exit_code);

}  // namespace parallax
