// Runs `parallax run` on a source as a user would, and reads back what it wrote.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "core/trajectory.h"
#include "core/trajectory_error.h"
#include "tests/support/process.h"

namespace parallax::testing {

// A row of the timing file.
struct FrameRow {
  int frame = -1;
  std::string state, quality;
  bool is_tracked() const { return quality != "none"; }
};

struct ProgramRun {
  ProcessResult process;
  nlohmann::json report;
  std::vector<FrameRow> frames;
  Trajectory trajectory, truth;
  std::string trajectory_text, keyframes_text, points_text;

  int tracked() const { return report.at("frames").at("tracked"); }
  int lost() const { return report.at("frames").at("lost"); }
  double tracked_fraction() const { return report.at("tracked_fraction"); }
};

inline std::vector<FrameRow> parse_timing(const std::string& text) {
  std::vector<FrameRow> rows;
  std::istringstream lines(text);
  std::string line;
  std::getline(lines, line);  // the header
  while (std::getline(lines, line)) {
    std::istringstream fields(line);
    std::string frame;
    FrameRow row;
    std::getline(fields, frame, ',');
    std::getline(fields, row.state, ',');
    std::getline(fields, row.quality, ',');
    row.frame = std::stoi(frame);
    rows.push_back(row);
  }
  return rows;
}

// `arguments` go behind `run SOURCE`. Lockstep unless they name another pace.
inline ProgramRun run_program_on(const std::string& source, const std::vector<std::string>& arguments = {}) {
  const ScratchFolder folder;
  std::vector<std::string> words{"run",          source,
                                 "--trajectory", folder.file("trajectory.txt"),
                                 "--keyframes",  folder.file("keyframes.txt"),
                                 "--points",     folder.file("points.ply"),
                                 "--timing",     folder.file("timing.csv"),
                                 "--report",     folder.file("report.json"),
                                 "--truth",      folder.file("truth.txt")};
  words.insert(words.end(), arguments.begin(), arguments.end());
  if (std::find(words.begin(), words.end(), "--pace") == words.end()) words.insert(words.end(), {"--pace", "lockstep"});
  ProgramRun run;
  run.process = run_process(PARALLAX_BINARY, words);
  run.trajectory_text = read_all(folder.file("trajectory.txt"));
  run.keyframes_text = read_all(folder.file("keyframes.txt"));
  run.points_text = read_all(folder.file("points.ply"));
  run.frames = parse_timing(read_all(folder.file("timing.csv")));
  run.report = nlohmann::json::parse(read_all(folder.file("report.json")), nullptr, false);
  if (!run.trajectory_text.empty()) run.trajectory = parse_trajectory(run.trajectory_text, "trajectory");
  const std::string truth = read_all(folder.file("truth.txt"));
  if (!truth.empty()) run.truth = parse_trajectory(truth, "truth");
  return run;
}

// Whether the program ended well and wrote everything; to be wrapped in ASSERT_TRUE.
inline ::testing::AssertionResult ended_well(const ProgramRun& run) {
  if (run.process.exit_code != 0) {
    return ::testing::AssertionFailure() << "exit code " << run.process.exit_code << ": " << run.process.err;
  }
  if (!run.process.err.empty()) return ::testing::AssertionFailure() << "stderr: " << run.process.err;
  if (run.report.is_discarded() || run.frames.empty() || run.trajectory.empty() || run.truth.empty()) {
    return ::testing::AssertionFailure() << "an output is missing";
  }
  return ::testing::AssertionSuccess();
}

// Against the truth, after alignment by similarity.
inline TrajectoryError error_of(const ProgramRun& run) { return evaluate_trajectory(run.trajectory, run.truth, {}); }
inline double ate_mm(const TrajectoryError& error) { return summarise_errors(error.position).rmse * 1e3; }
inline double worst_mm(const TrajectoryError& error) { return summarise_errors(error.position).max * 1e3; }

}  // namespace parallax::testing
