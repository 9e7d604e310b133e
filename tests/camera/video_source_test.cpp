#include "camera/video_source.h"

#include <gtest/gtest.h>

#include "camera/video_writer.h"
#include "source_fixture.h"

namespace parallax {
namespace {
namespace fs = std::filesystem;

class VideoSourceTest : public SourceTest {
 protected:
  void put_video(const std::string& name, int frames = 12, double fps = 25, cv::Size size = {320, 240}) const {
    VideoWriter writer(path(name), fps, size);
    for (int i = 0; i < frames; ++i) writer.write(picture(4 * i, size.width, size.height));
    writer.close();
  }
};

TEST_F(VideoSourceTest, FramesTimesAndNumbers) {
  for (const char* name : {"a.mp4", "a.avi"}) {
    put_video(name);
    const auto source = open_frame_source(path(name));
    EXPECT_EQ(source->frame_count(), 12);
    EXPECT_NEAR(source->frames_per_second(), 25, 1e-6);
    EXPECT_FALSE(source->calibration());
    const Played played = play(*source);
    EXPECT_TRUE(played.warnings.empty()) << played.warnings[0].text;
    ASSERT_EQ(played.frames.size(), 12u) << name;
    for (int i = 0; i < 12; ++i) {
      const Frame& frame = played.frames[static_cast<std::size_t>(i)];
      EXPECT_EQ(frame.index, i);
      EXPECT_NEAR(to_seconds(frame.time), i / 25.0, 1e-3);
      // Lossy, but the right picture: closer to its own than to its neighbour.
      EXPECT_LT(cv::norm(frame.grey, grey_picture(4 * i), cv::NORM_L1),
                cv::norm(frame.grey, grey_picture(4 * i + 4), cv::NORM_L1));
      EXPECT_LT(cv::norm(frame.grey, grey_picture(4 * i), cv::NORM_L1) / (320 * 240), 8);
    }
  }
}

TEST_F(VideoSourceTest, StartMaximumAndColourDoNotChangeThePixels) {
  put_video("a.mp4");
  const Played all = play(*open_frame_source(path("a.mp4")));
  SourceOptions options;
  options.colour = true;
  options.start_frame = 5;
  options.max_frames = 4;
  const auto source = open_frame_source(path("a.mp4"), options);
  EXPECT_EQ(source->frame_count(), 4);
  const Played some = play(*source);
  ASSERT_EQ(some.frames.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(some.frames[i].index, static_cast<int>(i) + 5);
    EXPECT_EQ(some.frames[i].time, all.frames[i + 5].time);
    EXPECT_TRUE(same_pixels(some.frames[i].grey, all.frames[i + 5].grey));
    EXPECT_TRUE(all.frames[i + 5].colour.empty());
    cv::Mat1b grey;
    cv::cvtColor(some.frames[i].colour, grey, cv::COLOR_BGR2GRAY);
    EXPECT_TRUE(same_pixels(some.frames[i].grey, grey));
  }
  // Frames are the caller's own: decoding on does not change them.
  EXPECT_FALSE(same_pixels(some.frames[0].colour, some.frames[3].colour));
}

TEST_F(VideoSourceTest, CutShort) {
  put_video("a.mp4", 40);
  put_video("a.avi", 40);
  cut_in_half("a.mp4");
  cut_in_half("a.avi");
  ::testing::internal::CaptureStderr();
  const std::string mp4 = input_error([&] { open_frame_source(path("a.mp4")); });
  EXPECT_TRUE(contains(mp4, path("a.mp4")) && contains(mp4, "cannot be opened as a video")) << mp4;
  // An AVI plays to where it ends, and says so.
  const auto source = open_frame_source(path("a.avi"));
  const Played played = play(*source);
  EXPECT_GT(played.frames.size(), 10u);
  EXPECT_LT(played.frames.size(), 30u);
  ASSERT_FALSE(played.warnings.empty());
  EXPECT_TRUE(contains(played.warnings.back().text, "it may be cut short")) << played.warnings.back().text;
  EXPECT_FALSE(source->next().has_value());
  EXPECT_TRUE(source->take_warnings().empty());
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

TEST_F(VideoSourceTest, SizesThatAreNotWorkedWith) {
  put_video("small.avi", 3, 25, {96, 64});
  EXPECT_TRUE(
      contains(input_error([&] { open_frame_source(path("small.avi")); }), "found size 96x64, expected 160x120"));
}

TEST_F(VideoSourceTest, AHeaderWithoutFrames) {
  put_video("a.avi", 20);
  // Up to the list of frames: a whole header and nothing behind it.
  const std::string whole = get("a.avi");
  const std::size_t movi = whole.find("movi");
  ASSERT_NE(movi, std::string::npos);
  put("none.avi", whole.substr(0, movi + 4));
  ::testing::internal::CaptureStderr();
  const std::string line = input_error([&] { open_frame_source(path("none.avi")); });
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_TRUE(contains(line, path("none.avi"))) << line;
  EXPECT_FALSE(contains(line, "\n"));
}

TEST_F(VideoSourceTest, StartBehindTheEndIsSaid) {
  put_video("a.avi", 5);
  SourceOptions options;
  options.start_frame = 50;
  const Played played = play(*open_frame_source(path("a.avi"), options));
  EXPECT_TRUE(played.frames.empty());
  ASSERT_FALSE(played.warnings.empty());
  EXPECT_TRUE(contains(played.warnings.back().text, "found 5 frames"));
}

}  // namespace
}  // namespace parallax
