// Shaking, a covered lens, kidnapping, an unknown place and sudden light: the pose comes back within a second of the
// view coming back, and no pose is wrong meanwhile.
#include <map>

#include "render/synthetic_path.h"
#include "tests/e2e/program_run.h"

namespace parallax::testing {
namespace {

constexpr int kFrames = 900;
constexpr int kBackWithin = static_cast<int>(kSyntheticFps);
constexpr double kWorstPosition_m = 0.10, kWorstRotation_deg = 5.0;

// Something happened to the view: [first, back). At frame `back` the mapped place is plainly seen again.
struct Event {
  std::string what;
  int first = 0, back = 0;
};

std::vector<Event> events_of(const SyntheticMotion& motion) {
  std::vector<Event> events;
  for (int i = 0; i < kFrames; ++i) {
    const FrameLabel label = motion.label(i);
    const bool hidden = label.covered || label.shaking || label.unseen;
    if (hidden) {
      const std::string what = label.unseen ? "unseen place" : label.covered ? "covered lens" : "shaking";
      if (events.empty() || events.back().back != i || events.back().what != what) events.push_back({what, i, i});
      events.back().back = i + 1;
    } else if (label.cut && (events.empty() || events.back().back != i)) {
      events.push_back({"kidnapping", i, i});
    } else if (label.light) {
      events.push_back({"light change", i, i});
    }
  }
  return events;
}

// Whether the frame's pose was tracked and right.
struct Verdict {
  bool is_tracked = false;
  double position_m = 0, rotation_deg = 0;
  bool is_right() const { return is_tracked && position_m <= kWorstPosition_m && rotation_deg <= kWorstRotation_deg; }
};

std::map<int, Verdict> verdicts_of(const ProgramRun& run, const TrajectoryError& error) {
  std::map<int, Verdict> verdicts;
  for (const FrameRow& row : run.frames) verdicts[row.frame].is_tracked = false;
  for (std::size_t i = 0; i < error.matches.size(); ++i) {
    // The truth holds every frame of the sequence in order.
    verdicts[error.matches[i].truth] = {true, error.position[i], error.rotation_deg[i]};
  }
  return verdicts;
}

class Recovery : public ::testing::TestWithParam<int> {};

TEST_P(Recovery, AfterEveryEvent) {
  const auto seed = static_cast<std::uint64_t>(GetParam());
  const ProgramRun run = run_program_on("synthetic:shakes?threads=2&seed=" + std::to_string(seed));
  ASSERT_TRUE(ended_well(run));
  ASSERT_EQ(run.frames.size(), static_cast<std::size_t>(kFrames));
  ASSERT_EQ(run.truth.size(), static_cast<std::size_t>(kFrames));
  const TrajectoryError error = error_of(run);
  ASSERT_EQ(error.matches.size(), run.trajectory.size());
  ASSERT_EQ(run.trajectory.size(), static_cast<std::size_t>(run.tracked()));
  RecordProperty("ate_mm", std::to_string(ate_mm(error)));
  RecordProperty("worst_mm", std::to_string(worst_mm(error)));
  RecordProperty("tracked", std::to_string(run.tracked_fraction()));
  const std::map<int, Verdict> verdicts = verdicts_of(run, error);

  int wrong = 0, first_wrong = -1, last_wrong = -1;
  for (const auto& [frame, verdict] : verdicts) {
    if (!verdict.is_tracked || verdict.is_right()) continue;
    ++wrong;
    last_wrong = frame;
    if (first_wrong < 0) first_wrong = frame;
  }
  EXPECT_EQ(wrong, 0) << "wrong poses reported as tracked, frames " << first_wrong << " to " << last_wrong << ", worst "
                      << worst_mm(error) << " mm";

  const std::vector<Event> events = events_of(shakes_motion(seed));
  ASSERT_EQ(events.size(), 9u);
  for (const Event& event : events) {
    int found_at = -1;
    for (int i = event.back; i <= event.back + kBackWithin && found_at < 0 && i < kFrames; ++i) {
      const auto it = verdicts.find(i);
      if (it != verdicts.end() && it->second.is_right()) found_at = i;
    }
    EXPECT_GE(found_at, 0) << event.what << " from frame " << event.first << ", view back at " << event.back
                           << ": no right pose within " << kBackWithin << " frames";
  }
  EXPECT_GE(run.tracked_fraction(), 0.75);
}

INSTANTIATE_TEST_SUITE_P(Shakes, Recovery, ::testing::Values(1, 2, 3));

}  // namespace
}  // namespace parallax::testing
