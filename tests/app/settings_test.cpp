// The settings file, the state that is remembered, and the folders.
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "app/user_settings.h"
#include "core/error.h"
#include "tests/support/process.h"

namespace parallax::testing {
namespace {

// Sets environment variables for the length of a test.
class Environment {
 public:
  void set(const char* name, const std::string& value) {
    const char* old = std::getenv(name);
    saved_.emplace_back(name, old == nullptr ? std::nullopt : std::optional<std::string>(old));
    setenv(name, value.c_str(), 1);
  }
  ~Environment() {
    for (auto it = saved_.rbegin(); it != saved_.rend(); ++it) {
      if (it->second) {
        setenv(it->first.c_str(), it->second->c_str(), 1);
      } else {
        unsetenv(it->first.c_str());
      }
    }
  }

 private:
  std::vector<std::pair<std::string, std::optional<std::string>>> saved_;
};

std::string refusal(const std::string& text) {
  try {
    parse_user_settings(text, "settings.yaml");
  } catch (const InputError& e) {
    EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
    return e.what();
  }
  ADD_FAILURE() << "accepted: " << text;
  return "";
}

TEST(UserSettingsTest, EverythingIsRead) {
  const UserSettings settings = parse_user_settings(
      "keys:\n  initialise: [Space, I]\n  map_view: Ctrl+M\n  reset: []\ncamera: v4l2:/dev/video2\nsize: 1280x720\n"
      "pictures: /p\nvideos: /v\ninterface_scale: 1.5\ntracking_profile: false\n",
      "settings.yaml");
  EXPECT_EQ(settings.keys.action_of(GLFW_KEY_I, 0), Action::initialise);
  EXPECT_FALSE(settings.keys.action_of(GLFW_KEY_ENTER, 0).has_value());
  EXPECT_EQ(settings.keys.action_of(GLFW_KEY_M, GLFW_MOD_CONTROL), Action::map_view);
  EXPECT_FALSE(settings.keys.action_of(GLFW_KEY_R, 0).has_value());
  EXPECT_EQ(settings.camera, "v4l2:/dev/video2");
  EXPECT_EQ(settings.width, 1280);
  EXPECT_EQ(settings.height, 720);
  EXPECT_EQ(settings.pictures, "/p");
  EXPECT_EQ(settings.videos, "/v");
  EXPECT_EQ(settings.interface_scale, 1.5);
  EXPECT_FALSE(settings.tracking_profile);
}

TEST(UserSettingsTest, NothingIsTheDefaults) {
  EXPECT_EQ(parse_user_settings("", "s").keys, KeyBindings());
  EXPECT_EQ(read_user_settings("/nonexistent/settings.yaml").camera, "");
  // What a later version may know is left alone.
  EXPECT_NO_THROW(parse_user_settings("physics: {gravity: 9.81}\n", "s"));
}

TEST(UserSettingsTest, BadValuesNameFileKeyAndWhatWasExpected) {
  const std::string bad_key = refusal("keys: {initialise: Spcae}\n");
  EXPECT_NE(bad_key.find("settings.yaml: key keys.initialise: found 'Spcae', expected a key"), std::string::npos)
      << bad_key;
  EXPECT_NE(refusal("keys: {fly: F}\n").find("expected one of initialise"), std::string::npos);
  const std::string twice = refusal("keys: {label: F, model: [F, O]}\n");
  EXPECT_EQ(twice, "settings.yaml: key F: found at label and at model, expected at one of them");
  EXPECT_NE(refusal("keys: 3\n").find("key keys"), std::string::npos);
  EXPECT_NE(refusal("size: big\n").find("WIDTHxHEIGHT"), std::string::npos);
  EXPECT_NE(refusal("size: 640x\n").find("WIDTHxHEIGHT"), std::string::npos);
  EXPECT_NE(refusal("interface_scale: 40\n").find("0.5 to 4"), std::string::npos);
  EXPECT_NE(refusal("tracking_profile: maybe\n").find("true or false"), std::string::npos);
  EXPECT_NE(refusal("camera: [a]\n").find("found a list"), std::string::npos);
  EXPECT_NE(refusal("- 1\n").find("a list"), std::string::npos);
  EXPECT_NE(refusal("keys: {\n").find("line"), std::string::npos);
}

// A file of before there were games.
TEST(UserSettingsTest, AKeyInTheFileWinsOverADefault) {
  const UserSettings settings =
      parse_user_settings("keys: {label: B, model: E, plane: X, measure: Z, quit: G}\n", "settings.yaml");
  EXPECT_EQ(settings.keys.action_of(GLFW_KEY_B, 0), Action::label);
  EXPECT_EQ(settings.keys.action_of(GLFW_KEY_G, 0), Action::quit);
  EXPECT_EQ(settings.keys.chord_names(Action::game_pause), "Pause");
  EXPECT_EQ(settings.keys.chord_names(Action::next_game), "Shift+G");
  ASSERT_EQ(settings.key_remarks.size(), 5u);
  EXPECT_EQ(settings.key_remarks[0], "G is yours for quit: next_game has Shift+G now");
  EXPECT_TRUE(parse_user_settings("keys: {label: F}\n", "s").key_remarks.empty());
}

TEST(ProgramStateTest, RoundTripKeepsUnknownKeys) {
  const ScratchFolder folder;
  const std::string path = folder.write("state.yaml", "future: {games: [a, b]}\nwindow: {monitor: 2}\n");
  ProgramState state;
  state.window_x = 10;
  state.window_y = 20;
  state.window_width = 800;
  state.window_height = 600;
  state.full_screen = true;
  state.camera = "v4l2:/dev/video0";
  state.key_remarks = "B is yours for label: game_pause has Pause now";
  write_program_state(state, path);
  const ProgramState back = read_program_state(path);
  EXPECT_EQ(back.window_x, 10);
  EXPECT_EQ(back.window_y, 20);
  EXPECT_EQ(back.window_width, 800);
  EXPECT_EQ(back.window_height, 600);
  EXPECT_TRUE(back.full_screen);
  EXPECT_EQ(back.camera, state.camera);
  EXPECT_EQ(back.key_remarks, state.key_remarks);
  const std::string text = read_all(path);
  EXPECT_NE(text.find("games"), std::string::npos) << text;
  EXPECT_NE(text.find("monitor"), std::string::npos) << text;
}

TEST(ProgramStateTest, WhatCannotBeUsedIsForgotten) {
  const ScratchFolder folder;
  EXPECT_EQ(read_program_state(folder.file("none")).window_width, 0);
  EXPECT_EQ(read_program_state(folder.write("a", "window: [")).window_width, 0);
  EXPECT_EQ(read_program_state(folder.write("b", "window: {width: 3, height: 900000}\n")).window_width, 0);
  EXPECT_EQ(read_program_state(folder.write("c", "- 1\n")).camera, "");
}

TEST(Calibrations, AreRememberedByCameraAndSize) {
  const ScratchFolder folder;
  Environment environment;
  environment.set("XDG_DATA_HOME", folder.path().string());
  const std::string identity = "uvcvideo/Some Camera: 3/usb-0000:00:14.0-1";
  EXPECT_FALSE(remembered_calibration(identity, 640, 480).has_value());
  const CameraModel lens(CameraModelKind::fov, 640, 480, {500, 501}, {320, 240}, {0.9}, 1);
  remember_calibration(lens, identity);
  const auto back = remembered_calibration(identity, 640, 480);
  ASSERT_TRUE(back.has_value());
  EXPECT_NEAR(back->focal_px().y(), 501, 1e-6);
  EXPECT_FALSE(remembered_calibration(identity, 320, 240).has_value());
  EXPECT_FALSE(remembered_calibration("another", 640, 480).has_value());
}

TEST(Folders, FollowTheDesktop) {
  const ScratchFolder folder;
  Environment environment;
  environment.set("HOME", folder.path().string());
  environment.set("XDG_CONFIG_HOME", folder.path().string());
  environment.set("XDG_PICTURES_DIR", "");
  environment.set("XDG_VIDEOS_DIR", folder.file("films"));
  environment.set("PARALLAX_SETTINGS", "");
  EXPECT_EQ(settings_path(), folder.file("parallax/settings.yaml"));
  EXPECT_EQ(pictures_folder(), folder.file("Pictures"));
  EXPECT_EQ(videos_folder(), folder.file("films"));
  folder.write("user-dirs.dirs", "# comment\nXDG_PICTURES_DIR=\"$HOME/Bilder\"\n");
  EXPECT_EQ(pictures_folder(), folder.file("Bilder"));
}

TEST(EstimatedLens, SeesSeventyFiveDegrees) {
  for (const auto& [width, height] : {std::pair{640, 480}, {1280, 720}}) {
    const CameraModel lens = estimated_lens(width, height);
    Eigen::Vector3d ray;
    ASSERT_TRUE(lens.unproject({0.5 * (width - 1) + 0.5 * width, 0.5 * (height - 1)}, &ray));
    EXPECT_NEAR(std::atan2(ray.x(), ray.z()) * 180 / 3.14159265358979, 37.5, 1e-6);
  }
}

}  // namespace
}  // namespace parallax::testing
