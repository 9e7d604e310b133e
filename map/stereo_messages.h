// What passes between the stereo odometry (tracker) and the window (mapper): MS Fig. 1.
//
// Keyframes are numbered from 0 within their session. A frame's pose is told relative to its reference, the keyframe
// before it or itself; points are told in the frame of a keyframe's left camera, homogeneous and of unit norm (w = 0:
// at infinity). Metres, level-0 pixels of the rectified pair. Plain values, safe to hand from thread to thread.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/image.h"
#include "core/se3.h"
#include "core/stereo_camera.h"
#include "core/time.h"

namespace parallax {

// A track as seen in a keyframe.
struct StereoMeasurement {
  std::int64_t track = 0;
  Eigen::Vector3d pixel = Eigen::Vector3d::Zero();  // (u_left, u_right, v); u_right NaN: not seen by the right camera
  Eigen::Vector4d point = {0, 0, 1, 0};             // the tracker's estimate, in the frame of this keyframe
};

// Tracker to window: a pose that is at least 0.2 m or 0.2 rad from the last one (MS §3.2).
struct StereoKeyframe {
  int index = 0, frame = 0;
  Timestamp time{0};
  RigidTransform previous_from_this;       // to the keyframe before; the identity for the first
  Matrix6d covariance = Matrix6d::Zero();  // of previous_from_this, as odometry has it; left perturbation
  // The tracker had failed in between (MS §5.1): previous_from_this is a guess of zero motion, the covariance large,
  // and no track of this keyframe goes back across it.
  bool after_failure = false;
  std::vector<StereoMeasurement> measurements;
  GreyImage left, right;  // rectified; shared
};

// Window to tracker: what became of the newest keyframe's surroundings.
struct StereoWindowUpdate {
  int keyframe = -1;
  RigidTransform world_from_keyframe;
  struct Point {
    std::int64_t track = 0;
    Eigen::Vector4d point = {0, 0, 1, 0};  // in the frame of `keyframe`
    int poses = 0;                         // that saw it
    bool outlier = false;                  // does not fit: to be dropped
  };
  std::vector<Point> points;  // sorted by track
};

// Window to pose graph: a constraint between consecutive keyframes (MS Eq. 3).
struct StereoConstraint {
  int from = 0, to = 0;
  RigidTransform from_from_to;             // a point in the later keyframe's frame to the earlier one's
  Matrix6d covariance = Matrix6d::Zero();  // left perturbation of from_from_to, translation first
  bool after_failure = false;
};

}  // namespace parallax
