// Patch search in a frame (PTAM §5.3): warp and cache the template, zero-mean SSD at the FAST corners within a radius,
// sub-pixel refinement by inverse composition.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "map/source_patch.h"
#include "map/tracking_snapshot.h"
#include "tracker/projection.h"
#include "tracker/tracker_options.h"

namespace parallax {

struct PatchMatch {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // level 0
  double sigma_px = 1;                              // level 0
  bool found = false;
};

// Owns the cache of warped templates, keyed by point. Not thread-safe; belongs to the tracking thread.
class PatchSearch {
 public:
  explicit PatchSearch(const TrackerOptions& options) : options_(options) {}

  // Looks for the candidate within radius_px (level 0) of its predicted pixel. With align_directly, a point that no
  // corner matches is aligned from the predicted position itself.
  PatchMatch find(const TrackingSnapshot& map, const Candidate& candidate, const FrameImages& frame, double radius_px,
                  bool align_directly);

  // The map was replaced: nothing cached holds.
  void clear();

 private:
  void forget_absent(const TrackingSnapshot& map);
  const WarpedPatch& warped(const TrackingSnapshot& map, const Candidate& candidate);

  TrackerOptions options_;
  struct Entry {
    WarpedPatch patch;
    KeyframeId source;
    Eigen::Vector2f source_pixel = Eigen::Vector2f::Zero();
  };
  std::vector<std::unique_ptr<Entry>> cache_;  // by index of the point
  std::size_t entries_ = 0;
};

}  // namespace parallax
