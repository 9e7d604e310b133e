// Synthetic sequences with exact truth: accuracy, every lens, and scenes that must not be believed.
#include "tests/e2e/program_run.h"

namespace parallax::testing {
namespace {

// PTAM §7.3: 18.2 m along two walls; the paper's own figure is 6 mm.
TEST(SyntheticWalls, AreMappedToThreeMillimetres) {
  const ProgramRun run = run_program_on("synthetic:walls?threads=2");
  ASSERT_TRUE(ended_well(run));
  const TrajectoryError error = error_of(run);
  RecordProperty("ate_mm", std::to_string(ate_mm(error)));
  EXPECT_LE(ate_mm(error), 3.0);
  EXPECT_GT(run.report.at("map").at("points").get<int>(), 6000);
  EXPECT_EQ(run.lost(), 0);
  EXPECT_GT(run.tracked_fraction(), 0.9);
}

class Lenses : public ::testing::TestWithParam<const char*> {};

TEST_P(Lenses, TrackTheDesk) {
  const ProgramRun run =
      run_program_on(std::string("synthetic:desk?threads=2&lens=") + GetParam(), {"--frames-limit", "200"});
  ASSERT_TRUE(ended_well(run));
  const TrajectoryError error = error_of(run);
  RecordProperty("ate_mm", std::to_string(ate_mm(error)));
  EXPECT_LE(ate_mm(error), 0.5);
  EXPECT_LE(worst_mm(error), 2.0);
  EXPECT_EQ(run.lost(), 0);
  EXPECT_GT(run.tracked_fraction(), 0.7);
}

INSTANTIATE_TEST_SUITE_P(Synthetic, Lenses, ::testing::Values("pinhole", "radtan", "kannala_brandt", "fov"),
                         [](const auto& test) { return std::string(test.param); });

// A camera that only turns gives no depth: no map, and the user is told why.
void expect_refusal(const std::string& source, const std::vector<std::string>& arguments,
                    const std::vector<std::string>& reasons) {
  const ProgramRun run = run_program_on(source, arguments);
  EXPECT_EQ(run.process.exit_code, 1) << run.process.err;
  ASSERT_FALSE(run.report.is_discarded());
  EXPECT_EQ(run.tracked(), 0);
  EXPECT_TRUE(run.trajectory_text.empty());
  EXPECT_EQ(run.report.at("map").at("points").get<int>(), 0);
  EXPECT_EQ(count_lines(run.process.err), 1) << run.process.err;
  EXPECT_EQ(run.process.err.rfind("parallax: tracking never started: ", 0), 0u) << run.process.err;
  const bool given = std::any_of(reasons.begin(), reasons.end(), [&](const std::string& reason) {
    return run.process.err.find(reason) != std::string::npos;
  });
  EXPECT_TRUE(given) << run.process.err;
}

TEST(NeverInitialises, TurningOnTheSpot) {
  expect_refusal("synthetic:rotation?threads=2", {}, {"turn", "rotat", "sideways", "parallax "});
}

TEST(NeverInitialises, TurningOnTheSpotWithKeyPresses) {
  expect_refusal("synthetic:rotation?threads=2", {"--init", "5,60", "--frames-limit", "90"},
                 {"turn", "rotat", "sideways", "parallax "});
}

TEST(NeverInitialises, NothingToSee) { expect_refusal("synthetic:blank", {}, {"texture", "few"}); }

TEST(NeverInitialises, NothingToSeeWithKeyPresses) {
  expect_refusal("synthetic:blank", {"--init", "5,60", "--frames-limit", "90"}, {"texture", "few"});
}

// Tiles that repeat strictly: it may be lost, but what it says must be so.
class Repeating : public ::testing::TestWithParam<int> {};

TEST_P(Repeating, NeverGivesAWrongPose) {
  const ProgramRun run = run_program_on("synthetic:repeat?threads=2&seed=" + std::to_string(GetParam()));
  // Never starting would be honest too.
  if (run.process.exit_code == 1 && run.trajectory.empty()) {
    EXPECT_EQ(run.process.err.rfind("parallax: tracking never started: ", 0), 0u) << run.process.err;
    return;
  }
  ASSERT_TRUE(ended_well(run));
  const TrajectoryError error = error_of(run);
  RecordProperty("tracked", std::to_string(run.tracked_fraction()));
  for (std::size_t i = 0; i < error.matches.size(); ++i) {
    const double seconds = to_seconds(run.truth[static_cast<std::size_t>(error.matches[i].truth)].time);
    EXPECT_LE(error.position[i], 0.05) << "at " << seconds << " s";
  }
}

INSTANTIATE_TEST_SUITE_P(Synthetic, Repeating, ::testing::Values(1, 2));

}  // namespace
}  // namespace parallax::testing
