#include "app/screenshot.h"

#include <ctime>
#include <filesystem>
#include <opencv2/imgproc.hpp>

#include "camera/image_writer.h"
#include "core/error.h"

namespace parallax {

namespace fs = std::filesystem;

namespace {

cv::Size even(cv::Size size) { return {size.width & ~1, size.height & ~1}; }
// Longer than this the picture did not change; the video does not grow by more at once.
constexpr int kMostRepeats = 90;
// Some seconds of video, and its index.
constexpr std::uintmax_t kReserve_bytes = 16u << 20;

}  // namespace

std::string new_file_in(const std::string& folder, const std::string& extension) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (!fs::is_directory(folder))
    throw RunError(folder + ": cannot be made: " + (error ? error.message() : "it is not a folder"));
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  char stamp[32];
  std::strftime(stamp, sizeof stamp, "%Y%m%d-%H%M%S", &local);
  fs::path path = fs::path(folder) / ("parallax-" + std::string(stamp) + "." + extension);
  for (int i = 2; fs::exists(path, error); ++i)
    path = fs::path(folder) / ("parallax-" + std::string(stamp) + "-" + std::to_string(i) + "." + extension);
  return path.string();
}

std::string save_screenshot(const cv::Mat3b& picture, const std::string& folder) {
  const std::string path = new_file_in(folder, "png");
  write_png(path, picture);
  return path;
}

void write_game_picture(const cv::Mat4b& picture, const std::string& path) {
  cv::Mat4b blue_first;
  cv::cvtColor(picture, blue_first, cv::COLOR_RGBA2BGRA);
  write_png(path, blue_first);
}

std::string save_game_picture(const cv::Mat4b& picture, const std::string& folder) {
  const std::string path = new_file_in(folder, "picture.png");
  write_game_picture(picture, path);
  return path;
}

ScreenVideo::ScreenVideo(const std::string& path, cv::Size size, double frames_per_second)
    : path_(path), size_(even(size)), fps_(frames_per_second), writer_(path, frames_per_second, even(size)) {}

bool ScreenVideo::due(double seconds) const { return seconds * fps_ >= written_; }

void ScreenVideo::add(const cv::Mat3b& picture, double seconds) {
  cv::Mat3b fitting = picture;
  if (even(picture.size()) != size_) {
    cv::resize(picture, fitting, size_, 0, 0, cv::INTER_AREA);
  } else if (picture.size() != size_) {
    fitting = picture(cv::Rect({0, 0}, size_)).clone();
  }
  const int wanted = static_cast<int>(seconds * fps_) + 1;
  for (int i = 0; written_ < wanted && i < kMostRepeats; ++i, ++written_) writer_.write(fitting);
  written_ = std::max(written_, wanted);
}

bool ScreenVideo::has_room() const {
  std::error_code error;
  const fs::space_info space = fs::space(fs::absolute(path_, error).parent_path(), error);
  return error || space.available > kReserve_bytes;
}

void ScreenVideo::close() { writer_.close(); }

}  // namespace parallax
