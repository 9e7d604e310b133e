// Pairs of frames from stereo recordings (EuRoC with cam0 and cam1, KITTI with both images).
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "camera/frame_source.h"
#include "core/camera_model.h"
#include "core/frame.h"
#include "core/se3.h"

namespace parallax {

// Both frames carry the left one's index and time.
struct StereoFrame {
  Frame left, right;
};

// The two cameras and where the right one is: `right_from_left` takes a point in the left camera's frame to the
// right's.
struct StereoCalibration {
  CameraModel left, right;
  RigidTransform right_from_left;
  double baseline_m() const { return right_from_left.t.norm(); }
};

// Pairs in order of time. Not thread-safe: one thread reads.
class StereoSource {
 public:
  virtual ~StereoSource() = default;

  // The next pair; nothing at the end. A left frame without its right one (missing, corrupt, no image close enough in
  // time), or the other way round, is skipped with a warning; its index is used up.
  virtual std::optional<StereoFrame> next() = 0;

  // What went wrong since the last call; clears the list.
  virtual std::vector<SourceWarning> take_warnings() = 0;

  virtual int frame_count() const = 0;
  virtual double frames_per_second() const = 0;
  virtual std::string description() const = 0;

  // When the recording carries both cameras' calibrations.
  virtual std::optional<StereoCalibration> calibration() const = 0;
  // Of the left camera, sorted by time; may be empty.
  virtual std::vector<StampedPose> ground_truth() const = 0;
};

// Throws InputError with one clear line when the folder is no stereo recording. EuRoC images are paired by time, to
// within a quarter of the frame interval; KITTI's by number.
std::unique_ptr<StereoSource> open_stereo_source(const std::string& folder, const SourceOptions& options = {});

}  // namespace parallax
