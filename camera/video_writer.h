// Writes a video file: .mp4 (MPEG-4 part 2) or .avi (Motion JPEG). One thread at a time.
//
// The frames go to a file beside the target, which takes the target's name in close() once it has been read back and
// found whole. Without close() (an exception on the way) nothing is left behind and an earlier file stays.
#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>

namespace parallax {

class VideoWriter {
 public:
  // Throws InputError for another extension, a rate that is not positive or an empty size; RunError when the
  // file cannot be made.
  VideoWriter(const std::string& path, double frames_per_second, cv::Size size);
  ~VideoWriter();
  VideoWriter(VideoWriter&&) noexcept;
  VideoWriter& operator=(VideoWriter&&) noexcept;

  // A frame of exactly the size given. CHECKs size and that close() has not been called.
  void write(const cv::Mat3b& bgr);
  int frames_written() const;

  // Finishes the file. Throws RunError ("PATH: cannot be written: reason") on a full disk, or when what was written
  // cannot be read back; nothing is left behind then. A second call does nothing.
  void close();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace parallax
