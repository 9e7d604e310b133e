// Screenshots and videos of the window: where they go and under which name.
#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>

#include "camera/video_writer.h"

namespace parallax {

// FOLDER/parallax-YYYYMMDD-HHMMSS.EXTENSION, with -2, -3... where that is taken. Makes the folder; throws RunError when
// it cannot.
std::string new_file_in(const std::string& folder, const std::string& extension);

// Writes a PNG, whole or not at all; returns its path. Throws RunError.
std::string save_screenshot(const cv::Mat3b& picture, const std::string& folder);

// The same of what a game leaves (Game::picture()): FOLDER/parallax-STAMP.picture.png, with its transparency.
std::string save_game_picture(const cv::Mat4b& picture, const std::string& folder);
// To this file.
void write_game_picture(const cv::Mat4b& picture, const std::string& path);

// A video of what is on the screen, at an even rate whatever the rate of drawing: pictures are repeated or left out.
// One thread.
class ScreenVideo {
 public:
  // The size is that of the pictures, rounded down to even numbers. Throws RunError.
  ScreenVideo(const std::string& path, cv::Size size, double frames_per_second = 30);

  // Whether the next picture is due at this moment (seconds since the first): nobody needs to read it back otherwise.
  bool due(double seconds) const;
  // A picture of another size (the window was resized) is scaled. Throws RunError on a full disk.
  void add(const cv::Mat3b& picture, double seconds);
  // Whether the disk has room for more of it, and for its end: a video on a full disk would be lost.
  bool has_room() const;
  // Finishes the file, which has its name only then. Throws RunError.
  void close();
  const std::string& path() const { return path_; }

 private:
  std::string path_;
  cv::Size size_;
  double fps_;
  int written_ = 0;
  VideoWriter writer_;
};

}  // namespace parallax
