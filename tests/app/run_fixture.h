// `parallax run` as the tests of bad input and full disks start it.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/process.h"

namespace parallax::testing {

// In lockstep unless the arguments say otherwise, and ended after a while: a program that hangs exits with 124.
inline ProcessResult parallax_run(const std::vector<std::string>& arguments) {
  std::vector<std::string> words{"--kill-after=5", "240", PARALLAX_BINARY, "run"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  if (std::find(arguments.begin(), arguments.end(), "--pace") == arguments.end()) {
    words.insert(words.end(), {"--pace", "lockstep"});
  }
  return run_process("/usr/bin/timeout", words);
}

// Exactly one line for the user, which begins with the program's name.
inline void expect_one_line(const ProcessResult& result, int exit_code, const std::string& part) {
  expect_one_line_error(result, exit_code, part);
  EXPECT_EQ(result.err.rfind("parallax: ", 0), 0u) << result.err;
  EXPECT_TRUE(result.out.empty() || exit_code == 1) << result.out;
}

inline int count_of(const std::string& text, const std::string& part) {
  int count = 0;
  for (auto at = text.find(part); at != std::string::npos; at = text.find(part, at + part.size())) ++count;
  return count;
}

// Frames tracked, from the summary "frames 80, tracked 65 (81 %), ..."; -1: no summary.
inline int tracked_in(const ProcessResult& result) {
  const auto at = result.out.find(", tracked ");
  return at == std::string::npos ? -1 : std::stoi(result.out.substr(at + 10));
}

inline std::vector<std::string> names_in(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) names.push_back(entry.path().filename());
  return names;
}

}  // namespace parallax::testing
