#include "camera/image_sequence.h"

#include <algorithm>
#include <utility>

#include "core/error.h"

namespace parallax {
namespace {

class SequenceSource : public FrameSource {
 public:
  SequenceSource(ImageSequence sequence, const SourceOptions& options)
      : sequence_(std::move(sequence)), options_(options), warnings_(std::move(sequence_.warnings)) {
    if (options_.start_frame > 0 && options_.start_frame >= sequence_.positions) {
      throw InputError(sequence_.description + ": found " + std::to_string(sequence_.positions) +
                       " frames, expected more than the start frame " + std::to_string(options_.start_frame));
    }
    while (at_ < sequence_.images.size() && sequence_.images[at_].index < options_.start_frame) ++at_;
  }

  std::optional<Frame> next() override {
    while (at_ < sequence_.images.size() && (options_.max_frames < 0 || delivered_ < options_.max_frames)) {
      const SequenceImage& image = sequence_.images[at_++];
      Frame frame;
      const std::string problem = load_frame(sequence_, image, options_.colour, &frame);
      if (problem.empty()) {
        ++delivered_;
        return frame;
      }
      warnings_.push_back({image.index, problem});
    }
    return std::nullopt;
  }

  std::vector<SourceWarning> take_warnings() override { return std::exchange(warnings_, {}); }
  int frame_count() const override {
    const int left = sequence_.positions - std::max(options_.start_frame, 0);
    return options_.max_frames < 0 ? left : std::min(left, options_.max_frames);
  }
  double frames_per_second() const override { return sequence_.frames_per_second; }
  std::string description() const override { return sequence_.description; }
  std::optional<CameraModel> calibration() const override { return sequence_.calibration; }
  std::vector<StampedPose> ground_truth() const override { return sequence_.ground_truth; }

 private:
  ImageSequence sequence_;
  SourceOptions options_;
  std::vector<SourceWarning> warnings_;
  std::size_t at_ = 0;
  int delivered_ = 0;
};

}  // namespace

void probe_sequence(ImageSequence* sequence) {
  // A recording whose first images are all unreadable is not worth the wait for the rest.
  constexpr std::size_t kTries = 20;
  std::string first_problem;
  for (std::size_t i = 0; i < sequence->images.size() && i < kTries; ++i) {
    const std::string problem = probe_image(sequence->images[i].path, &sequence->probe);
    if (problem.empty()) return;
    if (first_problem.empty()) first_problem = sequence->images[i].path + ": " + problem;
  }
  if (first_problem.empty()) throw InputError(sequence->description + ": found no image to read");
  const bool one = sequence->images.size() == 1;
  throw InputError(first_problem + (one ? "" : " (nor can the images after it be read)"));
}

void check_calibration_size(const CameraModel& calibration, const std::string& calibration_name,
                            const ImageSequence& sequence) {
  const ImageSize size{calibration.width(), calibration.height()};
  if (size == sequence.probe.size) return;
  throw InputError(calibration_name + ": found a calibration for " + to_string(size) + ", expected " +
                   to_string(sequence.probe.size) + " as the images of " + sequence.description + " have");
}

double median_rate(const std::vector<SequenceImage>& images, double fallback) {
  std::vector<Timestamp> steps;
  for (std::size_t i = 1; i < images.size(); ++i) {
    if (images[i].index == images[i - 1].index + 1) steps.push_back(images[i].time - images[i - 1].time);
  }
  if (steps.empty()) return fallback;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return middle->count() > 0 ? 1.0 / to_seconds(*middle) : fallback;
}

std::string load_frame(const ImageSequence& sequence, const SequenceImage& image, bool colour, Frame* frame) {
  DecodedImage decoded;
  const auto problem = [&](const std::string& reason) { return image.path + ": skipped: " + reason; };
  const std::string reason = load_image(image.path, {colour, sequence.probe.deep_bits}, &decoded);
  if (!reason.empty()) return problem(reason);
  const ImageSize size{decoded.grey.cols, decoded.grey.rows};
  if (!(size == sequence.probe.size)) {
    return problem("found size " + to_string(size) + ", expected " + to_string(sequence.probe.size) +
                   " as the first image has");
  }
  frame->index = image.index;
  frame->time = image.time;
  frame->grey = decoded.grey;
  frame->colour = decoded.colour;
  return "";
}

std::unique_ptr<FrameSource> make_sequence_source(ImageSequence sequence, const SourceOptions& options) {
  return std::make_unique<SequenceSource>(std::move(sequence), options);
}

}  // namespace parallax
