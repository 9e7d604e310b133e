#include "camera/video_writer.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <opencv2/videoio.hpp>
#include <system_error>

#include "camera/image_file.h"
#include "core/check.h"
#include "core/error.h"

namespace parallax {
namespace fs = std::filesystem;

namespace {

std::string lower_extension(const std::string& path) {
  std::string extension = fs::path(path).extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

// Beside the target, with its extension (the container is chosen by it).
std::string name_beside(const fs::path& target, const std::string& extension) {
  static std::atomic<unsigned> counter{0};
  const std::string leaf = "." + target.stem().string().substr(0, 200) + "." + std::to_string(::getpid()) + "." +
                           std::to_string(counter.fetch_add(1)) + ".partial" + extension;
  return (target.parent_path() / leaf).string();
}

}  // namespace

class VideoWriter::Impl {
 public:
  Impl(const std::string& path, double frames_per_second, cv::Size size) : path_(path), size_(size) {
    const std::string extension = lower_extension(path);
    if (extension != ".mp4" && extension != ".avi") {
      throw InputError(path + ": found the ending '" + extension + "', expected .mp4 or .avi");
    }
    if (!(frames_per_second > 0 && std::isfinite(frames_per_second))) {
      throw InputError(path + ": found " + std::to_string(frames_per_second) +
                       " frames a second, expected more than 0");
    }
    if (size.width < 1 || size.height < 1) {
      throw InputError(path + ": found video size " + to_string(ImageSize{size.width, size.height}) +
                       ", expected at least 1x1");
    }
    silence_image_libraries();
    struct stat status {};
    fs::path target = path;
    if (::stat(path.c_str(), &status) == 0) {
      if (!S_ISREG(status.st_mode)) throw failure("it is not a regular file");
      if (::access(path.c_str(), W_OK) != 0) throw failure(std::generic_category().message(errno));
      std::error_code error;
      const fs::path real = fs::canonical(path, error);
      if (!error) target = real;
    }
    target_ = target.string();
    beside_ = name_beside(target, extension);
    // Made here first: FFmpeg does not say why it cannot.
    const int fd = ::open(beside_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd < 0) throw failure(std::generic_category().message(errno));
    ::close(fd);
    const int code =
        extension == ".mp4" ? cv::VideoWriter::fourcc('m', 'p', '4', 'v') : cv::VideoWriter::fourcc('M', 'J', 'P', 'G');
    bool opened = false;
    try {
      opened = writer_.open(beside_, cv::CAP_FFMPEG, code, rounded_rate(frames_per_second), size, true);
    } catch (const cv::Exception&) {
    }
    if (!opened) {
      discard();
      throw failure("no encoder for it here, or the disk is full");
    }
  }

  ~Impl() {
    if (!closed_) discard();
  }

  void write(const cv::Mat3b& bgr) {
    PARALLAX_CHECK(!closed_, "a frame after close()");
    PARALLAX_CHECK(bgr.size() == size_, "a frame of another size");
    bool ok = true;
    try {
      writer_.write(bgr);
    } catch (const cv::Exception&) {
      ok = false;
    }
    if (!ok) {
      closed_ = true;
      discard();
      throw failure("the encoder refused frame " + std::to_string(frames_));
    }
    ++frames_;
  }

  int frames() const { return frames_; }

  void close() {
    if (closed_) return;
    closed_ = true;
    writer_.release();
    if (frames_ == 0) {
      discard();
      throw failure("no frame was given");
    }
    const std::string problem = read_back();
    if (!problem.empty()) {
      discard();
      throw failure(problem);
    }
    if (std::rename(beside_.c_str(), target_.c_str()) != 0) {
      const std::string reason = std::generic_category().message(errno);
      discard();
      throw failure(reason);
    }
  }

 private:
  // MPEG-4 wants a rate that is a ratio of numbers below 65536.
  static double rounded_rate(double rate) { return std::round(rate * 1000) / 1000; }

  RunError failure(const std::string& reason) const { return RunError(path_ + ": cannot be written: " + reason); }

  void discard() {
    writer_.release();
    ::unlink(beside_.c_str());
  }

  // FFmpeg's muxers keep a failed write to themselves, so the file is opened again and its header must know every
  // frame and its first one must be there.
  std::string read_back() const {
    std::error_code error;
    const auto bytes = fs::file_size(beside_, error);
    if (error || bytes == 0) return "the file came out empty (is the disk full?)";
    cv::VideoCapture capture;
    try {
      if (!capture.open(beside_, cv::CAP_FFMPEG)) return "the file is not whole (is the disk full?)";
      const auto stated = static_cast<int>(capture.get(cv::CAP_PROP_FRAME_COUNT));
      if (stated < frames_) {
        return "only " + std::to_string(stated) + " of " + std::to_string(frames_) +
               " frames are in the file (is the disk full?)";
      }
      if (!capture.grab()) return "its first frame cannot be read (is the disk full?)";
    } catch (const cv::Exception&) {
      return "the file cannot be read back";
    }
    return "";
  }

  std::string path_, target_, beside_;
  cv::Size size_;
  cv::VideoWriter writer_;
  int frames_ = 0;
  bool closed_ = false;
};

VideoWriter::VideoWriter(const std::string& path, double frames_per_second, cv::Size size)
    : impl_(std::make_unique<Impl>(path, frames_per_second, size)) {}
VideoWriter::~VideoWriter() = default;
VideoWriter::VideoWriter(VideoWriter&&) noexcept = default;
VideoWriter& VideoWriter::operator=(VideoWriter&&) noexcept = default;
void VideoWriter::write(const cv::Mat3b& bgr) { impl_->write(bgr); }
int VideoWriter::frames_written() const { return impl_->frames(); }
void VideoWriter::close() { impl_->close(); }

}  // namespace parallax
