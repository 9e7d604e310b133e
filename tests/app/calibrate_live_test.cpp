// Calibrating at a camera: views are taken by themselves, and unplugging and Ctrl-C keep them.
#include "app/calibrate_live.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <condition_variable>

#include "core/error.h"
#include "core/mutex.h"
#include "tests/calib/rendered_board.h"

namespace parallax {
namespace {

// Shows a board, each place for some frames, and is unplugged after a number of them, for ever or for as many looks at
// its state as it is told.
class FakeCamera final : public LiveCamera {
 public:
  FakeCamera(int unplugged_after, int looks_away) : unplugged_after_(unplugged_after), looks_left_(looks_away) {
    target_ = calib_test::chessboard(5, 4, 0.04);
    const CameraModel lens(CameraModelKind::pinhole, 320, 240, {270, 270}, {160, 120});
    const calib_test::BoardRenderer renderer(lens, target_);
    std::mt19937 random(4);
    for (const auto& pose : calib_test::board_poses(lens, target_, 8, 5))
      pictures_.push_back(renderer.render(pose, &random));
  }

  std::optional<Frame> next() override {
    MutexLock lock(mutex_);
    if (frames_ == unplugged_after_ && looks_left_ != 0) {
      state_ = CameraState::disconnected;
      changed_.wait(mutex_, [this]() PARALLAX_REQUIRES(mutex_) { return stopped_ || looks_left_ == 0; });
    }
    if (stopped_) return std::nullopt;
    state_ = CameraState::streaming;
    Frame frame;
    frame.index = frames_++;
    frame.grey = pictures_[static_cast<std::size_t>(frame.index / kFramesAPlace) % pictures_.size()];
    return frame;
  }
  CameraStatus status() const override {
    MutexLock lock(mutex_);
    CameraStatus out;
    out.state = state_;
    if (state_ == CameraState::disconnected) {
      out.text = "camera disconnected: plug it in again";
      if (looks_left_ > 0 && --looks_left_ == 0) changed_.notify_all();
    }
    return out;
  }
  void stop() override {
    MutexLock lock(mutex_);
    stopped_ = true;
    changed_.notify_all();
  }
  bool disconnected() const {
    MutexLock lock(mutex_);
    return state_ == CameraState::disconnected;
  }

  std::vector<CameraControl> controls() override { return {}; }
  void set_control(const std::string& name, std::int64_t) override { throw InputError(name + ": no such control"); }
  int width() const override { return 320; }
  int height() const override { return 240; }
  std::string identity() const override { return "fake"; }
  std::vector<SourceWarning> take_warnings() override { return {}; }
  double frames_per_second() const override { return 30; }
  std::string description() const override { return "fake"; }
  const CalibrationTarget& target() const { return target_; }

 private:
  static constexpr int kFramesAPlace = 3;
  CalibrationTarget target_;
  std::vector<GreyImage> pictures_;
  mutable Mutex mutex_;
  mutable std::condition_variable_any changed_;
  const int unplugged_after_;
  mutable int looks_left_ PARALLAX_GUARDED_BY(mutex_);  // below 0: for ever
  int frames_ PARALLAX_GUARDED_BY(mutex_) = 0;
  bool stopped_ PARALLAX_GUARDED_BY(mutex_) = false;
  CameraState state_ PARALLAX_GUARDED_BY(mutex_) = CameraState::starting;
};

constexpr int kUnplugged = 14;

std::ptrdiff_t line_of(const std::vector<std::string>& lines, const std::string& part) {
  const auto at = std::find_if(lines.begin(), lines.end(),
                               [&](const std::string& line) { return line.find(part) != std::string::npos; });
  return at == lines.end() ? -1 : at - lines.begin();
}

TEST(CalibrateLive, CtrlCWhileTheCameraIsAwayKeepsTheViews) {
  FakeCamera camera(kUnplugged, -1);
  std::vector<std::string> said;
  LiveGatheringOptions options{camera.target(), 40, 1e6, [&] { return camera.disconnected(); },
                               [&](const std::string& line) { said.push_back(line); }};
  const LiveGathering out = gather_live_views(&camera, options);
  EXPECT_EQ(out.frames, kUnplugged);
  EXPECT_GE(out.data.views.size(), 3u);
  EXPECT_EQ(out.data.width, 320);
  EXPECT_GE(line_of(said, "camera disconnected: plug it in again"), 0);
}

TEST(CalibrateLive, ACameraThatStaysAwayCostsNoMoreThanTheTime) {
  FakeCamera camera(kUnplugged, -1);
  LiveGatheringOptions options{camera.target(), 40, 0.3, {}, [](const std::string&) {}};
  EXPECT_LE(gather_live_views(&camera, options).frames, kUnplugged);
}

TEST(CalibrateLive, GoesOnWhenTheCameraIsBack) {
  FakeCamera camera(kUnplugged, 3);
  std::vector<std::string> said;
  std::size_t views = 0;
  LiveGatheringOptions options{camera.target(), 40, 1e6, {}, [&](const std::string& line) {
                                 said.push_back(line);
                                 views += line.find("; next: ") != std::string::npos;
                                 if (views >= 6 && line_of(said, "the camera is back") >= 0) camera.stop();
                               }};
  const LiveGathering out = gather_live_views(&camera, options);
  EXPECT_GT(out.frames, kUnplugged);
  EXPECT_GE(out.data.views.size(), 6u);
  const auto away = line_of(said, "camera disconnected"), back = line_of(said, "the camera is back");
  EXPECT_GE(away, 0);
  EXPECT_GT(back, away);
  EXPECT_EQ(std::count(said.begin(), said.end(), "camera disconnected: plug it in again"), 1);
}

}  // namespace
}  // namespace parallax
