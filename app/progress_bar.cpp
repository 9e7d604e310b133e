#include "app/progress_bar.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <utility>

namespace parallax {
namespace {

constexpr auto kShortestInterval = std::chrono::milliseconds(100);

int terminal_columns(int fd) {
  winsize size{};
  return ioctl(fd, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

// A terminal that went away is no reason to stop the work.
void write_all(int fd, const std::string& text) {
  size_t written = 0;
  while (written < text.size()) {
    const ssize_t n = write(fd, text.data() + written, text.size() - written);
    if (n <= 0) return;
    written += static_cast<size_t>(n);
  }
}

}  // namespace

std::string progress_text(const std::string& label, int done, int total, const std::string& note, int columns) {
  std::string text = label + " ";
  if (total > 0) {
    constexpr int kBarWidth = 30;
    done = std::clamp(done, 0, total);
    const auto filled = static_cast<size_t>(std::int64_t{kBarWidth} * done / total);
    const int percent = static_cast<int>(std::int64_t{100} * done / total);
    text += fmt::format("[{}{}] {:3d} %  {}/{}", std::string(filled, '#'), std::string(kBarWidth - filled, ' '),
                        percent, done, total);
  } else {
    text += std::to_string(done);
  }
  if (!note.empty()) text += "  " + note;
  return text.substr(0, static_cast<size_t>(std::max(0, columns)));
}

ProgressBar::ProgressBar(std::string label, int total, int fd)
    : label_(std::move(label)), total_(total), fd_(fd), on_terminal_(isatty(fd) == 1) {}

ProgressBar::~ProgressBar() { clear(); }

void ProgressBar::update(int done, const std::string& note) {
  if (!on_terminal_) return;
  const auto now = std::chrono::steady_clock::now();
  if (is_drawn_ && now - last_ < kShortestInterval) return;
  last_ = now;
  draw(done, note);
}

void ProgressBar::draw(int done, const std::string& note) {
  // One column is left free: a full line would wrap. "\033[K" erases what the last text left behind.
  write_all(fd_, "\r" + progress_text(label_, done, total_, note, terminal_columns(fd_) - 1) + "\033[K");
  is_drawn_ = true;
}

void ProgressBar::clear() {
  if (!is_drawn_) return;
  write_all(fd_, "\r\033[K");
  is_drawn_ = false;
}

}  // namespace parallax
