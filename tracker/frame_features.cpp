#include "tracker/frame_features.h"

#include <algorithm>

namespace parallax {

FrameFeatures::FrameFeatures(int width, int height, const TrackerOptions& options) {
  const double area = static_cast<double>(width) * height / (640.0 * 480.0);
  for (int level = 0; level < kPyramidLevels; ++level)
    thresholds_[level].target = std::max(20, static_cast<int>(options.corner_targets[level] * area));
}

std::shared_ptr<const FrameImages> FrameFeatures::compute(const GreyImage& grey) {
  // A pooled frame that nobody else on this thread refers to can be used again.
  std::shared_ptr<FrameImages> frame;
  for (auto& kept : pool_) {
    if (kept.use_count() == 1) {
      frame = kept;
      break;
    }
  }
  if (!frame) {
    frame = std::make_shared<FrameImages>();
    pool_.push_back(frame);
  }
  build_pyramid(grey, &frame->pyramid);
  for (int level = 0; level < kPyramidLevels; ++level) {
    fast_corners(frame->pyramid.level[level], thresholds_[level].threshold, &frame->corners[level]);
    thresholds_[level].update(static_cast<int>(frame->corners[level].corners.size()));
  }
  frame->small = make_small_blurry_image(frame->pyramid);
  return frame;
}

void FrameFeatures::give_away(const std::shared_ptr<const FrameImages>& images) {
  std::erase_if(pool_, [&](const auto& kept) { return kept == images; });
}

}  // namespace parallax
