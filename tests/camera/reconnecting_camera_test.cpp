// What every live camera does when things go wrong, on a back end that follows a script and has its own clock.
#include "camera/reconnecting_camera.h"

#include <gtest/gtest.h>

#include <memory>
#include <set>
#include <string>

#include "core/error.h"
#include "tests/camera/camera_backend_fake.h"

namespace parallax {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::FakeBackend;
using testing::FakeBus;
using testing::ScriptedCamera;

constexpr char kPlugIn[] = "camera disconnected: plug it in again";

class ReconnectingCameraTest : public ::testing::Test {
 protected:
  std::unique_ptr<ReconnectingCamera> open() {
    return std::make_unique<ReconnectingCamera>(std::make_unique<FakeBackend>(bus_), LiveCameraOptions{});
  }
  std::string refusal() {
    try {
      open();
    } catch (const InputError& error) {
      return error.what();
    }
    return "was opened";
  }
  // Runs `change` once, `after` from now.
  void later(Timestamp after, std::function<void()> change) {
    script_.emplace(bus_->now + after, std::move(change));
    bus_->on_wait = [this] {
      while (!script_.empty() && script_.begin()->first <= bus_->now) {
        const auto due = script_.extract(script_.begin());
        due.mapped()();
      }
    };
  }
  // The texts told at every step of time until the next frame, by what it told while there were no pictures.
  std::set<std::string> texts_until_frame(ReconnectingCamera& camera, std::optional<Frame>* frame) {
    std::set<std::string> texts;
    const auto script = bus_->on_wait;
    bus_->on_wait = [&] {
      if (script) script();
      const auto status = camera.status();
      if (status.state == CameraState::disconnected) texts.insert(status.text);
    };
    *frame = camera.next();
    bus_->on_wait = script;
    return texts;
  }

  std::shared_ptr<FakeBus> bus_ = std::make_shared<FakeBus>();
  std::multimap<Timestamp, std::function<void()>> script_;
};

TEST_F(ReconnectingCameraTest, TakesTheFirstThatCanBeUsed) {
  EXPECT_EQ(refusal(), "fake: no camera found");
  bus_->plug("a")->always_refuses = "busy";
  bus_->plug("b")->always_refuses = "permission denied";
  EXPECT_EQ(refusal(), "fake:a: busy") << "what is wrong with the first";
  const auto camera = bus_->plug("c");
  EXPECT_EQ(open()->description(), "fake:c");
  EXPECT_EQ(camera->open, 0) << "left open";
}

TEST_F(ReconnectingCameraTest, GoesOnWithTheSameCamera) {
  bus_->plug("a");
  const auto camera = open();
  EXPECT_EQ(camera->status().state, CameraState::starting);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(camera->next()->index, i);
  EXPECT_EQ(camera->status().state, CameraState::streaming);
  camera->set_control("brightness", 9);
  const auto gone = bus_->cameras.at("a");
  const Timestamp pulled = bus_->now;
  bus_->pull("a");
  std::shared_ptr<ScriptedCamera> again;
  later(seconds(60), [&] {
    EXPECT_EQ(gone->open, 0) << "the connection is over";
    EXPECT_EQ(camera->status().state, CameraState::disconnected);
    EXPECT_EQ(camera->status().measured_fps, 0);
    EXPECT_TRUE(camera->controls().empty());
    EXPECT_THROW(camera->set_control("brightness", 1), InputError);
    EXPECT_NEAR(bus_->looks, 120, 3) << "looks twice a second";
    again = bus_->plug("b");
  });
  std::optional<Frame> frame;
  EXPECT_EQ(texts_until_frame(*camera, &frame), std::set<std::string>{kPlugIn});
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->index, 5) << "numbers count on";
  EXPECT_GT(frame->time - pulled, seconds(60));
  EXPECT_LE(frame->time - pulled, milliseconds(60700));
  EXPECT_EQ(camera->status().state, CameraState::streaming);
  EXPECT_EQ(camera->status().text, "");
  EXPECT_EQ(camera->description(), "fake:b");
  EXPECT_EQ(again->controls["brightness"], 9) << "what the user set outlives it";
}

TEST_F(ReconnectingCameraTest, ThatWhichWasLostComesFirst) {
  bus_->plug("m");
  const auto camera = open();
  camera->next();
  bus_->pull("m");
  ScriptedCamera other;
  other.identity = "fake, another, bus 2";
  bus_->plug("a", other);
  bus_->plug("z");
  ASSERT_TRUE(camera->next());
  EXPECT_EQ(camera->description(), "fake:z");
  bus_->pull("z");
  ASSERT_TRUE(camera->next());
  EXPECT_EQ(camera->identity(), "fake, another, bus 2") << "another one will do";
}

TEST_F(ReconnectingCameraTest, AnotherSizeWillNotDo) {
  bus_->plug("a");
  const auto camera = open();
  camera->next();
  bus_->pull("a");
  ScriptedCamera other;
  other.identity = "another";
  other.width = 640;
  other.height = 480;
  const auto large = bus_->plug("b", other);
  later(seconds(5), [&] { bus_->plug("c"); });
  std::optional<Frame> frame;
  const auto texts = texts_until_frame(*camera, &frame);
  EXPECT_TRUE(texts.count(std::string(kPlugIn) + " (fake:b offers no pictures of 320x240, as the camera before it)"));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->grey.cols, 320);
  EXPECT_EQ(camera->description(), "fake:c");
  EXPECT_EQ(large->open, 0) << "let go of again";
}

TEST_F(ReconnectingCameraTest, SaysWhyACameraThatIsBackCannotBeUsed) {
  for (const std::string problem :
       {"busy: another program is using the camera", "permission denied", "no usable format"}) {
    bus_ = std::make_shared<FakeBus>();
    bus_->plug("a");
    const auto camera = open();
    camera->next();
    bus_->pull("a");
    ScriptedCamera refusing;
    refusing.always_refuses = problem;
    const auto back = bus_->plug("a", refusing);
    later(seconds(4), [&] { back->always_refuses.clear(); });
    std::optional<Frame> frame;
    EXPECT_EQ(texts_until_frame(*camera, &frame),
              (std::set<std::string>{kPlugIn, std::string(kPlugIn) + " (fake:a: " + problem + ")"}));
    ASSERT_TRUE(frame);
    EXPECT_EQ(camera->status().text, "");
    script_.clear();
  }
}

TEST_F(ReconnectingCameraTest, ARefusalOfAMomentIsNotTold) {
  bus_->plug("a");
  const auto camera = open();
  camera->next();
  bus_->pull("a");
  ScriptedCamera slow;
  slow.refusals = {"permission denied"};  // its node is there before its permissions are
  const auto back = bus_->plug("a", slow);
  std::optional<Frame> frame;
  EXPECT_EQ(texts_until_frame(*camera, &frame), std::set<std::string>{kPlugIn});
  EXPECT_TRUE(frame);
  EXPECT_EQ(back->openings, 2);
}

TEST_F(ReconnectingCameraTest, StopEndsEveryWait) {
  for (const bool unplugged : {false, true}) {
    bus_ = std::make_shared<FakeBus>();
    const auto fake = bus_->plug("a");
    const auto camera = open();
    camera->next();
    fake->silent = true;
    if (unplugged) bus_->pull("a");
    later(seconds(3), [&] { camera->stop(); });
    const Timestamp asked = bus_->now;
    EXPECT_FALSE(camera->next());
    EXPECT_EQ(bus_->now - asked, seconds(3)) << "no further wait after it";
    EXPECT_FALSE(camera->next());
    EXPECT_EQ(camera->status().text, "camera stopped");
    EXPECT_EQ(fake->open, 0);
    script_.clear();
  }
}

TEST_F(ReconnectingCameraTest, DamagedFramesAreDroppedCountedAndTold) {
  const auto fake = bus_->plug("a");
  fake->damaged = [](int number) { return number >= 10 && number < 40; };
  fake->driver_says_damaged = [](int number) { return number == 45; };
  const auto camera = open();
  for (int i = 0; i < 10; ++i) camera->next();
  // Three seconds of them.
  auto frame = camera->next();
  ASSERT_TRUE(frame);
  EXPECT_FALSE(fake->lent);
  EXPECT_EQ(frame->index, 40);
  EXPECT_EQ(frame->grey(0, 0), 40);
  EXPECT_EQ(camera->status().damaged, 30u);
  EXPECT_EQ(camera->status().skipped, 0u);
  EXPECT_EQ(camera->status().state, CameraState::streaming);
  // One line at once, then one a second.
  auto warnings = camera->take_warnings();
  ASSERT_GE(warnings.size(), 3u);
  EXPECT_LE(warnings.size(), 4u);
  EXPECT_EQ(warnings[0].frame, 10);
  EXPECT_EQ(warnings[0].text, "fake:a: skipped: holds 100 bytes, expected 76800");
  EXPECT_EQ(warnings[1].frame, 11);
  EXPECT_EQ(warnings[1].text, "fake:a: skipped: holds 100 bytes, expected 76800 (10 frames)");
  EXPECT_NE(camera->status().text.find(" frames are damaged: use another cable or port, not a hub"), std::string::npos)
      << camera->status().text;
  for (int i = 0; i < 5; ++i) frame = camera->next();
  EXPECT_EQ(frame->index, 46);
  EXPECT_EQ(camera->status().damaged, 31u);
  for (int i = 0; i < 20; ++i) camera->next();
  EXPECT_EQ(camera->status().text, "") << "it is over";
  warnings = camera->take_warnings();
  ASSERT_FALSE(warnings.empty());
  EXPECT_NE(warnings.back().text.find("the driver reports a damaged frame"), std::string::npos);
  EXPECT_EQ(fake->openings, 1) << "nothing fatal";
  EXPECT_NEAR(camera->status().measured_fps, 10, 1e-6);
}

// Both a driver that says so and bytes that are no picture.
TEST_F(ReconnectingCameraTest, OnlyDamagedFramesForTenSecondsAreTold) {
  for (const bool by_driver : {false, true}) {
    bus_ = std::make_shared<FakeBus>();
    const auto fake = bus_->plug("a");
    const auto bad = [](int number) { return number >= 5 && number < 400; };
    (by_driver ? fake->driver_says_damaged : fake->damaged) = bad;
    const auto camera = open();
    for (int i = 0; i < 5; ++i) camera->next();
    const std::string text = std::string("the camera sends only damaged pictures (") +
                             (by_driver ? "the driver reports a damaged frame" : "holds 100 bytes, expected 76800") +
                             "): starting it again; if that does not help, use another cable or port, not a hub";
    Timestamp told{0};
    const Timestamp begun = bus_->now;
    bus_->on_wait = [&] {
      if (told == Timestamp(0) && camera->status().state == CameraState::disconnected) {
        told = bus_->now;
        EXPECT_EQ(camera->status().text, text);
      } else if (told != Timestamp(0)) {
        EXPECT_EQ(camera->status().text, text) << "until a good one comes";
      }
    };
    const auto frame = camera->next();
    bus_->on_wait = nullptr;
    ASSERT_TRUE(frame);
    EXPECT_GT(told - begun, seconds(10));
    EXPECT_LT(told - begun, seconds(11));
    EXPECT_EQ(frame->index, 400);
    EXPECT_EQ(camera->status().damaged, 395u);
    EXPECT_EQ(camera->status().state, CameraState::streaming);
    EXPECT_EQ(camera->status().text.find("only damaged"), std::string::npos);
    EXPECT_EQ(fake->openings, 4) << "started again every ten seconds";
    EXPECT_LT(camera->take_warnings().size(), 50u);
  }
}

TEST_F(ReconnectingCameraTest, ASilentCameraIsStartedAgain) {
  const auto fake = bus_->plug("a");
  const auto camera = open();
  camera->next();
  // Nobody asks for a minute: that is no silence of the camera's.
  bus_->pass(seconds(60));
  fake->silent = true;
  later(seconds(25), [&] { fake->silent = false; });
  std::optional<Frame> frame;
  EXPECT_EQ(texts_until_frame(*camera, &frame),
            (std::set<std::string>{"the camera sends no pictures: starting it again; if that does not help, plug it in "
                                   "again"}));
  EXPECT_TRUE(frame);
  EXPECT_EQ(fake->openings, 3);
  // Unplugged meanwhile: that is what is told.
  fake->silent = true;
  later(seconds(15), [&] { bus_->pull("a"); });
  later(seconds(20), [&] {
    EXPECT_EQ(camera->status().text, kPlugIn);
    camera->stop();
  });
  EXPECT_FALSE(camera->next());
}

TEST_F(ReconnectingCameraTest, TimesGrowWhateverTheDriverSays) {
  const auto fake = bus_->plug("a");
  fake->stamp = [](Timestamp time, int number) -> Timestamp {
    if (number == 3) return time - seconds(2);         // backwards
    if (number == 4) return time - milliseconds(300);  // before the one before it
    if (number == 6) return time + std::chrono::hours(5);
    if (number == 8) return Timestamp(0);
    if (number >= 20) return time - seconds(300);  // another clock
    return time;
  };
  const auto camera = open();
  Timestamp last{0};
  for (int i = 0; i < 40; ++i) {
    const auto frame = camera->next();
    ASSERT_TRUE(frame);
    EXPECT_GT(frame->time, last);
    if (i > 0) {
      EXPECT_NEAR(to_seconds(frame->time - last), 0.1, 1e-9) << i;
    }
    last = frame->time;
  }
  EXPECT_NEAR(camera->status().measured_fps, 10, 1e-6);
  // Another camera's clock may be behind.
  bus_->pull("a");
  ScriptedCamera other;
  other.stamp = [](Timestamp time, int) { return time - seconds(30); };
  bus_->plug("a", other);
  const auto frame = camera->next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->time, bus_->now);
}

TEST_F(ReconnectingCameraTest, SkippedFramesLeaveHolesInTheNumbers) {
  const auto fake = bus_->plug("a");
  fake->lost_before = [](int number) { return number == 4 ? 3 : 0; };
  const auto camera = open();
  std::vector<int> numbers;
  for (int i = 0; i < 6; ++i) numbers.push_back(camera->next()->index);
  EXPECT_EQ(numbers, (std::vector<int>{0, 1, 2, 3, 7, 8}));
  EXPECT_EQ(camera->status().skipped, 3u);
}

TEST_F(ReconnectingCameraTest, SaysWhyItIsSlow) {
  const auto fake = bus_->plug("a");
  fake->interval = milliseconds(250);
  fake->slow_because = "it is dark";
  const auto camera = open();
  for (int i = 0; i < 10; ++i) camera->next();
  EXPECT_EQ(camera->status().fps_reason, "it is dark");
  EXPECT_EQ(camera->status().text, "4 frames a second instead of 10: it is dark");
}

}  // namespace
}  // namespace parallax
