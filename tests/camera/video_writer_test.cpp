#include "camera/video_writer.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>

#include "source_fixture.h"

namespace parallax {
namespace {
namespace fs = std::filesystem;

class VideoWriterTest : public SourceTest {
 protected:
  std::size_t entries() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }
};

template <typename Call>
std::string run_error(Call&& call) {
  try {
    call();
  } catch (const RunError& error) {
    return error.what();
  }
  return "";
}

TEST_F(VideoWriterTest, WhatIsWrittenAppearsOnCloseOnly) {
  for (const char* name : {"a.mp4", "b.AVI"}) {
    VideoWriter writer(path(name), 29.97, {320, 240});
    for (int i = 0; i < 5; ++i) writer.write(picture(i));
    EXPECT_FALSE(fs::exists(path(name)));
    EXPECT_EQ(writer.frames_written(), 5);
    writer.close();
    writer.close();
    const auto source = open_frame_source(path(name));
    EXPECT_NEAR(source->frames_per_second(), 29.97, 0.01);
    EXPECT_EQ(play(*source).frames.size(), 5u);
  }
  EXPECT_EQ(entries(), 2u);
}

TEST_F(VideoWriterTest, WithoutCloseNothingIsLeftAndTheEarlierFileStays) {
  put("a.mp4", "earlier");
  {
    VideoWriter writer(path("a.mp4"), 30, {320, 240});
    writer.write(picture(0));
  }
  EXPECT_EQ(get("a.mp4"), "earlier");
  EXPECT_EQ(entries(), 1u);
}

TEST_F(VideoWriterTest, NoFrameIsARunError) {
  VideoWriter writer(path("a.mp4"), 30, {320, 240});
  EXPECT_TRUE(contains(run_error([&] { writer.close(); }), "no frame was given"));
  EXPECT_EQ(entries(), 0u);
}

TEST_F(VideoWriterTest, Refusals) {
  ::testing::internal::CaptureStderr();
  EXPECT_TRUE(contains(input_error([&] { VideoWriter(path("a.mkv"), 30, {320, 240}); }), "expected .mp4 or .avi"));
  EXPECT_NE(input_error([&] { VideoWriter(path("a.mp4"), 0, {320, 240}); }), "");
  EXPECT_NE(input_error([&] { VideoWriter(path("a.mp4"), 30, {0, 240}); }), "");
  const std::string none = run_error([&] { VideoWriter(path("none/a.mp4"), 30, {320, 240}); });
  EXPECT_TRUE(contains(none, path("none/a.mp4") + ": cannot be written: No such file or directory")) << none;
  fs::create_directories(path("folder.mp4"));
  EXPECT_TRUE(contains(run_error([&] { VideoWriter(path("folder.mp4"), 30, {320, 240}); }), "not a regular file"));
  fs::create_symlink("/dev/full", path("full.avi"));
  EXPECT_TRUE(contains(run_error([&] { VideoWriter(path("full.avi"), 30, {320, 240}); }), "not a regular file"));
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

// A limit on the size of files stands in for a full disk: writes beyond it fail.
TEST_F(VideoWriterTest, ADiskThatFillsUpIsARunError) {
  for (const char* name : {"a.avi", "a.mp4"}) {
    rlimit before{};
    ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    VideoWriter writer(path(name), 30, {640, 480});
    rlimit small = before;
    small.rlim_cur = 40000;
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
    cv::Mat3b noise(480, 640);
    for (int i = 0; i < 40; ++i) {
      cv::randu(noise, 0, 256);
      writer.write(noise);
    }
    const std::string line = run_error([&] { writer.close(); });
    ::setrlimit(RLIMIT_FSIZE, &before);
    std::signal(SIGXFSZ, handler);
    EXPECT_TRUE(contains(line, path(name) + ": cannot be written: ")) << line;
    EXPECT_EQ(entries(), 0u);
  }
}

}  // namespace
}  // namespace parallax
