// The real window, on a display of its own (Xvfb).
#include "render/window.h"

#include <gtest/gtest.h>
#include <imgui.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <opencv2/core.hpp>
#include <optional>

#include "core/error.h"
#include "render/mesh_shapes.h"
#include "render/scene_renderer.h"
#include "tests/render/offscreen_scene.h"

namespace parallax {
namespace {

// Sets an environment variable (null: takes it away) until it goes.
class Variable {
 public:
  Variable(const char* name, const char* value) : name_(name) {
    if (const char* old = std::getenv(name)) old_ = old;
    value != nullptr ? setenv(name, value, 1) : unsetenv(name);
  }
  ~Variable() { old_ ? setenv(name_, old_->c_str(), 1) : unsetenv(name_); }

 private:
  const char* name_;
  std::optional<std::string> old_;
};

// An X server without a screen; name() is empty when there is none to be had.
class VirtualDisplay {
 public:
  VirtualDisplay() {
    int number[2];
    if (!std::filesystem::exists("/usr/bin/Xvfb") || pipe(number) != 0) return;
    child_ = fork();
    if (child_ == 0) {
      dup2(number[1], 3);
      execl("/usr/bin/Xvfb", "Xvfb", "-displayfd", "3", "-screen", "0", "1024x768x24", "-nolisten", "tcp", "-noreset",
            static_cast<char*>(nullptr));
      _exit(127);
    }
    close(number[1]);
    // It writes the number and then, by itself, the end of the line: it must not find the pipe closed.
    std::string text;
    pollfd ready{number[0], POLLIN, 0};
    for (char c = 0; poll(&ready, 1, 20000) == 1 && ::read(number[0], &c, 1) == 1 && c != '\n';) text += c;
    if (!text.empty()) name_ = ":" + text;
    close(number[0]);
  }
  ~VirtualDisplay() {
    if (child_ <= 0) return;
    kill(child_, SIGTERM);
    waitpid(child_, nullptr, 0);
  }
  const std::string& name() const { return name_; }

 private:
  pid_t child_ = -1;
  std::string name_;
};

TEST(Window, SaysThatThereIsNoDisplay) {
  const Variable no_x("DISPLAY", nullptr), no_wayland("WAYLAND_DISPLAY", nullptr);
  EXPECT_FALSE(Window::available());
  try {
    Window window("Parallax", {});
    FAIL() << "a window without a display";
  } catch (const RunError& error) {
    EXPECT_NE(std::string(error.what()).find("DISPLAY"), std::string::npos);
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
  }
  const Variable wrong("DISPLAY", ":7654");
  EXPECT_TRUE(Window::available());
  EXPECT_THROW(Window("Parallax", {}), RunError);
}

TEST(Window, ShowsWhatIsDrawnOffScreen) {
  const VirtualDisplay display;
  if (display.name().empty()) GTEST_SKIP() << "Xvfb is not here, or does not start";
  const Variable x("DISPLAY", display.name().c_str()), no_wayland("WAYLAND_DISPLAY", nullptr);

  const CameraModel camera(CameraModelKind::fov, 320, 240, {180, 181}, {158, 121}, {0.9}, 1);
  DrawList list = testing::empty_list(camera);
  list.background = cv::Mat3b(240, 320, cv::Vec3b(40, 90, 160));
  MeshInstance ball;
  ball.mesh = sphere_mesh(0.1f);
  ball.world_from_model.translation() = Eigen::Vector3f(0.1f, 0, 1);
  ball.tint = {0.9f, 0.3f, 0.2f, 1};
  list.meshes.push_back(ball);
  list.world_lines.push_back({{-1, -0.2f, 1}, {1, 0.3f, 1}, {1, 1, 0, 1}, 2});

  Window window("Parallax", {10, 20, 640, 480, false});
  EXPECT_EQ(window.framebuffer_width(), 640);
  EXPECT_EQ(window.framebuffer_height(), 480);
  EXPECT_GT(window.content_scale(), 0.5f);
  EXPECT_FALSE(window.closing());
  cv::Mat3b in_window, with_panel;
  {
    SceneRenderer renderer;
    const Viewport viewport = fit_viewport(320, 240, window.framebuffer_width(), window.framebuffer_height());
    window.poll();
    renderer.draw(list, viewport);
    in_window = read_framebuffer(640, 480);
    window.begin_interface();
    ImGui::SetNextWindowPos({50, 60});
    ImGui::SetNextWindowSize({200, 100});
    ImGui::Begin("panel");
    ImGui::TextUnformatted("keyframes: 12");
    ImGui::Image(renderer.picture(1, cv::Mat1b(20, 20, 200)), {40, 40});
    ImGui::End();
    window.end_interface();
    renderer.draw_interface(*ImGui::GetDrawData(), 640, 480);
    with_panel = read_framebuffer(640, 480);
    window.swap();
  }
  // The same code off-screen, beside the window, gives the same picture (another driver may round otherwise).
  cv::Mat3b off_screen;
  {
    testing::OffscreenScene scene(640, 480);
    off_screen = scene.draw(list);
  }
  EXPECT_LT(cv::norm(in_window, off_screen, cv::NORM_L1) / (3 * in_window.total()), 0.2);
  cv::Mat1b changed;
  cv::Mat3b difference;
  cv::absdiff(in_window, with_panel, difference);
  const cv::Rect panel(50, 60, 200, 100);
  EXPECT_GT(cv::norm(difference(panel), cv::NORM_L1) / (3 * panel.area()), 20) << "the panel is there";
  difference(panel).setTo(cv::Scalar::all(0));
  EXPECT_EQ(cv::norm(difference, cv::NORM_INF), 0) << "and nowhere else";

  window.set_full_screen(true);
  window.poll();
  EXPECT_TRUE(window.geometry().full_screen);
  EXPECT_EQ(window.geometry().width, 640) << "what it goes back to";
  window.set_full_screen(false);
  EXPECT_FALSE(window.geometry().full_screen);
  window.close();
  EXPECT_TRUE(window.closing());
}

}  // namespace
}  // namespace parallax
