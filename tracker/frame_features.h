// What is computed of every frame before anything is tracked (PTAM §5.1): pyramid, corners with adaptive thresholds,
// small blurry image. Frames that never left the tracking thread are recycled, so that a running tracker does not
// allocate.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "map/entities.h"
#include "tracker/tracker_options.h"

namespace parallax {

// Not thread-safe; belongs to the tracking thread.
class FrameFeatures {
 public:
  FrameFeatures(int width, int height, const TrackerOptions& options);
  std::shared_ptr<const FrameImages> compute(const GreyImage& grey);
  // To be called before a frame's images are handed to another thread: they are never written again.
  void give_away(const std::shared_ptr<const FrameImages>& images);

 private:
  std::array<AdaptiveThreshold, kPyramidLevels> thresholds_;
  std::vector<std::shared_ptr<FrameImages>> pool_;
};

}  // namespace parallax
