// A newcomer calibrates in the window: asked for, shown a board, used, remembered.
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "camera/calibration_file.h"
#include "render/synthetic_source.h"
#include "tests/e2e/window_fixture.h"

namespace parallax::testing {
namespace {

class CalibrationWindow : public WindowFixture {
 protected:
  // Clicks there, again and again, until the title says so.
  bool click_until(int x, int y, const std::string& text, int attempts) const {
    for (int attempt = 0; attempt < attempts; ++attempt) {
      xdotool({"mousemove", std::to_string(x), std::to_string(y), "click", "1"});
      if (title_says(text, 1)) return true;
    }
    return false;
  }
};

// The largest difference of where two lenses see the same direction, over the image.
double largest_difference_px(const CameraModel& a, const CameraModel& b) {
  double largest = 0;
  for (int y = 0; y < a.height(); y += 8)
    for (int x = 0; x < a.width(); x += 8) {
      Eigen::Vector3d ray;
      Eigen::Vector2d px;
      if (!a.unproject(Eigen::Vector2d(x, y), &ray) || !b.project(ray, &px)) return 1e9;
      largest = std::max(largest, (px - Eigen::Vector2d(x, y)).norm());
    }
  return largest;
}

TEST_F(CalibrationWindow, BoardIsSeenLensIsFoundUsedAndRemembered) {
  const std::string board = "synthetic:board?size=320x240&calibration=none";
  start(board + "&path=own&frames=6000");
  ASSERT_TRUE(title_says("first time")) << read_all(folder_.file("log"));
  ASSERT_TRUE(click_until(320, 250, "calibrating", 5));

  // Above the panel lies the whole picture, with the outline of the wanted view in yellow and empty cells in red.
  const cv::Mat3b seen = screenshot();
  ASSERT_EQ(seen.size(), cv::Size(640, 480));
  cv::Mat hsv, yellow, red;
  cv::cvtColor(seen, hsv, cv::COLOR_BGR2HSV);
  cv::inRange(hsv, cv::Scalar(20, 160, 200), cv::Scalar(30, 255, 255), yellow);
  cv::inRange(hsv, cv::Scalar(0, 150, 200), cv::Scalar(5, 255, 255), red);
  EXPECT_GT(cv::countNonZero(yellow.rowRange(0, 360)), 300);
  EXPECT_GT(cv::countNonZero(red.rowRange(0, 360)), 60);
  EXPECT_LT(cv::mean(cv::mean(seen.rowRange(476, 480)))[0], 40);  // the panel's dark ground

  ASSERT_TRUE(title_says("enough", 90)) << read_all(folder_.file("log"));
  ASSERT_TRUE(click_until(30, 463, "waiting", 5));  // "Use it"
  key("q");
  ASSERT_EQ(program_->wait_for(std::chrono::seconds(30)), 0) << read_all(folder_.file("log"));
  std::vector<fs::path> kept;
  for (const auto& entry : fs::directory_iterator(folder_.path() / "parallax/calibrations"))
    kept.push_back(entry.path());
  ASSERT_EQ(kept.size(), 1u);
  const CameraModel truth = *open_synthetic_source("board?size=320x240")->calibration();
  const CameraModel found = read_calibration(kept[0].string());
  ASSERT_EQ(found.width(), 320);
  EXPECT_LT(largest_difference_px(truth, found), 1.0);

  // The next time nothing is asked.
  start(board);
  ASSERT_TRUE(title_says("waiting", 20)) << "the calibration was not remembered";
  key("q");
  EXPECT_EQ(program_->wait_for(std::chrono::seconds(30)), 0) << read_all(folder_.file("log"));
}

}  // namespace
}  // namespace parallax::testing
