// Windowed bundle adjustment of a stereo session (MS §3.2): the last poses and what they saw, smoothed as a batch
// whenever a pose is added; what leaves the window becomes constraints for the pose graph.
//
// World: the first keyframe's left camera. Not thread-safe: one thread steps it.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <vector>

#include "core/interruption.h"
#include "map/stereo_messages.h"
#include "solver/window_smoothing.h"

namespace parallax {

struct StereoWindowOptions {
  int poses = 15;  // MS §3
  // Poses of the window before that the next one begins with. 1: the last one alone, as MS §3.2 has it. More keep what
  // the last poses know of each other.
  int kept_poses = 8;
  int min_poses_per_point = 2;
  double sigma_px = 0.1;  // of a measured coordinate
  WindowOptions solver;
  // Noise of a coordinate as the constraints tell it, in parts of sigma_px times the kernel's scale, whose floor is
  // wide on purpose. Measured by bench/stereo_consistency.
  double noise_part = 0.85;

  // Throws InputError when a value is out of range.
  void validate() const;
};

struct StereoWindowTiming {
  int keyframe = 0;
  double smoothing_ms = 0, covariance_ms = 0;
  int poses = 0, points = 0, observations = 0, iterations = 0;
  double sigma = 1;
};

// A keyframe as the session keeps it.
struct StereoSessionPose {
  int frame = 0;
  Timestamp time{0};
  RigidTransform world_from_camera;
};

// A point of the session's feature map.
struct StereoMapPoint {
  Eigen::Vector3d world = Eigen::Vector3d::Zero();
  int poses = 0;
  int keyframe = 0;  // near it: follows it when the pose graph moves
};

class StereoWindow {
 public:
  // Options are validated; throws InputError.
  StereoWindow(const StereoCamera& camera, const StereoWindowOptions& options);

  // A new pose; the window is smoothed, and the tracker told.
  StereoWindowUpdate add(const StereoKeyframe& keyframe, const Interruption& stop = {});
  // The session has ended, or a loop was found: what the window holds is handed over.
  void finish();

  // Of all keyframes so far, those in the window as they are now.
  const std::vector<StereoSessionPose>& poses() const { return poses_; }
  // Between consecutive keyframes; those of the window follow when it is handed over.
  const std::vector<StereoConstraint>& constraints() const { return constraints_; }
  // Those that have left the window, which do not change any more.
  const std::vector<StereoMapPoint>& settled_points() const { return left_points_; }
  // Points that have left the window, and those in it, seen from enough poses and not too far to be placed.
  std::vector<StereoMapPoint> points() const;
  const std::vector<StereoWindowTiming>& timings() const { return timings_; }
  int windows() const { return windows_; }
  const StereoCamera& camera() const { return camera_; }

 private:
  struct Observation {
    std::int64_t track;
    Eigen::Vector3d pixel;
  };
  struct Pose {
    int index = 0;
    Matrix6d covariance = Matrix6d::Zero();  // of the motion to it, odometry's
    std::vector<Observation> observations;
  };
  struct Point {
    Eigen::Vector4d world = {0, 0, 1, 0};  // homogeneous, of unit norm, relative to `origin`
    int poses = 0;                         // of the window that see it
    int seen = 0;                          // of all
  };

  void smooth(StereoWindowTiming* timing, StereoWindowUpdate* update, const Interruption& stop);
  WindowProblem make_problem(std::vector<std::int64_t>* tracks, std::vector<std::pair<int, int>>* source) const;
  void place_newest();
  void hand_over(int kept);
  std::optional<StereoMapPoint> place(const Point& point) const;
  RigidTransform& pose_of(const Pose& pose) { return poses_[static_cast<std::size_t>(pose.index)].world_from_camera; }
  const RigidTransform& pose_of(const Pose& pose) const {
    return poses_[static_cast<std::size_t>(pose.index)].world_from_camera;
  }

  StereoCamera camera_;
  StereoWindowOptions options_;
  std::vector<StereoSessionPose> poses_;
  std::vector<StereoConstraint> constraints_;
  std::vector<StereoMapPoint> left_points_;
  std::vector<StereoWindowTiming> timings_;
  std::deque<Pose> window_;
  std::map<std::int64_t, Point> points_;
  int handed_over_ = 0;  // constraints up to this keyframe are out
  int windows_ = 0;
};

}  // namespace parallax
