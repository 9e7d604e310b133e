// The V4L2 camera on devices that are made up: choice of the format, streaming, the newest frame, unplugging, controls,
// and what it says when it cannot be used.
#include "camera/v4l2_camera.h"

#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <thread>

#include "camera/v4l2_controls.h"
#include "camera/v4l2_formats.h"
#include "core/error.h"
#include "tests/camera/v4l2_fake.h"

namespace parallax {
namespace {

using std::chrono::milliseconds;
using testing::FakeControl;
using testing::FakeDevice;
using testing::FakeV4l2;

constexpr std::uint32_t kYuyv = fourcc('Y', 'U', 'Y', 'V'), kMjpg = fourcc('M', 'J', 'P', 'G'),
                        kGrey = fourcc('G', 'R', 'E', 'Y'), kH264 = fourcc('H', '2', '6', '4'),
                        kRgb = fourcc('R', 'G', 'B', '3');

class V4l2CameraTest : public ::testing::Test {
 protected:
  std::unique_ptr<LiveCamera> open(const std::string& path = "/dev/video0") {
    return open_v4l2_camera(system_, path, options_);
  }
  std::string refusal(const std::string& path = "/dev/video0") {
    try {
      open(path);
    } catch (const InputError& error) {
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      return error.what();
    }
    return "was opened";
  }

  std::shared_ptr<FakeV4l2> system_ = std::make_shared<FakeV4l2>();
  LiveCameraOptions options_;
};

#define EXPECT_CONTAINS(text, part) EXPECT_NE(std::string(text).find(part), std::string::npos) << (text)

TEST_F(V4l2CameraTest, DeliversEveryFrameToAReaderThatKeepsUp) {
  const auto device = system_->plug("/dev/video0");
  {
    const auto camera = open();
    EXPECT_EQ(camera->width(), 640);
    EXPECT_EQ(camera->height(), 480);
    EXPECT_EQ(camera->identity(), "fake, Fake camera, usb-1");
    EXPECT_EQ(camera->status().state, CameraState::starting);
    for (int i = 0; i < 60; ++i) {
      const auto frame = camera->next();
      ASSERT_TRUE(frame);
      EXPECT_EQ(frame->index, i);
      EXPECT_EQ(frame->grey(0, 0), i);
      EXPECT_EQ(frame->grey(479, 639), i);
      EXPECT_EQ(frame->colour.size(), cv::Size(640, 480));
      EXPECT_NEAR(to_seconds(frame->time), 1000 + (i + 1) / 30.0, 2e-6);
    }
    const auto status = camera->status();
    EXPECT_EQ(status.state, CameraState::streaming);
    EXPECT_NEAR(status.measured_fps, 30, 0.1);
    EXPECT_EQ(status.requested_fps, 30);
    EXPECT_EQ(status.skipped, 0u);
    EXPECT_EQ(status.text, "");
    EXPECT_TRUE(camera->take_warnings().empty());
  }
  EXPECT_EQ(device->opened, 0) << "left open";
  EXPECT_EQ(system_->mapped, 0) << "left mapped";
  EXPECT_FALSE(device->streaming);
}

TEST_F(V4l2CameraTest, RowsMayBeLongerThanPictures) {
  FakeDevice device;
  device.formats = {{kRgb, 320, 240, {30}}};
  device.extra_stride = 24;
  device.paint = [](std::uint32_t, std::vector<std::uint8_t>& bytes) {
    for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(i / (3 * 320 + 24));  // the row
  };
  system_->plug("/dev/video0", device);
  const auto frame = open()->next();
  ASSERT_TRUE(frame);
  for (int y = 0; y < 240; ++y) {
    ASSERT_EQ(frame->colour(y, 0), cv::Vec3b::all(static_cast<uchar>(y)));
    ASSERT_EQ(frame->colour(y, 319), cv::Vec3b::all(static_cast<uchar>(y)));
  }
}

TEST_F(V4l2CameraTest, ASlowReaderGetsTheNewestFrame) {
  system_->plug("/dev/video0");
  const auto camera = open();
  ASSERT_TRUE(camera->next());
  system_->advance(milliseconds(75));  // frames 1 and 2
  auto frame = camera->next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->grey(0, 0), 2);
  EXPECT_EQ(camera->status().skipped, 1u);
  // So long that all buffers are full of old frames: the next one that comes is taken.
  system_->advance(milliseconds(1000));
  const Timestamp asked = system_->now();
  frame = camera->next();
  ASSERT_TRUE(frame);
  EXPECT_GT(frame->time, asked);
  EXPECT_LE(frame->time - asked, milliseconds(34));
  // Every frame was either delivered or is counted: the newest has the number 33.
  EXPECT_EQ(frame->grey(0, 0), 33);
  EXPECT_EQ(camera->status().skipped, 34u - 3u);
}

TEST_F(V4l2CameraTest, DamagedFramesAreSkippedWithAWarning) {
  FakeDevice device;
  device.formats = {{kMjpg, 640, 480, {30}}};
  device.flags = [](std::uint32_t sequence) { return sequence == 1 ? V4L2_BUF_FLAG_ERROR : 0u; };
  device.paint = [](std::uint32_t sequence, std::vector<std::uint8_t>& bytes) {
    std::fill(bytes.begin(), bytes.end(), static_cast<std::uint8_t>(sequence));
  };
  device.formats.push_back({kGrey, 640, 480, {30}});
  options_.pixel_format = "GREY";
  system_->plug("/dev/video0", device);
  auto camera = open();
  EXPECT_EQ(camera->next()->index, 0);
  EXPECT_EQ(camera->next()->index, 2);
  auto warnings = camera->take_warnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].frame, 1);
  EXPECT_CONTAINS(warnings[0].text, "damaged frame");
  EXPECT_TRUE(camera->take_warnings().empty());
  camera.reset();

  // What is no JPEG is passed over; the camera is stopped from the side, since no good frame ever comes.
  options_.pixel_format = "MJPG";
  camera = open();
  int waits = 0;
  system_->on_wait = [&](Timestamp) {
    if (++waits == 40) camera->stop();
  };
  EXPECT_FALSE(camera->next());
  EXPECT_EQ(camera->status().damaged, 39u);
  warnings = camera->take_warnings();
  ASSERT_GE(warnings.size(), 2u) << "one a second";
  EXPECT_CONTAINS(warnings[0].text, "damaged JPEG");
}

TEST_F(V4l2CameraTest, DamagedMotionJpegIsDroppedAndTheNextIsWhole) {
  cv::Mat1b image(240, 320);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) image(y, x) = static_cast<uchar>((3 * x + 5 * y) % 251);
  }
  std::vector<std::uint8_t> jpeg;
  cv::imencode(".jpg", image, jpeg);
  const cv::Mat1b decoded = cv::imdecode(jpeg, cv::IMREAD_GRAYSCALE);
  FakeDevice device;
  device.formats = {{kMjpg, 320, 240, {30}}};
  device.paint = [&jpeg](std::uint32_t sequence, std::vector<std::uint8_t>& bytes) {
    std::fill(bytes.begin(), bytes.end(), std::uint8_t{0});
    const auto length = static_cast<std::ptrdiff_t>(sequence % 5 == 2 ? jpeg.size() / 2 : jpeg.size());
    if (sequence % 5 != 3) std::copy(jpeg.begin(), jpeg.begin() + length, bytes.begin());
    if (sequence % 5 == 1) std::fill(bytes.begin() + 2, bytes.begin() + 400, std::uint8_t{0xff});  // its header
  };
  system_->plug("/dev/video0", device);
  const auto camera = open();
  std::vector<int> numbers;
  for (int i = 0; i < 40; ++i) {
    const auto frame = camera->next();
    ASSERT_TRUE(frame);
    numbers.push_back(frame->index);
    ASSERT_EQ(cv::norm(frame->grey, decoded, cv::NORM_INF), 0) << frame->index;
  }
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    EXPECT_EQ(numbers[i], static_cast<int>(i / 2 * 5 + (i % 2 == 0 ? 0 : 4)));
  }
  EXPECT_EQ(camera->status().damaged, 60u);
  EXPECT_EQ(camera->status().skipped, 0u);
  EXPECT_CONTAINS(camera->status().text, " frames are damaged: use another cable or port, not a hub");
  EXPECT_EQ(camera->status().state, CameraState::streaming);
}

TEST_F(V4l2CameraTest, ChoosesSizeThenRateThenFormat) {
  FakeDevice device;
  device.formats = {{kH264, 640, 480, {60}}, {kMjpg, 640, 480, {30, 60}}, {kMjpg, 1280, 720, {30}},
                    {kYuyv, 640, 480, {10}}, {kYuyv, 320, 240, {30}},     {kGrey, 320, 240, {30}}};
  const auto fake = system_->plug("/dev/video0", device);
  open();
  EXPECT_EQ(fourcc_text(fake->format.pixelformat), "MJPG") << "YUYV is too slow at this size";
  EXPECT_EQ(fake->format.width, 640u);
  EXPECT_EQ(fake->rate, 30) << "no faster than asked for";
  options_.fps = 10;
  open();
  EXPECT_EQ(fourcc_text(fake->format.pixelformat), "YUYV");
  options_.width = 320;
  options_.height = 240;
  options_.fps = 30;
  open();
  EXPECT_EQ(fourcc_text(fake->format.pixelformat), "YUYV");
  options_.colour = false;
  open();
  EXPECT_EQ(fourcc_text(fake->format.pixelformat), "GREY");
  options_.width = 1100;
  options_.height = 700;
  open();
  EXPECT_EQ(fake->format.width, 1280u);
}

// As the kernel's vimc: 640x480 becomes 636x480.
TEST_F(V4l2CameraTest, GoesOnWithTheSizeThatTheDriverMadeOfIt) {
  FakeDevice device;
  device.align = 6;
  device.formats = {{kRgb, 640, 480, {30}}};
  device.paint = [](std::uint32_t, std::vector<std::uint8_t>& bytes) {
    for (std::size_t i = 0; i < bytes.size(); ++i)
      bytes[i] = static_cast<std::uint8_t>(i % (3 * 636) / 3);  // the column
  };
  system_->plug("/dev/video0", device);
  const auto camera = open();
  for (int connection = 0; connection < 2; ++connection) {
    EXPECT_EQ(camera->width(), 636);
    EXPECT_EQ(camera->height(), 480);
    const auto frame = camera->next();
    ASSERT_TRUE(frame);
    ASSERT_EQ(frame->grey.size(), cv::Size(636, 480));
    ASSERT_EQ(frame->colour.size(), cv::Size(636, 480));
    for (int y = 0; y < 480; y += 479) {
      for (int x = 0; x < 636; ++x) ASSERT_EQ(frame->colour(y, x), cv::Vec3b::all(static_cast<uchar>(x)));
    }
    // Plugged in again, it makes the same of it.
    system_->pull("/dev/video0");
    system_->plug("/dev/video0", device);
  }
}

TEST_F(V4l2CameraTest, SizesThatGoByStepsMeetTheOneWanted) {
  struct Case {
    int step, width, height;  // of the driver, what is wanted
    unsigned int get_width, get_height;
  };
  // 48 and multiples of the step.
  for (const Case& c : {Case{1, 752, 480, 752, 480}, Case{6, 640, 480, 636, 480}, Case{16, 752, 480, 752, 480},
                        Case{32, 751, 500, 720, 496}, Case{1, 3000, 3000, 1920, 1080}}) {
    FakeDevice device;
    device.formats = {{kGrey, 4096, 2160, {30}, c.step}};
    const auto fake = system_->plug("/dev/video0", device);
    options_.width = c.width;
    options_.height = c.height;
    open();
    EXPECT_EQ(fake->format.width, c.get_width) << c.step;
    EXPECT_EQ(fake->format.height, c.get_height) << c.step;
  }
}

TEST_F(V4l2CameraTest, SaysWhatToDo) {
  EXPECT_EQ(refusal("/dev/video9"),
            "v4l2:/dev/video9: no such device: is the camera plugged in? `parallax cameras` lists what is there");
  EXPECT_CONTAINS(refusal(""), "no camera found");
  system_->plug("/dev/video0")->open_error = EACCES;
  EXPECT_CONTAINS(refusal(), "v4l2:/dev/video0: permission denied: add yourself to the `video` group");
  EXPECT_CONTAINS(refusal(""), "permission denied") << "the only camera there is";
  system_->plug("/dev/video0")->busy = true;
  EXPECT_CONTAINS(refusal(), "v4l2:/dev/video0: busy: another program is using the camera");
  FakeDevice strange;
  strange.formats = {{kH264, 640, 480, {30}}, {kH264, 1280, 720, {30}}, {kYuyv, 64, 48, {30}}};
  system_->plug("/dev/video0", strange);
  EXPECT_EQ(refusal(),
            "v4l2:/dev/video0: no usable format: Fake camera offers H264 640x480 1280x720, YUYV 64x48, expected one of "
            "YUYV, UYVY, NV12, BGR3, RGB3, GREY, MJPG from 160x120 to 1920x1080");
  system_->plug("/dev/video0")->capabilities = V4L2_CAP_META_CAPTURE;
  EXPECT_CONTAINS(refusal(), "does not capture video");
  system_->plug("/dev/video0")->capabilities = V4L2_CAP_VIDEO_CAPTURE_MPLANE | V4L2_CAP_STREAMING;
  EXPECT_CONTAINS(refusal(), "libcamera");
  system_->plug("/dev/video0")->start_error = EPIPE;
  EXPECT_CONTAINS(refusal(), "set up together, which only libcamera does: use libcamera:");
  // Nothing that failed is left open.
  EXPECT_EQ(system_->devices["/dev/video0"]->opened, 0);
  // The first that can be used is taken.
  system_->plug("/dev/video1")->busy = true;
  system_->plug("/dev/video2");
  EXPECT_EQ(open("")->description(), "v4l2:/dev/video2 (Fake camera)");
}

TEST_F(V4l2CameraTest, SurvivesUnplugging) {
  system_->plug("/dev/video0");
  const auto camera = open();
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(camera->next());
  const Timestamp pulled = system_->now();
  system_->pull("/dev/video0");
  int looked = 0;
  system_->on_wait = [&](Timestamp now) {
    const auto status = camera->status();
    if (status.state == CameraState::disconnected) {
      EXPECT_EQ(status.text, "camera disconnected: plug it in again");
      ++looked;
    }
    // In again after three seconds, as another node.
    if (now - pulled >= std::chrono::seconds(3) && system_->devices.empty()) system_->plug("/dev/video1");
  };
  const auto frame = camera->next();
  ASSERT_TRUE(frame);
  EXPECT_GE(looked, 6) << "looks twice a second";
  EXPECT_EQ(frame->index, 5) << "numbers count on";
  EXPECT_GT(frame->time - pulled, std::chrono::seconds(3));
  EXPECT_EQ(camera->status().state, CameraState::streaming);
  EXPECT_EQ(camera->description(), "v4l2:/dev/video1 (Fake camera)");
}

TEST_F(V4l2CameraTest, GoesOnWithAnotherCameraOnlyIfItMay) {
  FakeDevice other;
  other.bus = "usb-2";
  other.card = "Another camera";
  for (const std::string path : {"", "/dev/video0"}) {
    system_ = std::make_shared<FakeV4l2>();
    system_->plug("/dev/video0");
    const auto camera = open(path);
    ASSERT_TRUE(camera->next());
    system_->pull("/dev/video0");
    system_->plug("/dev/video1", other);
    const Timestamp pulled = system_->now();
    system_->on_wait = [&](Timestamp now) {
      if (now - pulled > std::chrono::seconds(5)) camera->stop();
    };
    const auto frame = camera->next();
    EXPECT_EQ(frame.has_value(), path.empty());
    if (frame) {
      EXPECT_EQ(camera->identity(), "fake, Another camera, usb-2");
    }
  }
}

TEST_F(V4l2CameraTest, RefusesAnotherSizeAfterUnplugging) {
  system_->plug("/dev/video0");
  const auto camera = open("");
  ASSERT_TRUE(camera->next());
  system_->pull("/dev/video0");
  FakeDevice other;
  other.formats = {{kYuyv, 320, 240, {30}}};
  system_->plug("/dev/video1", other);
  const Timestamp pulled = system_->now();
  std::string text;
  system_->on_wait = [&](Timestamp now) {
    if (now - pulled < std::chrono::seconds(2)) return;
    text = camera->status().text;
    camera->stop();
  };
  EXPECT_FALSE(camera->next());
  EXPECT_EQ(text,
            "camera disconnected: plug it in again (v4l2:/dev/video1 offers no pictures of 640x480, as the camera "
            "before it)");
}

TEST_F(V4l2CameraTest, OpensACameraAnewThatFellSilent) {
  const auto device = system_->plug("/dev/video0");
  const auto camera = open();
  ASSERT_TRUE(camera->next());
  device->silent = true;
  const Timestamp fell = system_->now();
  bool said = false;
  system_->on_wait = [&](Timestamp) {
    if (camera->status().state != CameraState::disconnected) return;
    said = camera->status().text.find("the camera sends no pictures") == 0;
    device->silent = false;
  };
  const auto frame = camera->next();
  ASSERT_TRUE(frame);
  EXPECT_TRUE(said);
  EXPECT_GT(frame->time - fell, std::chrono::seconds(10));
  EXPECT_EQ(frame->index, 1);
}

// Waits as the kernel does, for the event alone: the camera sends nothing.
class WaitingV4l2 final : public FakeV4l2 {
 public:
  std::promise<void> waiting;
  int poll(std::span<pollfd> descriptors, std::chrono::milliseconds) override {
    if (!told_) waiting.set_value();
    told_ = true;
    descriptors.front().revents = 0;
    constexpr int a_minute = 60000;
    return ::poll(&descriptors.back(), 1, a_minute);
  }

 private:
  bool told_ = false;
};

TEST_F(V4l2CameraTest, StopWakesAReaderThatWaits) {
  const auto system = std::make_shared<WaitingV4l2>();
  system->plug("/dev/video0");
  const auto camera = open_v4l2_camera(system, "/dev/video0", options_);
  std::thread stopper([&] {
    system->waiting.get_future().wait();
    camera->stop();
  });
  EXPECT_FALSE(camera->next());
  stopper.join();
  EXPECT_FALSE(camera->next());
}

// A webcam: what it shows depends on its controls.
FakeDevice webcam() {
  FakeDevice device;
  device.controls = {
      {V4L2_CID_SHARPNESS, "Sharpness", 1, 7, 3, 4},
      {V4L2_CID_AUTO_WHITE_BALANCE, "White Balance, Automatic", 0, 1, 1, 1, V4L2_CTRL_TYPE_BOOLEAN},
      {V4L2_CID_WHITE_BALANCE_TEMPERATURE, "White Balance Temperature", 2800, 6500, 4600, 4321},
      {V4L2_CID_EXPOSURE_AUTO,
       "Auto Exposure",
       0,
       3,
       3,
       3,
       V4L2_CTRL_TYPE_MENU,
       0,
       {{1, "Manual Mode"}, {3, "Aperture Priority Mode"}}},
      {V4L2_CID_EXPOSURE_ABSOLUTE, "Exposure Time, Absolute", 1, 5000, 157, 300},
      {V4L2_CID_EXPOSURE_AUTO_PRIORITY, "Exposure, Dynamic Framerate", 0, 1, 0, 1, V4L2_CTRL_TYPE_BOOLEAN},
      {V4L2_CID_FOCUS_AUTO, "Focus, Automatic Continuous", 0, 1, 1, 1, V4L2_CTRL_TYPE_BOOLEAN},
      {V4L2_CID_FOCUS_ABSOLUTE, "Focus, Absolute", 0, 250, 0, 85},
      {V4L2_CID_BRIGHTNESS, "Brightness", -64, 64, 0, 0},
  };
  return device;
}

std::vector<int> values_of(FakeDevice& device) {
  std::vector<int> values;
  for (const auto& control : device.controls) values.push_back(control.value);
  return values;
}

TEST_F(V4l2CameraTest, TrackingProfileLocksWhatHasSettledAndPutsItBack) {
  const auto device = system_->plug("/dev/video0", webcam());
  const auto before = values_of(*device);
  for (const bool by_stop : {true, false}) {
    device->written.clear();
    auto camera = open();
    EXPECT_EQ(device->control(V4L2_CID_SHARPNESS).value, 1) << "sharpening goes off at once";
    for (int i = 0; i < 29; ++i) camera->next();
    EXPECT_EQ(device->control(V4L2_CID_EXPOSURE_AUTO).value, 3) << "still settling";
    device->control(V4L2_CID_EXPOSURE_ABSOLUTE).value = 222;  // where it settles
    for (int i = 0; i < 5; ++i) camera->next();
    EXPECT_EQ(device->control(V4L2_CID_EXPOSURE_AUTO).value, 1);
    EXPECT_EQ(device->control(V4L2_CID_EXPOSURE_ABSOLUTE).value, 222);
    EXPECT_EQ(device->control(V4L2_CID_AUTO_WHITE_BALANCE).value, 0);
    EXPECT_EQ(device->control(V4L2_CID_WHITE_BALANCE_TEMPERATURE).value, 4321);
    EXPECT_EQ(device->control(V4L2_CID_FOCUS_AUTO).value, 0);
    EXPECT_EQ(device->control(V4L2_CID_FOCUS_ABSOLUTE).value, 85);
    device->control(V4L2_CID_EXPOSURE_ABSOLUTE).value = 300;
    camera->set_control("brightness", 10);
    EXPECT_EQ(device->control(V4L2_CID_BRIGHTNESS).value, 10);
    if (by_stop) {
      camera->stop();
      device->control(V4L2_CID_EXPOSURE_ABSOLUTE).value = 300;
      EXPECT_EQ(values_of(*device), before);
      const std::size_t writes = device->written.size();
      EXPECT_FALSE(camera->next());
      EXPECT_THROW(camera->set_control("brightness", 5), InputError);
      EXPECT_EQ(device->written.size(), writes) << "no control is changed after stop()";
    }
    camera.reset();
    device->control(V4L2_CID_EXPOSURE_ABSOLUTE).value = 300;
    EXPECT_EQ(values_of(*device), before);
    // Values are put back before the automatic that governs them is switched on.
    const auto last = [&](std::uint32_t id) {
      std::size_t at = 0;
      for (std::size_t i = 0; i < device->written.size(); ++i) {
        if (device->written[i].first == id) at = i;
      }
      return at;
    };
    EXPECT_LT(last(V4L2_CID_EXPOSURE_ABSOLUTE), last(V4L2_CID_EXPOSURE_AUTO));
    EXPECT_LT(last(V4L2_CID_FOCUS_ABSOLUTE), last(V4L2_CID_FOCUS_AUTO));
  }
}

TEST_F(V4l2CameraTest, WithoutTheProfileNothingIsTouched) {
  options_.tracking_profile = false;
  const auto device = system_->plug("/dev/video0", webcam());
  const auto camera = open();
  for (int i = 0; i < 60; ++i) camera->next();
  EXPECT_TRUE(device->written.empty());
}

TEST_F(V4l2CameraTest, AnExposureThatCannotBeHeldIsLeftAutomatic) {
  const auto device = system_->plug("/dev/video0", webcam());
  FakeDevice* const fake = device.get();
  // The exposure time it reports is not the one it uses: by hand the picture is three times as bright.
  device->paint = [fake](std::uint32_t, std::vector<std::uint8_t>& bytes) {
    std::fill(bytes.begin(), bytes.end(),
              fake->control(V4L2_CID_EXPOSURE_AUTO).value == 3 ? std::uint8_t{60} : std::uint8_t{180});
  };
  const auto camera = open();
  for (int i = 0; i < 60; ++i) camera->next();
  EXPECT_EQ(device->control(V4L2_CID_EXPOSURE_AUTO).value, 3);
  EXPECT_EQ(device->control(V4L2_CID_FOCUS_AUTO).value, 0) << "the rest stays locked";
  const auto warnings = camera->take_warnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_CONTAINS(warnings[0].text, "the exposure cannot be locked (mean grey level went from 60.0 to 180.0)");
}

TEST_F(V4l2CameraTest, SaysWhyFramesComeSlowly) {
  options_.tracking_profile = false;
  const auto device = system_->plug("/dev/video0", webcam());
  auto camera = open();
  device->rate = 15;  // as in a dark room
  for (int i = 0; i < 40; ++i) camera->next();
  auto status = camera->status();
  EXPECT_NEAR(status.measured_fps, 15, 0.1);
  EXPECT_EQ(status.requested_fps, 30);
  EXPECT_CONTAINS(status.fps_reason, "automatic exposure: more light helps");
  EXPECT_CONTAINS(status.text, "15 frames a second instead of 30: automatic exposure");
  device->control(V4L2_CID_EXPOSURE_AUTO).value = 1;
  device->control(V4L2_CID_EXPOSURE_ABSOLUTE).value = 660;
  for (int i = 0; i < 20; ++i) camera->next();
  EXPECT_CONTAINS(camera->status().fps_reason, "exposure time of 66 ms");
  device->rate = 30;
  for (int i = 0; i < 80; ++i) camera->next();
  EXPECT_EQ(camera->status().text, "");
}

TEST_F(V4l2CameraTest, ControlsAreListedAndSetByName) {
  const auto device = system_->plug("/dev/video0", webcam());
  options_.tracking_profile = false;
  const auto camera = open();
  const auto controls = camera->controls();
  ASSERT_EQ(controls.size(), device->controls.size());
  const auto exposure =
      std::find_if(controls.begin(), controls.end(), [](const auto& c) { return c.name == "auto_exposure"; });
  ASSERT_NE(exposure, controls.end());
  EXPECT_EQ(exposure->value, 3);
  ASSERT_EQ(exposure->menu.size(), 2u);
  EXPECT_EQ(exposure->menu[0], std::make_pair(std::int64_t{1}, std::string("Manual Mode")));
  camera->set_control("auto_exposure", 1);
  EXPECT_EQ(device->control(V4L2_CID_EXPOSURE_AUTO).value, 1);
  EXPECT_THROW(camera->set_control("auto_exposure", 2), InputError) << "not in the menu";
  EXPECT_THROW(camera->set_control("sharpness", 8), InputError) << "out of range";
  try {
    camera->set_control("zoom", 1);
    FAIL() << "there is no such control";
  } catch (const InputError& error) {
    EXPECT_CONTAINS(error.what(), "v4l2:/dev/video0: has no control 'zoom', expected one of ");
    EXPECT_CONTAINS(error.what(), "exposure_time_absolute");
  }
}

TEST_F(V4l2CameraTest, ControlsSetByTheUserOutliveUnplugging) {
  options_.tracking_profile = false;
  system_->plug("/dev/video0", webcam());
  const auto camera = open();
  camera->set_control("brightness", 20);
  camera->next();
  system_->pull("/dev/video0");
  const auto again = system_->plug("/dev/video0", webcam());
  ASSERT_TRUE(camera->next());
  EXPECT_EQ(again->control(V4L2_CID_BRIGHTNESS).value, 20);
}

TEST_F(V4l2CameraTest, ListsWhatThereIs) {
  EXPECT_TRUE(list_v4l2_cameras(system_).empty());
  system_->plug("/dev/video0", webcam());
  system_->plug("/dev/video1")->capabilities = V4L2_CAP_META_CAPTURE;
  system_->plug("/dev/video2")->open_error = EACCES;
  system_->plug("/dev/video3")->busy = true;
  const auto cameras = list_v4l2_cameras(system_);
  ASSERT_EQ(cameras.size(), 3u) << "a device that captures no video is no camera";
  EXPECT_EQ(cameras[0].source, "v4l2:/dev/video0");
  EXPECT_EQ(cameras[0].name, "Fake camera");
  EXPECT_EQ(cameras[0].problem, "");
  ASSERT_EQ(cameras[0].formats.size(), 1u);
  EXPECT_EQ(cameras[0].formats[0].pixel_format, "YUYV");
  EXPECT_EQ(cameras[0].formats[0].rates, (std::vector<double>{30, 15}));
  EXPECT_TRUE(cameras[0].formats[0].usable);
  EXPECT_EQ(cameras[0].controls.size(), 9u);
  EXPECT_CONTAINS(cameras[1].problem, "permission denied");
  EXPECT_CONTAINS(cameras[2].problem, "busy");
}

TEST(ControlName, IsAsTheToolsWriteIt) {
  EXPECT_EQ(control_name("Exposure Time, Absolute"), "exposure_time_absolute");
  EXPECT_EQ(control_name("White Balance, Automatic"), "white_balance_automatic");
  EXPECT_EQ(control_name(" Gain (dB) "), "gain_db");
}

}  // namespace
}  // namespace parallax
