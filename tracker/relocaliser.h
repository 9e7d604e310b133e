// Recovery when lost (PTAM §5.6): the keyframes that look most like the frame as small blurry images give candidate
// poses; where those lead nowhere, descriptors of the map's points matched with the frame's corners give one by the
// three-point algorithm. Patch search and pose refinement accept or reject each. A pose that is not clearly supported
// is never returned.
#pragma once

#include <random>

#include "tracker/point_matcher.h"
#include "tracker/two_stage.h"

namespace parallax {

// Not thread-safe; belongs to the tracking thread.
class Relocaliser {
 public:
  Relocaliser(const CameraModel& camera, const TrackerOptions& options) : camera_(camera), options_(options) {}

  // Starts a new recovery.
  void reset() { next_ = 0; }
  // The map was replaced: nothing known of its points holds.
  void clear() { matcher_.clear(); }

  // Tries the pose `hint` (where the camera was last) and some of the best keyframes; the following calls go on down
  // the list, so that every keyframe gets its turn while lost. True with the result that was accepted.
  bool recover(const TrackingSnapshot& map, const FrameImages& frame, const RigidTransform& hint,
               TwoStageTracker* tracker, TwoStageResult* accepted);

 private:
  bool recover_by_descriptors(const TrackingSnapshot& map, const FrameImages& frame, TwoStageTracker* tracker,
                              TwoStageResult* accepted);
  // `is_guess`: where the coarse stage leads nowhere, nothing more is tried.
  bool try_pose(const TrackingSnapshot& map, const FrameImages& frame, const RigidTransform& pose, bool is_guess,
                TwoStageTracker* tracker, TwoStageResult* result);

  CameraModel camera_;
  TrackerOptions options_;
  std::size_t next_ = 0;
  bool looked_closely_ = false;  // at a pose, with all points, in this frame
  PointMatcher matcher_;
  std::mt19937_64 rng_{1};
};

}  // namespace parallax
