#include "camera/stereo_source.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "camera/image_sequence.h"
#include "core/error.h"

namespace parallax {
namespace {

// For each left image the place of its right one, or -1. `tolerance` 0: by number.
std::vector<int> pair_images(const ImageSequence& left, const ImageSequence& right, Timestamp tolerance) {
  std::vector<int> pairs;
  pairs.reserve(left.images.size());
  for (const SequenceImage& image : left.images) {
    const auto begin = right.images.begin(), end = right.images.end();
    int found = -1;
    if (tolerance.count() == 0) {
      const auto at = std::lower_bound(begin, end, image.index,
                                       [](const SequenceImage& other, int index) { return other.index < index; });
      if (at != end && at->index == image.index) found = static_cast<int>(at - begin);
    } else {
      const auto after = std::lower_bound(begin, end, image.time,
                                          [](const SequenceImage& other, Timestamp time) { return other.time < time; });
      Timestamp best = tolerance;
      for (const auto at : {after, after == begin ? end : after - 1}) {
        if (at == end) continue;
        const Timestamp apart = at->time < image.time ? image.time - at->time : at->time - image.time;
        if (apart <= best) {
          best = apart;
          found = static_cast<int>(at - begin);
        }
      }
    }
    pairs.push_back(found);
  }
  return pairs;
}

class SequencePairSource : public StereoSource {
 public:
  SequencePairSource(ImageSequence left, ImageSequence right, Timestamp tolerance, const SourceOptions& options)
      : left_(std::move(left)), right_(std::move(right)), options_(options), warnings_(std::move(left_.warnings)) {
    if (!(left_.probe.size == right_.probe.size)) {
      throw InputError(left_.description + ": found left images of " + to_string(left_.probe.size) +
                       " and right ones of " + to_string(right_.probe.size) + ", expected one size");
    }
    if (options_.start_frame > 0 && options_.start_frame >= left_.positions) {
      throw InputError(left_.description + ": found " + std::to_string(left_.positions) +
                       " frames, expected more than the start frame " + std::to_string(options_.start_frame));
    }
    // One scale for both cameras, so that their brightness compares.
    left_.probe.deep_bits = right_.probe.deep_bits = std::max(left_.probe.deep_bits, right_.probe.deep_bits);
    // What the right side says of shared files (times.txt) has been said by the left.
    for (auto& warning : right_.warnings) {
      const bool said = std::any_of(warnings_.begin(), warnings_.end(),
                                    [&](const SourceWarning& other) { return other.text == warning.text; });
      if (!said) warnings_.push_back(std::move(warning));
    }
    right_of_left_ = pair_images(left_, right_, tolerance);
    if (std::all_of(right_of_left_.begin(), right_of_left_.end(), [](int right_at) { return right_at < 0; })) {
      throw InputError(left_.description + ": found no right image at the time of any left one, expected pairs");
    }
    while (at_ < left_.images.size() && left_.images[at_].index < options_.start_frame) ++at_;
  }

  std::optional<StereoFrame> next() override {
    while (at_ < left_.images.size() && (options_.max_frames < 0 || delivered_ < options_.max_frames)) {
      const std::size_t at = at_++;
      const SequenceImage& image = left_.images[at];
      StereoFrame pair;
      const std::string problem = load_pair(image, right_of_left_[at], &pair);
      if (problem.empty()) {
        ++delivered_;
        return pair;
      }
      warnings_.push_back({image.index, problem});
    }
    return std::nullopt;
  }

  std::vector<SourceWarning> take_warnings() override { return std::exchange(warnings_, {}); }
  int frame_count() const override {
    const int rest = left_.positions - std::max(options_.start_frame, 0);
    return options_.max_frames < 0 ? rest : std::min(rest, options_.max_frames);
  }
  double frames_per_second() const override { return left_.frames_per_second; }
  std::string description() const override { return left_.description + " (stereo)"; }
  std::optional<StereoCalibration> calibration() const override {
    if (!left_.calibration || !right_.calibration) return std::nullopt;
    return StereoCalibration{*left_.calibration, *right_.calibration,
                             right_.body_from_camera.inverse() * left_.body_from_camera};
  }
  std::vector<StampedPose> ground_truth() const override { return left_.ground_truth; }

 private:
  std::string load_pair(const SequenceImage& image, int right_at, StereoFrame* pair) const {
    if (right_at < 0) return image.path + ": skipped: no right image was taken at its time";
    std::string problem = load_frame(left_, image, options_.colour, &pair->left);
    if (!problem.empty()) return problem;
    const SequenceImage& other = right_.images[static_cast<std::size_t>(right_at)];
    problem = load_frame(right_, other, options_.colour, &pair->right);
    if (!problem.empty()) return problem + " (and its left image with it)";
    pair->right.index = pair->left.index;
    pair->right.time = pair->left.time;
    return "";
  }

  ImageSequence left_, right_;
  SourceOptions options_;
  std::vector<SourceWarning> warnings_;
  std::vector<int> right_of_left_;
  std::size_t at_ = 0;
  int delivered_ = 0;
};

}  // namespace

std::unique_ptr<StereoSource> open_stereo_source(const std::string& folder, const SourceOptions& options) {
  std::error_code error;
  if (!std::filesystem::is_directory(folder, error)) {
    throw InputError(folder + ": " + (error ? error.message() : "found no folder") +
                     ", expected a stereo recording (EuRoC or KITTI folder)");
  }
  if (is_euroc_folder(folder)) {
    ImageSequence left = open_euroc_sequence(folder, 0, options), right = open_euroc_sequence(folder, 1, options);
    const Timestamp tolerance = from_seconds(0.25 / left.frames_per_second);
    return std::make_unique<SequencePairSource>(std::move(left), std::move(right), tolerance, options);
  }
  if (is_kitti_folder(folder)) {
    return std::make_unique<SequencePairSource>(open_kitti_sequence(folder, 0, options),
                                                open_kitti_sequence(folder, 1, options), Timestamp(0), options);
  }
  throw InputError(folder +
                   ": found no stereo recording, expected mav0/cam0 and cam1 (EuRoC) or image_0 and image_1 (KITTI)");
}

}  // namespace parallax
