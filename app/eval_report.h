// What `parallax eval` found, as a table for people and as JSON for programs.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <ostream>
#include <string>

#include "core/trajectory_error.h"

namespace parallax {

// One trajectory that was measured.
struct EvaluatedFile {
  std::string path;
  int poses = 0;
  TrajectoryError error;
};

struct EvalReport {
  std::string truth_path;
  int truth_poses = 0;
  TrajectoryErrorOptions options;
  EvaluatedFile frames;
  std::optional<EvaluatedFile> keyframes;
};

const char* alignment_name(Alignment alignment);

void print_eval_table(const EvalReport& report, std::ostream& out);
nlohmann::ordered_json eval_json(const EvalReport& report);

}  // namespace parallax
