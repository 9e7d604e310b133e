// Frames decoded ahead of the consumer in a thread of their own.
#include <exception>
#include <thread>
#include <utility>

#include "camera/frame_source.h"
#include "core/bounded_queue.h"
#include "core/check.h"

namespace parallax {
namespace {

class ReadAhead : public FrameSource {
 public:
  ReadAhead(std::unique_ptr<FrameSource> source, int depth)
      : source_(std::move(source)),
        queue_(static_cast<std::size_t>(depth)),
        frame_count_(source_->frame_count()),
        frames_per_second_(source_->frames_per_second()),
        description_(source_->description()),
        calibration_(source_->calibration()),
        ground_truth_(source_->ground_truth()),
        warnings_(source_->take_warnings()),
        thread_([this](std::stop_token stop) { run(stop); }) {}

  std::optional<Frame> next() override {
    if (ended_) return std::nullopt;
    std::optional<Step> step = queue_.pop();
    PARALLAX_CHECK(step.has_value(), "the reading thread ended without saying so");
    warnings_.insert(warnings_.end(), std::make_move_iterator(step->warnings.begin()),
                     std::make_move_iterator(step->warnings.end()));
    ended_ = !step->frame;
    if (step->failure) std::rethrow_exception(step->failure);
    return std::move(step->frame);
  }

  std::vector<SourceWarning> take_warnings() override { return std::exchange(warnings_, {}); }
  int frame_count() const override { return frame_count_; }
  double frames_per_second() const override { return frames_per_second_; }
  std::string description() const override { return description_; }
  std::optional<CameraModel> calibration() const override { return calibration_; }
  std::vector<StampedPose> ground_truth() const override { return ground_truth_; }

 private:
  // What one call of the source's next() gave; the last one has no frame.
  struct Step {
    std::optional<Frame> frame;
    std::vector<SourceWarning> warnings;
    std::exception_ptr failure;
  };

  void run(std::stop_token stop) {
    bool more = true;
    while (more && !stop.stop_requested()) {
      Step step;
      try {
        step.frame = source_->next();
        step.warnings = source_->take_warnings();
      } catch (...) {
        step.frame.reset();
        step.failure = std::current_exception();
      }
      more = step.frame.has_value();
      queue_.push(std::move(step), stop);
    }
  }

  const std::unique_ptr<FrameSource> source_;  // touched by the thread alone once it runs
  BoundedQueue<Step> queue_;
  // The consumer's.
  const int frame_count_;
  const double frames_per_second_;
  const std::string description_;
  const std::optional<CameraModel> calibration_;
  const std::vector<StampedPose> ground_truth_;
  std::vector<SourceWarning> warnings_;
  bool ended_ = false;
  std::jthread thread_;  // last: it is stopped and joined before the rest goes
};

}  // namespace

std::unique_ptr<FrameSource> make_read_ahead(std::unique_ptr<FrameSource> source, int depth) {
  PARALLAX_CHECK(source != nullptr && depth > 0, "nothing to read ahead");
  return std::make_unique<ReadAhead>(std::move(source), depth);
}

}  // namespace parallax
