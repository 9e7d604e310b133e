// Opening and listing live cameras by what is written on the command line, and the frame rate meter.
#include "camera/live_camera.h"

#include <gtest/gtest.h>

#include "camera/live_frame_rate.h"
#include "core/error.h"

namespace parallax {
namespace {

std::string live_refusal(const std::string& source, const LiveCameraOptions& options = {}) {
  try {
    open_live_camera(source, options);
  } catch (const InputError& error) {
    return error.what();
  }
  return "was opened";
}

TEST(LiveCamera, RefusesWhatIsNone) {
  EXPECT_EQ(live_refusal("desk.mp4"),
            "desk.mp4: is no live camera, expected v4l2:/dev/videoN, v4l2:, libcamera:NAME or libcamera:");
  EXPECT_NE(live_refusal("v4l2:/dev/no_such_node").find("no such device"), std::string::npos);
  EXPECT_NE(live_refusal("v4l2:/dev/null").find("v4l2:/dev/null: is not a video device"), std::string::npos);
  EXPECT_NE(live_refusal("libcamera:no such name").find("libcamera:no such name: "), std::string::npos);
  LiveCameraOptions options;
  options.width = 10;
  EXPECT_NE(live_refusal("v4l2:", options).find("camera size: "), std::string::npos);
  options = {};
  options.fps = 0;
  EXPECT_NE(live_refusal("v4l2:", options).find("camera rate: "), std::string::npos);
}

TEST(LiveCamera, ListingNeverThrows) {
  for (const auto& camera : list_cameras()) EXPECT_FALSE(camera.source.empty());
}

TEST(FrameRateMeter, MeasuresTheLastSecond) {
  FrameRateMeter meter;
  EXPECT_EQ(meter.rate(), 0);
  Timestamp time{0};
  for (int i = 0; i < 100; ++i) meter.add(time += std::chrono::milliseconds(20));
  EXPECT_NEAR(meter.rate(), 50, 1e-9);
  EXPECT_TRUE(meter.is_settled());
  // Half as fast, and every other one is lost on the way: the camera sends 12.5 a second, 25 with those.
  for (int i = 0; i < 20; ++i) meter.add(time += std::chrono::milliseconds(80), 1);
  EXPECT_NEAR(meter.rate(), 25, 1e-9);
  // One every two seconds is measured too.
  for (int i = 0; i < 3; ++i) meter.add(time += std::chrono::seconds(2));
  EXPECT_NEAR(meter.rate(), 0.5, 1e-9);
  // A clock that jumps back begins anew.
  meter.add(Timestamp(5));
  EXPECT_EQ(meter.rate(), 0);
}

}  // namespace
}  // namespace parallax
