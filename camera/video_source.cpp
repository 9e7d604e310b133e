#include "camera/video_source.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <utility>

#include "camera/image_file.h"
#include "core/error.h"

namespace parallax {
namespace {

constexpr double kMaxSaneRate = 1000;  // frames a second; beyond, the container's rate is a time base, not a rate
constexpr double kMaxSaneStep_s = 60;  // between two frames

class VideoSource : public FrameSource {
 public:
  VideoSource(const std::string& path, const SourceOptions& options) : path_(path), options_(options) {
    silence_image_libraries();
    try {
      capture_.open(path, cv::CAP_FFMPEG);
    } catch (const cv::Exception&) {
      capture_.release();
    }
    if (!capture_.isOpened()) {
      throw InputError(path +
                       ": cannot be opened as a video: found no video stream (empty, cut short or another kind "
                       "of file), expected MP4, AVI, MKV or WebM");
    }
    const double rate = capture_.get(cv::CAP_PROP_FPS);
    rate_ = std::isfinite(rate) && rate > 0 && rate <= kMaxSaneRate ? rate : options.fallback_fps;
    const double count = capture_.get(cv::CAP_PROP_FRAME_COUNT);
    stated_count_ = std::isfinite(count) && count >= 1 && count < 1e9 ? static_cast<int>(count) : -1;
    const ImageSize size{static_cast<int>(capture_.get(cv::CAP_PROP_FRAME_WIDTH)),
                         static_cast<int>(capture_.get(cv::CAP_PROP_FRAME_HEIGHT))};
    if (size.width > 0 && size.height > 0) {
      if (const std::string problem = image_size_problem(size); !problem.empty())
        throw InputError(path + ": " + problem);
    }
    // One frame is read now, so that a video without any is refused at once.
    first_ = read();
    if (!first_) throw InputError(path + ": found a video without a readable frame, expected at least one");
    if (const std::string problem = image_size_problem(size_); !problem.empty())
      throw InputError(path + ": " + problem);
  }

  std::optional<Frame> next() override {
    while (options_.max_frames < 0 || delivered_ < options_.max_frames) {
      std::optional<Frame> frame = first_ ? std::exchange(first_, std::nullopt) : read();
      if (!frame) {
        report_end();
        return std::nullopt;
      }
      if (frame->index < options_.start_frame || frame->grey.empty()) continue;
      ++delivered_;
      return frame;
    }
    return std::nullopt;
  }

  std::vector<SourceWarning> take_warnings() override { return std::exchange(warnings_, {}); }
  int frame_count() const override {
    if (stated_count_ < 0) return -1;
    const int left = std::max(stated_count_ - std::max(options_.start_frame, 0), 0);
    return options_.max_frames < 0 ? left : std::min(left, options_.max_frames);
  }
  double frames_per_second() const override { return rate_; }
  std::string description() const override { return "video " + path_; }

 private:
  // The next frame of the file; one to be skipped comes without an image, the end as nothing.
  std::optional<Frame> read() {
    if (ended_) return std::nullopt;
    cv::Mat image;
    bool got = false;
    Frame frame;
    try {
      got = capture_.grab();
      if (got) {
        frame.index = index_++;
        frame.time = time_of(frame.index);
        if (frame.index < options_.start_frame && size_.width > 0) return frame;
        got = capture_.retrieve(image) && !image.empty();
        if (!got) {
          warnings_.push_back(
              {frame.index, path_ + ": frame " + std::to_string(frame.index) + ": skipped: it cannot be decoded"});
          return frame;
        }
      }
    } catch (const cv::Exception&) {
      got = false;
    }
    if (!got) {
      ended_ = true;
      return std::nullopt;
    }
    const ImageSize size{image.cols, image.rows};
    if (size_.width == 0) size_ = size;
    if (!(size == size_)) {
      warnings_.push_back({frame.index, path_ + ": frame " + std::to_string(frame.index) + ": skipped: found size " +
                                            to_string(size) + ", expected " + to_string(size_) +
                                            " as the first frame has"});
      return frame;
    }
    set_images(image, &frame);
    return frame;
  }

  void set_images(const cv::Mat& image, Frame* frame) const {
    cv::Mat grey;
    if (image.channels() == 3) {
      cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
      // The capture may write into its own buffer again.
      if (options_.colour) frame->colour = image.clone();
    } else {
      grey = image.clone();
    }
    frame->grey = grey;
  }

  Timestamp time_of(int index) {
    const double stated_s = capture_.get(cv::CAP_PROP_POS_MSEC) * 1e-3;
    const bool first = index == 0;
    const double step = stated_s - last_stated_s_;
    const bool sane = std::isfinite(stated_s) && stated_s >= 0 && (first || (step > 0 && step < kMaxSaneStep_s));
    // Once the file's times have proved wrong they are not used again: a mixture would jump.
    if (!sane && use_stated_ && !first) {
      use_stated_ = false;
      // A file that states none says 0 for every frame; that is not worth a warning.
      if (index > 1) {
        warnings_.push_back({index, path_ + ": frame " + std::to_string(index) + ": found a time stamp of " +
                                        std::to_string(stated_s) + " s after " + std::to_string(last_stated_s_) +
                                        " s, expected a later one; the frame rate is used from here on"});
      }
    }
    if (first) {
      last_s_ = sane && stated_s < 1e9 ? stated_s : 0;
    } else {
      last_s_ = use_stated_ ? last_s_ + step : last_s_ + 1.0 / rate_;
    }
    last_stated_s_ = std::isfinite(stated_s) ? stated_s : 0;
    return from_seconds(last_s_);
  }

  void report_end() {
    if (reported_) return;
    reported_ = true;
    if (stated_count_ > 0 && index_ < stated_count_) {
      warnings_.push_back({-1, path_ + ": found " + std::to_string(index_) + " frames, expected " +
                                   std::to_string(stated_count_) + " as its header says; it may be cut short"});
    }
    if (delivered_ == 0) {
      warnings_.push_back({-1, path_ + ": found " + std::to_string(index_) +
                                   " frames, expected more than the start frame " +
                                   std::to_string(options_.start_frame)});
    }
  }

  std::string path_;
  SourceOptions options_;
  cv::VideoCapture capture_;
  double rate_ = 0;
  int stated_count_ = -1;
  ImageSize size_;
  std::optional<Frame> first_;
  std::vector<SourceWarning> warnings_;
  int index_ = 0, delivered_ = 0;
  double last_s_ = 0, last_stated_s_ = 0;
  bool use_stated_ = true, ended_ = false, reported_ = false;
};

}  // namespace

std::unique_ptr<FrameSource> open_video_source(const std::string& path, const SourceOptions& options) {
  return std::make_unique<VideoSource>(path, options);
}

}  // namespace parallax
