// One session of the stereo system: rectification, odometry, and the window, at the pace of the time stamps on two
// threads or in lockstep (MS Fig. 1, the part on the left).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "app/run_session.h"
#include "camera/stereo_rectification.h"
#include "camera/stereo_source.h"
#include "core/trajectory.h"
#include "mapper/stereo_window.h"
#include "tracker/stereo_odometry.h"

namespace parallax {

struct SlamOptions {
  Pace pace = Pace::realtime;
  double speed = 1.0;  // realtime: how fast time passes
  StereoTrackerOptions tracker;
  StereoWindowOptions window;
};

struct SlamFrame {
  StereoFrameResult result;  // without the keyframe's measurements and images
  bool is_keyframe = false;
  RigidTransform world_from_reference;  // as it was known at this frame
  double rectification_ms = 0;

  bool has_pose() const { return result.state != StereoState::failed; }
  RigidTransform world_from_camera() const { return world_from_reference * result.reference_from_camera; }
};

struct SlamResult {
  StereoCamera camera;
  RigidTransform rectified_from_left;
  std::vector<SlamFrame> frames;  // that reached the tracker
  std::vector<StereoSessionPose> keyframes;
  std::vector<StereoConstraint> constraints;
  std::vector<StereoMapPoint> points;
  std::vector<StereoWindowTiming> window_timings;
  int windows = 0;
  std::vector<SourceWarning> warnings;
  int frames_read = 0, frames_dropped = 0, failures = 0;
  double wall_seconds = 0;

  // Every frame with a pose, camera to world, of the left camera as calibrated: as known at that frame, or as the
  // windows have left it.
  Trajectory live_trajectory() const;
  Trajectory final_trajectory() const;
  Trajectory keyframe_trajectory() const;
};

// Called on the tracking thread after each frame, with its rectified images.
using SlamObserver = std::function<void(const SlamFrame&, const StereoImages&, const StereoOdometry&)>;
// Called on the window's thread (in lockstep: the same) when a keyframe has been smoothed. True: a loop was found, the
// window is to be handed over now (MS §3.2).
using SlamKeyframeObserver = std::function<bool(const StereoKeyframe&, const StereoWindow&)>;

// Runs to the end of the source. Throws InputError for what cannot be a stereo pair (swapped cameras, images of another
// size, no calibration), naming the source.
SlamResult run_slam(StereoSource* source, const StereoCalibration& calibration, const SlamOptions& options,
                    const SlamObserver& observer = {}, const SlamKeyframeObserver& keyframes = {});

}  // namespace parallax
