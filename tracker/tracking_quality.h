// How well a frame was tracked (PTAM §5.6): from the fractions of attempted points that were found, on all levels and
// on the coarse ones, and from what the pose says of its own matches.
#pragma once

#include "tracker/tracker_options.h"
#include "tracker/two_stage.h"

namespace parallax {

TrackingQuality assess_quality(const TwoStageResult& result, const TrackerOptions& options);

// Stricter: a recovered pose is accepted only with enough inliers, spread over the image, and a high fraction.
bool accept_recovery(const TwoStageResult& result, const CameraModel& camera, const TrackerOptions& options);

}  // namespace parallax
