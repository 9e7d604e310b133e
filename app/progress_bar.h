// A line on a terminal that says how far the work is, erased at the end. Nothing is printed where stderr is no
// terminal.
#pragma once

#include <chrono>
#include <string>

namespace parallax {

// One thread. Draws on stderr at most ten times a second.
class ProgressBar {
 public:
  // `total` below 1: unknown, only the count is shown. `label` stands before the bar. `fd` is what it draws on.
  ProgressBar(std::string label, int total, int fd = 2);
  ~ProgressBar();
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  // `done` of the total; `note` stands behind the bar, such as the state of the tracker.
  void update(int done, const std::string& note = "");

  // Erases the line, so that messages can be printed; the next update draws it again.
  void clear();

 private:
  void draw(int done, const std::string& note);

  std::string label_;
  int total_ = 0;
  int fd_ = 2;
  bool on_terminal_ = false;
  bool is_drawn_ = false;
  std::chrono::steady_clock::time_point last_{};
};

// The text of the bar, `columns` wide at most: "tracking [#####     ]  52 %  208/400  good".
std::string progress_text(const std::string& label, int done, int total, const std::string& note, int columns);

}  // namespace parallax
