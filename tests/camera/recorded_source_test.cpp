// The recordings the project is developed on, as their README describes them.
#include <gtest/gtest.h>

#include <algorithm>

#include "source_fixture.h"

namespace parallax {
namespace {
namespace fs = std::filesystem;

struct Recording {
  const char* name;
  int frames;
  double fps;
  int width, height;
  bool calibrated, truth, colour;
};

class RecordedSourceTest : public ::testing::TestWithParam<Recording> {};

TEST_P(RecordedSourceTest, IsAsTheReadmeSays) {
  const Recording& recording = GetParam();
  const fs::path folder = fs::path(PARALLAX_DATA_DIR) / recording.name;
  if (!fs::exists(folder)) GTEST_SKIP() << "no recording at " << folder;
  SourceOptions options;
  options.colour = recording.frames <= 100;
  const auto source = open_frame_source(folder.string(), options);
  EXPECT_EQ(source->frame_count(), recording.frames);
  EXPECT_NEAR(source->frames_per_second(), recording.fps, 0.01);
  EXPECT_EQ(source->calibration().has_value(), recording.calibrated);
  if (source->calibration()) {
    EXPECT_EQ(source->calibration()->width(), recording.width);
    EXPECT_EQ(source->calibration()->height(), recording.height);
  }
  const auto truth = source->ground_truth();
  int count = 0;
  Timestamp before{-1};
  while (const auto frame = source->next()) {
    EXPECT_EQ(frame->index, count++);
    EXPECT_GT(frame->time, before);
    before = frame->time;
    ASSERT_EQ(frame->grey.cols, recording.width);
    ASSERT_EQ(frame->grey.rows, recording.height);
    EXPECT_EQ(!frame->colour.empty(), options.colour && recording.colour);
    if (recording.truth) {
      const auto near = std::lower_bound(truth.begin(), truth.end(), frame->time - std::chrono::milliseconds(1),
                                         [](const StampedPose& pose, Timestamp time) { return pose.time < time; });
      // Recordings from a board have frames without a pose.
      if (std::string(recording.name) != "wide_desk") {
        ASSERT_NE(near, truth.end());
        EXPECT_LT(near->time - frame->time, std::chrono::milliseconds(1));
      }
    }
  }
  EXPECT_EQ(count, recording.frames);
  if (recording.truth) {
    EXPECT_GE(truth.size(), static_cast<std::size_t>(0.9 * recording.frames));
  }
  for (const auto& warning : source->take_warnings()) ADD_FAILURE() << warning.text;
}

INSTANTIATE_TEST_SUITE_P(All, RecordedSourceTest,
                         ::testing::Values(Recording{"kitchen", 500, 30, 640, 480, true, true, true},
                                           Recording{"wide_desk", 300, 30, 752, 480, true, true, false},
                                           Recording{"desk", 400, 30, 640, 480, true, true, true},
                                           Recording{"kitti00", 40, 10, 1241, 376, true, true, false},
                                           Recording{"building_a", 300, 20, 512, 384, true, true, false},
                                           Recording{"building_b", 150, 20, 512, 384, true, true, false},
                                           Recording{"loops/corridor", 84, 30, 512, 384, false, false, true}),
                         [](const auto& instance) {
                           std::string name = instance.param.name;
                           std::replace(name.begin(), name.end(), '/', '_');
                           return name;
                         });

}  // namespace
}  // namespace parallax
