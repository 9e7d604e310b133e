// Relocalisation on recordings, from views that the map was not made from: the bar, and nothing wrong.
#include "bench/recorded_recall.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <optional>
#include <string>
#include <utility>

namespace parallax {
namespace {

struct Recorded {
  const char* recording;
  int mapped;
  std::optional<std::pair<int, int>> keys;
};

class RecordedRecall : public ::testing::TestWithParam<Recorded> {};

TEST_P(RecordedRecall, ReachesItsBarWithoutAWrongPose) {
  const std::string folder = std::string(PARALLAX_DATA_DIR) + "/" + GetParam().recording;
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is absent";
  const auto recall = recorded_recall::measure(folder, GetParam().mapped, GetParam().keys, 100);
  ASSERT_TRUE(recall) << "no map was made";
  std::printf("%d of %d, %d wrong\n", recall->close, recall->sharing, recall->wrong);
  ASSERT_GE(recall->sharing, 50);
  EXPECT_GE(recall->close, 0.95 * recall->sharing);
  EXPECT_EQ(recall->wrong, 0);
}

INSTANTIATE_TEST_SUITE_P(Recordings, RecordedRecall,
                         ::testing::Values(Recorded{"wide_desk", 150, {}}, Recorded{"wide_desk", 150, {{0, 30}}},
                                           Recorded{"desk", 250, {}}));

}  // namespace
}  // namespace parallax
