// Accuracy on the development recordings, as limits that fail: a change that makes tracking worse shows here.
#include <filesystem>
#include <ostream>

#include "tests/e2e/program_run.h"

namespace parallax::testing {
namespace {

struct Expectation {
  const char* name;
  const char* recording;
  const char* init;
  double ate_mm;
  double tracked;
  bool never_lost;
};

// What the lists of tests show.
std::ostream& operator<<(std::ostream& out, const Expectation& e) { return out << e.recording << " --init " << e.init; }

std::string folder_of(const char* recording) { return std::string(PARALLAX_DATA_DIR) + "/" + recording; }

class Recordings : public ::testing::TestWithParam<Expectation> {};

TEST_P(Recordings, AreTrackedAccurately) {
  const Expectation& expected = GetParam();
  const std::string folder = folder_of(expected.recording);
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is absent";
  const ProgramRun run = run_program_on(folder, {"--init", expected.init});
  ASSERT_TRUE(ended_well(run));
  const TrajectoryError error = error_of(run);
  RecordProperty("ate_mm", std::to_string(ate_mm(error)));
  RecordProperty("tracked", std::to_string(run.tracked_fraction()));
  EXPECT_EQ(error.matches.size(), run.trajectory.size());
  EXPECT_LE(ate_mm(error), expected.ate_mm);
  EXPECT_GE(run.tracked_fraction(), expected.tracked);
  if (expected.never_lost) {
    EXPECT_EQ(run.lost(), 0);
  }
}

// The truth of `kitchen` is itself some 40 mm off.
INSTANTIATE_TEST_SUITE_P(Lockstep, Recordings,
                         ::testing::Values(Expectation{"desk_auto", "desk", "auto", 0.30, 0.90, true},
                                           Expectation{"desk_given", "desk", "30,75", 0.30, 0.80, true},
                                           Expectation{"wide_desk_auto", "wide_desk", "auto", 1.25, 0.95, true},
                                           Expectation{"wide_desk_given", "wide_desk", "0,30", 1.25, 0.89, true},
                                           Expectation{"kitchen_auto", "kitchen", "auto", 48, 0.95, false},
                                           Expectation{"kitchen_given", "kitchen", "0,40", 48, 0.91, false}),
                         [](const auto& test) { return std::string(test.param.name); });

// Two threads at the pace of the time stamps. What it may take depends on the machine; that nothing is lost must not.
TEST(Realtime, DeskIsTrackedAsItArrives) {
  const std::string folder = folder_of("desk");
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is absent";
  const ProgramRun run = run_program_on(folder, {"--pace", "realtime"});
  ASSERT_TRUE(ended_well(run));
  const TrajectoryError error = error_of(run);
  RecordProperty("ate_mm", std::to_string(ate_mm(error)));
  RecordProperty("tracked", std::to_string(run.tracked_fraction()));
  EXPECT_LE(ate_mm(error), 0.5);
  EXPECT_GE(run.tracked_fraction(), 0.85);
  EXPECT_EQ(run.lost(), 0);
}

}  // namespace
}  // namespace parallax::testing
