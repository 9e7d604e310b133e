// The real window on a virtual screen: keys pressed with xdotool, screenshots looked at.
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "render/synthetic_source.h"
#include "tests/e2e/window_fixture.h"

namespace parallax::testing {
namespace {

class WindowTest : public WindowFixture {};

// How many pixels have the colour of the grid: blue-green, lighter than anything of the desk.
int grid_pixels(const cv::Mat3b& picture) {
  cv::Mat hsv, mask;
  cv::cvtColor(picture, hsv, cv::COLOR_BGR2HSV);
  cv::inRange(hsv, cv::Scalar(90, 90, 150), cv::Scalar(110, 255, 255), mask);
  return cv::countNonZero(mask);
}

TEST_F(WindowTest, KeysInitialiseShowTheMapAndSavePictures) {
  start("synthetic:desk?size=320x240");
  ASSERT_TRUE(title_says("waiting")) << read_all(folder_.file("log"));

  // The desk as the camera sees it from where it starts, upright and unmirrored; tremor and sampling differ.
  const cv::Mat3b live = screenshot();
  ASSERT_EQ(live.size(), cv::Size(640, 480));
  const cv::Mat3b sequence = open_synthetic_source("desk?size=320x240",
                                                   [] {
                                                     SourceOptions options;
                                                     options.colour = true;
                                                     return options;
                                                   }())
                                 ->frame(0)
                                 .colour;
  cv::Mat3b small, seen;
  cv::resize(live, small, {32, 24}, 0, 0, cv::INTER_AREA);
  cv::resize(sequence, seen, {32, 24}, 0, 0, cv::INTER_AREA);
  const auto rows = cv::Range(5, 22);  // between hint and state line
  EXPECT_LT(cv::norm(small.rowRange(rows), seen.rowRange(rows), cv::NORM_L1) / (3.0 * 32 * rows.size()), 14);
  cv::Mat3b mirrored;
  cv::flip(seen, mirrored, 1);
  EXPECT_GT(cv::norm(small.rowRange(rows), mirrored.rowRange(rows), cv::NORM_L1) / (3.0 * 32 * rows.size()), 25);

  ASSERT_TRUE(initialise()) << read_all(folder_.file("log"));
  const cv::Mat3b tracked = screenshot();
  ASSERT_FALSE(tracked.empty());
  EXPECT_GT(grid_pixels(tracked), grid_pixels(live) + 400);

  key("m");
  ASSERT_TRUE(title_says("map"));
  const cv::Mat3b map = screenshot();
  ASSERT_FALSE(map.empty());
  EXPECT_LT(cv::mean(cv::mean(map))[0], 0.6 * cv::mean(cv::mean(live))[0]);  // lines and points on a dark ground
  cv::Mat grey;
  cv::cvtColor(map, grey, cv::COLOR_BGR2GRAY);
  EXPECT_GT(cv::countNonZero(grey > 90), 300);

  key("q");
  const auto code = program_->wait_for(std::chrono::seconds(30));
  ASSERT_TRUE(code.has_value()) << "q does not quit";
  EXPECT_EQ(*code, 0) << read_all(folder_.file("log"));
  const auto report = nlohmann::json::parse(read_all(folder_.file("r.json")), nullptr, false);
  ASSERT_FALSE(report.is_discarded());
  EXPECT_GT(report.at("frames").at("tracked").get<int>(), 5);
  EXPECT_EQ(pictures(), 3);
  const std::string state = read_all(folder_.file("parallax/state.yaml"));
  EXPECT_NE(state.find("width: 640"), std::string::npos) << state;
  EXPECT_NE(state.find("future: kept"), std::string::npos) << state;
}

// The menu of the games with keys alone: cards, settings, the explanation before the first start, back out. A key that
// the settings give to another action is no reason not to start.
TEST_F(WindowTest, TheGamesHaveAMenu) {
  folder_.write("parallax/settings.yaml", "keys: {label: E, model: B}\n");
  start("synthetic:desk?size=160x120");
  ASSERT_TRUE(title_says("waiting")) << read_all(folder_.file("log"));
  const auto menu_is_closed = [&] {
    for (int i = 0; i < 300; ++i) {
      if (xdotool({"search", "--name", "Parallax", "getwindowname"}).find("games") == std::string::npos) return true;
      poll(nullptr, 0, 30);
    }
    return false;
  };
  const cv::Mat3b before = screenshot();
  key("g");
  ASSERT_TRUE(title_says("games"));
  const cv::Mat3b cards = screenshot();
  ASSERT_EQ(cards.size(), before.size());
  // Three pictures of the desk on a dark ground: at the left and right edge of the menu it is dark, in the cards not.
  cv::Mat grey;
  cv::cvtColor(cards, grey, cv::COLOR_BGR2GRAY);
  const int dark = cv::countNonZero(grey < 60), all = grey.rows * grey.cols;
  EXPECT_GT(dark, all / 5);
  EXPECT_GT(cv::countNonZero(grey > 100), all / 12);
  key("Down");
  key("Right");
  key("Right");
  key("Return");  // the settings
  key("Right");   // louder
  key("Escape");
  key("Escape");
  ASSERT_TRUE(menu_is_closed());
  key("g");
  ASSERT_TRUE(title_says("games"));
  key("g");
  key("Return");  // explained
  key("Return");  // begun
  ASSERT_TRUE(menu_is_closed());
  key("q");
  const auto code = program_->wait_for(std::chrono::seconds(30));
  ASSERT_TRUE(code.has_value()) << "q does not quit";
  EXPECT_EQ(*code, 0) << read_all(folder_.file("log"));
  const auto kept = nlohmann::json::parse(read_all(folder_.file("parallax/games.json")), nullptr, false);
  ASSERT_FALSE(kept.is_discarded());
  EXPECT_NEAR(kept.at("volume").get<double>(), 0.8, 1e-9);
  EXPECT_EQ(kept.at("explained"), nlohmann::json::array({"burning_glass"}));
}

TEST_F(WindowTest, UnknownLensIsAskedForAndMarked) {
  start("synthetic:desk?size=160x120&calibration=none");
  ASSERT_TRUE(title_says("first time")) << read_all(folder_.file("log"));
  // The lower of the two large buttons, in the middle of the window.
  bool went_on = false;
  for (int attempt = 0; attempt < 5 && !went_on; ++attempt) {
    xdotool({"mousemove", "320", "287", "click", "1"});
    went_on = title_says("waiting", 5);
  }
  EXPECT_TRUE(went_on);
  ASSERT_EQ(kill(std::stoi(xdotool({"search", "--name", "Parallax", "getwindowpid"})), SIGTERM), 0);
  const auto code = program_->wait_for(std::chrono::seconds(30));
  ASSERT_TRUE(code.has_value()) << "SIGTERM does not end it";
  EXPECT_EQ(*code, 0) << read_all(folder_.file("log"));
  EXPECT_FALSE(nlohmann::json::parse(read_all(folder_.file("r.json")), nullptr, false).is_discarded());
}

// Quit with a video and a recording running and the slide begun: everything is whole. The keys are those of the
// settings.
TEST_F(WindowTest, QuittingInTheMiddleLeavesWholeFiles) {
  folder_.write("parallax/settings.yaml", "keys: {initialise: I, quit: [Y, Escape], video: Shift+V}\n");
  start("synthetic:desk?size=160x120", {"--record", folder_.file("session.parallax")});
  ASSERT_TRUE(title_says("waiting")) << read_all(folder_.file("log"));
  key("shift+v");
  const auto files = [&](const std::string& extension) {
    int count = 0;
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(folder_.path() / "out", none))
      count += entry.path().extension() == extension ? 1 : 0;
    return count;
  };
  const auto end = Clock::now() + std::chrono::seconds(20);
  while (files(".mp4") == 0 && Clock::now() < end) poll(nullptr, 0, 30);
  key("space");  // is no key of this window
  key("i");
  ASSERT_TRUE(title_says("trailing"));
  const cv::Mat3b picture = screenshot();
  EXPECT_FALSE(picture.empty());
  key("y");
  const auto code = program_->wait_for(std::chrono::seconds(30));
  ASSERT_TRUE(code.has_value()) << "the key of the settings does not quit";
  EXPECT_EQ(*code, 0) << read_all(folder_.file("log"));
  int hidden = 0;
  std::string video;
  for (const auto& entry : fs::directory_iterator(folder_.path() / "out")) {
    if (entry.path().filename().string().front() == '.') ++hidden;
    if (entry.path().extension() == ".mp4") video = entry.path().string();
  }
  EXPECT_EQ(hidden, 0) << "something half-written was left";
  ASSERT_FALSE(video.empty());
  EXPECT_GT(fs::file_size(video), 2000u);
  // Nothing was mapped: played again, it says so.
  const auto replay = run_process(PARALLAX_BINARY, {"run", folder_.file("session.parallax")});
  EXPECT_EQ(replay.exit_code, 1) << replay.err;
}

TEST_F(WindowTest, NoSuchCameraEndsWithOneLine) {
  start("v4l2:/dev/nowhere");
  const auto code = program_->wait_for(std::chrono::seconds(30));
  ASSERT_TRUE(code.has_value());
  EXPECT_EQ(*code, 2);
  EXPECT_EQ(count_lines(read_all(folder_.file("log"))), 1) << read_all(folder_.file("log"));
}

}  // namespace
}  // namespace parallax::testing
