// The real window on a virtual screen: started, driven with xdotool, looked at through its own screenshots.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tests/support/process.h"

namespace parallax::testing {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

inline bool is_installed(const std::string& program) {
  return run_process("/bin/sh", {"-c", "command -v " + program}).exit_code == 0;
}

// A child that is ended with the test.
class Child {
 public:
  Child(const std::vector<std::string>& words, const std::vector<std::string>& environment, int inherited = -1,
        const std::string& output = "/dev/null") {
    std::vector<std::string> copy = words;
    std::vector<char*> argv;
    for (auto& word : copy) argv.push_back(word.data());
    argv.push_back(nullptr);
    pid_ = fork();
    if (pid_ != 0) return;
    for (const auto& entry : environment) putenv(const_cast<char*>(entry.c_str()));
    const int out = open(output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
    dup2(out, 1);
    dup2(out, 2);
    if (inherited >= 0) fcntl(inherited, F_SETFD, 0);
    execvp(argv[0], argv.data());
    _exit(127);
  }
  ~Child() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  // The exit code; nothing when it has not ended in time.
  std::optional<int> wait_for(std::chrono::seconds patience) {
    const auto end = Clock::now() + patience;
    while (Clock::now() < end) {
      int status = 0;
      if (waitpid(pid_, &status, WNOHANG) == pid_) {
        pid_ = -1;
        return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
      }
      poll(nullptr, 0, 20);
    }
    return std::nullopt;
  }

 private:
  pid_t pid_ = -1;
};

class WindowFixture : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const char* program : {"Xvfb", "xdotool"})
      if (!is_installed(program)) GTEST_SKIP() << program << " is not installed";
    int number[2];
    ASSERT_EQ(pipe2(number, O_CLOEXEC), 0);
    // Without -noreset the server starts over when its last client leaves, and turns away whoever connects meanwhile:
    // an xdotool that ends while the program is about to connect.
    screen_.emplace(std::vector<std::string>{"Xvfb", "-displayfd", std::to_string(number[1]), "-screen", "0",
                                             "800x600x24", "-nolisten", "tcp", "-noreset"},
                    std::vector<std::string>{}, number[1]);
    close(number[1]);
    // The number comes before its newline: with the pipe closed in between the server would end.
    std::string text;
    pollfd ready{number[0], POLLIN, 0};
    for (char c = 0; c != '\n' && poll(&ready, 1, 30'000) == 1 && read(number[0], &c, 1) == 1;) text += c;
    if (text.size() > 1 && text.back() == '\n') display_ = ":" + text.substr(0, text.size() - 1);
    close(number[0]);
    ASSERT_FALSE(display_.empty()) << "Xvfb did not start";
    fs::create_directories(folder_.path() / "parallax");
    folder_.write("parallax/state.yaml",
                  "window: {x: 0, y: 0, width: 640, height: 480, full_screen: false}\nfuture: kept\n");
  }

  std::vector<std::string> environment() const {
    return {"DISPLAY=" + display_,
            "WAYLAND_DISPLAY=",
            "PARALLAX_SETTINGS=",
            "LIBGL_ALWAYS_SOFTWARE=1",
            "XDG_CONFIG_HOME=" + folder_.path().string(),
            "XDG_DATA_HOME=" + folder_.path().string()};
  }
  void start(const std::string& camera, std::vector<std::string> more = {}) {
    std::vector<std::string> words{
        PARALLAX_BINARY,       "live", "--camera", camera, "--output", folder_.file("out"), "--report",
        folder_.file("r.json")};
    words.insert(words.end(), more.begin(), more.end());
    program_.emplace(words, environment(), -1, folder_.file("log"));
  }
  std::string xdotool(std::vector<std::string> words) const {
    return run_process("/usr/bin/env",
                       [&] {
                         words.insert(words.begin(), "xdotool");
                         return words;
                       }(),
                       {"DISPLAY=" + display_})
        .out;
  }
  void key(const std::string& name) const { xdotool({"key", name}); }
  // Waits until the window's title holds the text.
  bool title_says(const std::string& text, int seconds = 40) const {
    const auto end = Clock::now() + std::chrono::seconds(seconds);
    while (Clock::now() < end) {
      if (xdotool({"search", "--name", "Parallax", "getwindowname"}).find(text) != std::string::npos) return true;
      poll(nullptr, 0, 30);
    }
    return false;
  }
  int pictures() const {
    int count = 0;
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(folder_.path() / "out", none))
      count += entry.path().extension() == ".png" ? 1 : 0;
    return count;
  }
  // Presses F12 and reads what it left.
  cv::Mat3b screenshot() const {
    std::vector<fs::path> before, now;
    const auto list = [&](std::vector<fs::path>* out) {
      std::error_code none;
      for (const auto& entry : fs::directory_iterator(folder_.path() / "out", none))
        if (entry.path().extension() == ".png") out->push_back(entry.path());
    };
    list(&before);
    key("F12");
    const auto end = Clock::now() + std::chrono::seconds(20);
    while (Clock::now() < end) {
      now.clear();
      list(&now);
      for (const auto& path : now)
        if (std::find(before.begin(), before.end(), path) == before.end()) return cv::imread(path.string());
      poll(nullptr, 0, 30);
    }
    return {};
  }
  // Space, a slide to the right, Space; again when that was not enough.
  bool initialise() const {
    for (int attempt = 0; attempt < 3; ++attempt) {
      key("space");
      if (!title_says("trailing", 15)) continue;
      xdotool({"keydown", attempt % 2 == 0 ? "Right" : "Left"});
      poll(nullptr, 0, 1300);
      xdotool({"keyup", attempt % 2 == 0 ? "Right" : "Left"});
      poll(nullptr, 0, 500);
      key("space");
      if (title_says("tracking", 15)) return true;
    }
    return false;
  }

  ScratchFolder folder_;
  std::string display_;
  std::optional<Child> screen_, program_;
};

}  // namespace parallax::testing
