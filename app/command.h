// The subcommands of `parallax`, one file each. A subcommand adds itself to the parser with a callback that does the
// work and leaves its exit code; it throws InputError (bad usage or input: exit code 2) and RunError (exit code 1),
// which main prints as one line. Everything here runs on the main thread.
#pragma once

#include <CLI/CLI.hpp>

namespace parallax {

// Exit codes of the program.
inline constexpr int kExitDone = 0;      // did what was asked
inline constexpr int kExitFailed = 1;    // ran, but could not do it: tracking never started, a disk was full
inline constexpr int kExitBadInput = 2;  // bad usage or bad input

// `exit_code` outlives the parser and starts as kExitDone.
void add_run_command(CLI::App& app, int* exit_code);
void add_eval_command(CLI::App& app, int* exit_code);
void add_slam_command(CLI::App& app, int* exit_code);
void add_backend_command(CLI::App& app, int* exit_code);
void add_sessions_command(CLI::App& app, int* exit_code);
void add_vocabulary_command(CLI::App& app, int* exit_code);
void add_map_command(CLI::App& app, int* exit_code);
// Subcommands of `parallax map`.
void add_map_library_commands(CLI::App* command);
void add_map_merge_command(CLI::App* command, int* exit_code);
void add_live_command(CLI::App& app, int* exit_code);
void add_cameras_command(CLI::App& app, int* exit_code);
void add_calibrate_command(CLI::App& app, int* exit_code);

}  // namespace parallax
