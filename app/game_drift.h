// Whether what a game puts on the table stays there: where one of its things is drawn, against where that thing is for
// a camera that knows its own pose.
//
// A thing is put down where it is drawn when it is seen first: on the true camera's ray through that pixel, as far away
// as the map says (in the scale that fits the tracked path to the true one). From then on its drift in a frame is the
// distance between the pixel where it is drawn and the one where the true camera sees that place.
//
// Plain functions and values.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "camera/frame_source.h"
#include "core/camera_model.h"
#include "core/se3.h"
#include "core/time.h"

namespace parallax {

// A thing of a game in one frame, as it was drawn.
struct GameSight {
  Timestamp time{0};
  std::uint64_t number = 0;  // which thing
  RigidTransform camera_from_world;
  Eigen::Vector3d place = Eigen::Vector3d::Zero();  // world
};

struct GameDrift {
  int frames = 0, things = 0;
  double median_px = 0, largest_px = 0;  // over frames in which the thing lies in the image
};

// Nothing where the truth does not cover the path, or the path is too short to tell its scale.
std::optional<GameDrift> measure_drift(const std::vector<GameSight>& sights, const std::vector<StampedPose>& truth,
                                       const CameraModel& camera);

}  // namespace parallax
