// `parallax live --headless` as a robot meets it, and the pieces of the live program that need no window.
#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <thread>

#include "app/live_feed.h"
#include "app/live_pointing.h"
#include "app/screenshot.h"
#include "core/error.h"
#include "core/trajectory.h"
#include "core/trajectory_error.h"
#include "tests/support/file_size_limit.h"
#include "tests/support/process.h"

namespace parallax::testing {
namespace {

namespace fs = std::filesystem;

// A program that ignores whatever the user of this machine has set.
struct LiveRun {
  ScratchFolder folder;
  std::vector<std::string> environment() const {
    return {"XDG_CONFIG_HOME=" + folder.path().string(), "XDG_DATA_HOME=" + folder.path().string(),
            "DISPLAY=", "WAYLAND_DISPLAY=", "PARALLAX_SETTINGS="};
  }
  ProcessResult operator()(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "live");
    return run_process(PARALLAX_BINARY, arguments, environment());
  }
};

TEST(LiveHeadless, EndsAtItsLimitWithWholeFiles) {
  const LiveRun live;
  const auto result = live({"--headless", "--camera", "synthetic:desk?size=320x240", "--frames-limit", "140",
                            "--trajectory", live.folder.file("t.txt"), "--truth", live.folder.file("truth.txt"),
                            "--report", live.folder.file("r.json")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(result.err.empty()) << result.err;
  EXPECT_NE(result.out.find("frames 140"), std::string::npos) << result.out;
  const auto report = nlohmann::json::parse(read_all(live.folder.file("r.json")));
  EXPECT_EQ(report.at("frames").at("read"), 140);
  EXPECT_EQ(report.at("source").at("name"), "synthetic:desk?size=320x240");
  // Both files hold the same desk.
  const auto error = evaluate_trajectory(read_trajectory(live.folder.file("t.txt")),
                                         read_trajectory(live.folder.file("truth.txt")), {});
  EXPECT_GT(error.matches.size(), 20u);
  EXPECT_LT(summarise_errors(error.position).rmse, 0.005);
}

TEST(LiveHeadless, AVideoThatCannotBeFinishedCostsOnlyItself) {
  const LiveRun live;
  ProcessResult result;
  {
    const FileSizeLimit limit(60000);
    result = live({"--headless", "--camera", "synthetic:desk?size=320x240", "--frames-limit", "60", "--video",
                   live.folder.file("v.avi"), "--report", live.folder.file("r.json"), "--truth",
                   live.folder.file("truth.txt")});
  }
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(count_lines(result.err), 1) << result.err;
  EXPECT_NE(result.err.find(live.folder.file("v.avi") + ": cannot be written"), std::string::npos) << result.err;
  EXPECT_FALSE(fs::exists(live.folder.file("v.avi")));
  EXPECT_EQ(nlohmann::json::parse(read_all(live.folder.file("r.json"))).at("frames").at("read"), 60);
  EXPECT_GE(read_trajectory(live.folder.file("truth.txt")).size(), 60u);
}

TEST(LiveHeadless, SecondsAreALimitToo) {
  const LiveRun live;
  const auto result =
      live({"--headless", "--camera", "synthetic:blank?size=160x120&frames=100000", "--seconds", "0.5"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(count_lines(result.err), 1) << result.err;
  EXPECT_NE(result.err.find("never started"), std::string::npos) << result.err;
}

TEST(LiveHeadless, NoDisplayLeavesAVideoAndSaysWhere) {
  const LiveRun live;
  const auto result = live(
      {"--camera", "synthetic:desk?size=160x120", "--frames-limit", "20", "--output", live.folder.path().string()});
  EXPECT_NE(result.out.find(live.folder.file("parallax-demo.mp4")), std::string::npos) << result.out << result.err;
  EXPECT_GT(fs::file_size(live.folder.file("parallax-demo.mp4")), 1000u);
}

TEST(LiveHeadless, BadSettingsAreOneLine) {
  const LiveRun live;
  fs::create_directories(live.folder.path() / "parallax");
  live.folder.write("parallax/settings.yaml", "keys: {reset: Rr}\n");
  const auto result = live({"--headless", "--camera", "synthetic:desk", "--frames-limit", "1"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_EQ(count_lines(result.err), 1) << result.err;
  EXPECT_NE(result.err.find("settings.yaml: key keys.reset: found 'Rr'"), std::string::npos) << result.err;
}

TEST(LiveHeadless, NoSuchSourceIsOneLine) {
  const LiveRun live;
  for (const char* source : {"v4l2:/dev/nowhere", "synthetic:nowhere", "/nonexistent/recording"}) {
    const auto result = live({"--headless", "--camera", source});
    EXPECT_EQ(result.exit_code, 2) << source;
    EXPECT_EQ(count_lines(result.err), 1) << result.err;
  }
}

// Ends the program in the middle with the signal that a service manager sends.
TEST(LiveHeadless, TerminationLeavesWholeFiles) {
  const LiveRun live;
  ProcessResult result;
  std::jthread runner([&] {
    result =
        run_process("/bin/sh",
                    {"-c", "echo $$ > " + live.folder.file("pid") +
                               "; exec '" PARALLAX_BINARY
                               "' live --headless --camera 'synthetic:desk?size=160x120&frames=100000' --trajectory " +
                               live.folder.file("t.txt") + " --report " + live.folder.file("r.json") + " --video " +
                               live.folder.file("v.avi")},
                    live.environment());
  });
  // The video is written beside its place, under another name: it grows once frames come.
  const auto begun = [&] {
    for (const auto& entry : fs::recursive_directory_iterator(live.folder.path()))
      if (entry.is_regular_file() && entry.file_size() > 20'000) return true;
    return false;
  };
  const auto patience = SteadyClock::now() + std::chrono::seconds(60);
  while (!begun() && SteadyClock::now() < patience) std::this_thread::yield();
  ASSERT_EQ(kill(std::stoi(read_all(live.folder.file("pid"))), SIGTERM), 0);
  runner.join();
  EXPECT_LE(result.exit_code, 1) << result.err;
  EXPECT_NE(result.out.find("frames "), std::string::npos) << result.out;
  EXPECT_FALSE(nlohmann::json::parse(read_all(live.folder.file("r.json")), nullptr, false).is_discarded());
  EXPECT_GT(fs::file_size(live.folder.file("v.avi")), 1000u);
  for (const auto& entry : fs::directory_iterator(live.folder.path()))
    EXPECT_LE(entry.path().filename().string().size(), 8u) << "left behind: " << entry.path();
}

LiveSource stepping_source(const std::string& name) {
  LiveSourceOptions options;
  options.threads = 1;
  return open_live_source(name, "", options);
}

TEST(LiveFeedTest, TapsComeAndGoWhileTheSourceStaysOpen) {
  LiveFeed feed(stepping_source("synthetic:desk?size=160x120"));
  for (int session = 0; session < 2; ++session) {
    const auto tap = feed.tap();
    int last = -1;
    for (int i = 0; i < 3; ++i) {
      const auto frame = tap->next();
      ASSERT_TRUE(frame.has_value());
      EXPECT_GT(frame->index, last);
      last = frame->index;
    }
    tap->stop();
    EXPECT_FALSE(tap->next().has_value());
  }
  EXPECT_FALSE(feed.ended());
  const auto newest = feed.newest();
  ASSERT_NE(newest, nullptr);
  EXPECT_NE(feed.wait_for_other(newest, std::chrono::seconds(20)), nullptr);
}

TEST(LiveFeedTest, SaysWhenARecordingEnds) {
  LiveFeed feed(stepping_source("synthetic:desk?size=160x120&path=own&frames=3"));
  const auto tap = feed.tap();
  int frames = 0;
  while (tap->next()) ++frames;
  EXPECT_GE(frames, 1);
  EXPECT_LE(frames, 3);
}

TEST(ScreenVideoTest, KeepsAnEvenRate) {
  const ScratchFolder folder;
  ScreenVideo video(folder.file("v.avi"), {65, 49}, 10);
  const cv::Mat3b picture(49, 65, cv::Vec3b(10, 20, 30));
  EXPECT_TRUE(video.due(0));
  video.add(picture, 0);
  EXPECT_FALSE(video.due(0.05));
  EXPECT_TRUE(video.due(0.1));
  video.add(picture, 0.55);                                  // late: the picture stands still for five more
  video.add(cv::Mat3b(100, 100, cv::Vec3b(1, 2, 3)), 0.65);  // the window was resized
  video.close();
  EXPECT_GT(fs::file_size(folder.file("v.avi")), 1000u);
}

TEST(Screenshots, AreNeverWrittenOverEachOther) {
  const ScratchFolder folder;
  const cv::Mat3b picture(10, 10, cv::Vec3b(1, 2, 3));
  const std::string sub = folder.file("new/folder");
  const std::string a = save_screenshot(picture, sub), b = save_screenshot(picture, sub);
  EXPECT_NE(a, b);
  EXPECT_TRUE(fs::exists(a));
  EXPECT_TRUE(fs::exists(b));
  folder.write("file", "");
  EXPECT_THROW(save_screenshot(picture, folder.file("file")), RunError);
}

// A frame that looks down at a plane from 60 cm.
class Pointing : public ::testing::Test {
 protected:
  Pointing() : lens_(CameraModelKind::pinhole, 640, 480, {500, 500}, {320, 240}) {
    auto map = std::make_shared<TrackingSnapshot>();
    map->map_version = 1;
    map->keyframes.emplace_back();
    map->plane = Plane{};
    map->plane->extent_m = 1;
    map->planes = {*map->plane};
    frame_.map = map;
    // Camera above the origin, looking down: x right, y towards -y of the plane.
    Eigen::Matrix3d R;
    R << 1, 0, 0, 0, -1, 0, 0, 0, -1;
    frame_.tracked.camera_from_world = RigidTransform(R, {0, 0, 0.6});
    frame_.tracked.state = TrackingState::tracking;
    frame_.tracked.map_version = 1;
    state_.content.follow(*map);
  }
  CameraModel lens_;
  LiveFrame frame_;
  LiveState state_;
  LivePointing pointing_;
};

TEST_F(Pointing, LabelGoesWhereTheCursorPoints) {
  pointing_.place_label(lens_, frame_, Eigen::Vector2d(420, 240), &state_);
  ASSERT_EQ(state_.content.items().size(), 1u);
  EXPECT_NEAR((state_.content.items()[0].position() - Eigen::Vector3d(0.12, 0, 0)).norm(), 0, 1e-9);
  EXPECT_EQ(state_.task, Task::write_label);
  // Without a cursor: on the optical axis.
  pointing_.place_model(lens_, frame_, std::nullopt, &state_);
  ASSERT_EQ(state_.content.items().size(), 2u);
  EXPECT_NEAR(state_.content.items()[1].position().norm(), 0, 1e-9);
}

TEST_F(Pointing, LostOrBesideTheTableIsToldAndNothingIsPlaced) {
  frame_.tracked.camera_from_world.reset();
  pointing_.place_label(lens_, frame_, Eigen::Vector2d(420, 240), &state_);
  EXPECT_TRUE(state_.content.items().empty());
  ASSERT_EQ(state_.toasts.current().size(), 1u);
  EXPECT_TRUE(state_.toasts.current()[0].problem);
}

TEST_F(Pointing, DragMovesWhatWasGrabbed) {
  pointing_.place_model(lens_, frame_, Eigen::Vector2d(320, 240), &state_);
  const auto at = [&](double x, bool down) {
    return pointing_.update(lens_, frame_, Eigen::Vector2d(x, 240), down, &state_);
  };
  EXPECT_FALSE(at(320, false));
  EXPECT_TRUE(at(322, true));
  EXPECT_TRUE(at(370, true));
  at(370, false);
  EXPECT_NEAR((state_.content.items()[0].position() - Eigen::Vector3d(0.06, 0, 0)).norm(), 0, 1e-9);
  // A press on nothing leaves the drag to others, and nothing selected.
  EXPECT_FALSE(at(100, true));
  EXPECT_FALSE(state_.selected.has_value());
  at(100, false);
  pointing_.erase(lens_, frame_, Eigen::Vector2d(370, 240), &state_);
  EXPECT_TRUE(state_.content.items().empty());
}

TEST_F(Pointing, TwoClicksMeasure) {
  state_.task = Task::measure_first;
  const auto click = [&](double x) {
    pointing_.update(lens_, frame_, Eigen::Vector2d(x, 240), false, &state_);
    EXPECT_TRUE(pointing_.update(lens_, frame_, Eigen::Vector2d(x, 240), true, &state_));
  };
  click(320);
  EXPECT_EQ(state_.task, Task::measure_second);
  click(420);
  EXPECT_EQ(state_.task, Task::measure_distance);
  ASSERT_EQ(state_.measured.size(), 2u);
  EXPECT_NEAR((state_.measured[1] - state_.measured[0]).norm(), 0.12, 1e-9);
}

}  // namespace
}  // namespace parallax::testing
