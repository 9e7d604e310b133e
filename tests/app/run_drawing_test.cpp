#include "app/run_drawing.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "camera/frame_source.h"
#include "core/error.h"
#include "tests/app/view_scene.h"

namespace parallax {
namespace {

namespace fs = std::filesystem;
using testing::ViewScene;

class RunDrawingTest : public ::testing::Test {
 protected:
  RunDrawingTest() {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    try {
      RunDrawing probe(scene().camera(), 30, options("", folder_));
    } catch (const RunError& error) {
      reason_ = error.what();
    }
  }
  ~RunDrawingTest() override { fs::remove_all(folder_); }
  void SetUp() override {
    if (!reason_.empty()) GTEST_SKIP() << reason_;
  }

  static ViewScene& scene() {
    static ViewScene made;
    return made;
  }
  static const std::vector<Frame>& frames() {
    static const std::vector<Frame> made = [] {
      std::vector<Frame> out;
      for (int i = 60; i < 66; ++i) out.push_back(scene().frame(i));
      return out;
    }();
    return made;
  }
  static RunDrawingOptions options(const std::string& video, const std::string& frames) {
    RunDrawingOptions wanted;
    wanted.video_path = video;
    wanted.frames_folder = frames;
    return wanted;
  }
  static void draw_all(RunDrawing* drawing) {
    for (const Frame& frame : frames()) drawing->draw(frame, scene().tracked(frame.index), scene().shared_map());
  }
  std::size_t files(const fs::path& folder) const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
  }

  const fs::path folder_ = fs::temp_directory_path() / ("parallax_run_drawing_" + std::to_string(getpid()));
  std::string reason_;
};

TEST_F(RunDrawingTest, NoFrameIsMissingAndTheSameRunGivesTheSamePictures) {
  for (const char* run : {"a", "b"}) {
    RunDrawing drawing(scene().camera(), 30, options(folder_ / (std::string(run) + ".avi"), folder_ / run));
    draw_all(&drawing);
    drawing.close();
    drawing.close();  // once is enough, twice does no harm
    EXPECT_EQ(drawing.left_out(), 0);
    EXPECT_EQ(files(folder_ / run), frames().size());
    const auto video = open_frame_source(folder_ / (std::string(run) + ".avi"), {});
    int count = 0;
    while (video->next()) ++count;
    EXPECT_EQ(count, static_cast<int>(frames().size()));
  }
  for (const Frame& frame : frames()) {
    char name[32];
    std::snprintf(name, sizeof name, "%06d.png", frame.index);
    const cv::Mat a = cv::imread(folder_ / "a" / name), b = cv::imread(folder_ / "b" / name);
    ASSERT_EQ(a.size(), frame.colour.size()) << name;
    EXPECT_EQ(cv::norm(a, b, cv::NORM_INF), 0) << name << ": drawn again, it is another picture";
    // The recording shows through, and something is drawn over it.
    cv::Mat difference;
    cv::absdiff(a, frame.colour, difference);
    const double changed = static_cast<double>(cv::countNonZero(difference.reshape(1) > 30)) / (3.0 * a.total());
    EXPECT_GT(changed, 0.01);
    EXPECT_LT(changed, 0.35);
  }
}

TEST_F(RunDrawingTest, KeepingUpLeavesFramesOutAndCountsThem) {
  RunDrawingOptions wanted = options("", folder_ / "frames");
  wanted.pace = DrawingPace::keep_up;
  wanted.most_kept = 2;
  RunDrawing drawing(scene().camera(), 30, wanted);
  const int pushed = 60;
  const TrackingResult tracked = scene().tracked(60);
  Frame frame = frames().front();
  for (int i = 0; i < pushed; ++i) {
    frame.index = i;
    drawing.draw(frame, tracked, scene().shared_map());
  }
  drawing.close();
  EXPECT_GT(drawing.left_out(), 0) << "nothing can draw that fast";
  EXPECT_EQ(static_cast<int>(files(folder_ / "frames")) + drawing.left_out(), pushed);
  EXPECT_TRUE(fs::exists(folder_ / "frames/000000.png"));
}

TEST_F(RunDrawingTest, WhatCannotBeWrittenIsSaid) {
  EXPECT_THROW(RunDrawing(scene().camera(), 30, options(folder_ / "video.txt", "")), InputError);
  EXPECT_THROW(RunDrawing(scene().camera(), 30, options("", "/proc/nowhere")), RunError);
  // The folder goes away: the drawing thread finds out, and the caller is told.
  RunDrawing drawing(scene().camera(), 30, options("", folder_ / "gone"));
  fs::remove_all(folder_ / "gone");
  EXPECT_THROW(
      {
        draw_all(&drawing);
        drawing.close();
      },
      RunError);
}

TEST_F(RunDrawingTest, WithoutAnEndNoVideoIsLeft) {
  {
    RunDrawing drawing(scene().camera(), 30, options(folder_ / "video.avi", ""));
    draw_all(&drawing);
  }
  EXPECT_EQ(files(folder_), 0U);
}

}  // namespace
}  // namespace parallax
