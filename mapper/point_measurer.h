// Measures one map point in one keyframe at its predicted place (PTAM §6.2 "re-projects and measures", §6.4): the same
// warp, search and alignment as the tracker's, without its time limit.
#pragma once

#include <optional>

#include "core/camera_model.h"
#include "map/entities.h"
#include "map/source_patch.h"

namespace parallax {

// Where a point would be seen, and at what level and warp; nothing when it would not be.
struct PredictedPatch {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // level 0
  Eigen::Matrix2d warp = Eigen::Matrix2d::Zero();   // Eq. 7
  int level = 0;
};
std::optional<PredictedPatch> predict_patch(const CameraModel& camera, const MapPoint& point,
                                            const RigidTransform& source_from_world,
                                            const RigidTransform& target_from_world);

// The measurement, or nothing when no patch within `radius_px` (pixels of the target level) of the prediction is alike.
// `source` and `target` are the images of the point's source and of the keyframe it is looked for in. `other_light`:
// what is not found as it was is looked for with the contrast that the image has there, up to 2.5 times less or more.
std::optional<Measurement> measure_point(const MapPoint& point, const FrameImages& source,
                                         const PredictedPatch& predicted, const FrameImages& target, double radius_px,
                                         MeasurementSource how, bool other_light = false);

}  // namespace parallax
