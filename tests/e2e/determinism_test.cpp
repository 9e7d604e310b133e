// In lockstep the same input gives the same output to the last bit.
#include <filesystem>

#include "tests/e2e/program_run.h"

namespace parallax::testing {
namespace {

void expect_two_equal_runs(const std::string& source, int frames) {
  const std::vector<std::string> arguments{"--frames-limit", std::to_string(frames)};
  const ProgramRun first = run_program_on(source, arguments);
  ASSERT_TRUE(ended_well(first));
  const ProgramRun second = run_program_on(source, arguments);
  ASSERT_TRUE(ended_well(second));
  // Something worth comparing: a map that has grown.
  EXPECT_GT(first.tracked(), frames / 3);
  EXPECT_GE(count_lines(first.keyframes_text), 3);
  EXPECT_TRUE(first.trajectory_text == second.trajectory_text) << "the trajectories differ";
  EXPECT_TRUE(first.keyframes_text == second.keyframes_text) << "the keyframes differ";
  EXPECT_TRUE(first.points_text == second.points_text) << "the points differ";
}

TEST(Determinism, OfARecording) {
  const std::string folder = std::string(PARALLAX_DATA_DIR) + "/desk";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is absent";
  expect_two_equal_runs(folder, 150);
}

TEST(Determinism, OfASyntheticSequence) { expect_two_equal_runs("synthetic:desk?threads=2", 120); }

}  // namespace
}  // namespace parallax::testing
