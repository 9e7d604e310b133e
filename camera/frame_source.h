// Where frames come from. One interface for video files, image folders, data sets, and (in render/) synthetic scenes.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "core/frame.h"
#include "core/se3.h"

namespace parallax {

// A pose with its time: camera to world. `index` is the frame it belongs to, or -1.
struct StampedPose {
  Timestamp time{0};
  RigidTransform world_from_camera;
};

// A problem that was survived: a frame that could not be read, a line that was skipped. One line each for the user.
struct SourceWarning {
  int frame = -1;  // -1: about the source as a whole
  std::string text;
};

// Frames in order of time. Not thread-safe: one thread reads (see ReadAhead for a thread of its own).
class FrameSource {
 public:
  virtual ~FrameSource() = default;

  // The next frame; nothing at the end. A frame that is missing or corrupt in the middle is skipped with a warning (its
  // index is used up, so later frames keep their numbers). A frame whose size differs from the first one's is skipped
  // with a warning too.
  virtual std::optional<Frame> next() = 0;

  // What went wrong since the last call; clears the list.
  virtual std::vector<SourceWarning> take_warnings() = 0;

  // Number of frames, when known beforehand (-1: unknown), the nominal rate, and what the source is, for messages.
  virtual int frame_count() const = 0;
  virtual double frames_per_second() const = 0;
  virtual std::string description() const = 0;

  // The calibration the source itself carries, if any.
  virtual std::optional<CameraModel> calibration() const { return std::nullopt; }
  // True poses, where the source carries them (ground truth file, synthetic scene): sorted by time; may be empty.
  virtual std::vector<StampedPose> ground_truth() const { return {}; }
};

struct SourceOptions {
  bool colour = false;         // also decode colour (for --video); grey is always there
  int start_frame = 0;         // first frame delivered; earlier ones are skipped and keep their numbers
  int max_frames = -1;         // at most so many frames are delivered; -1: all
  double fallback_fps = 30.0;  // for numbered images and videos that state no rate
};

// Opens a video file or a folder (TUM RGB-D, EuRoC, KITTI layout or plain numbered images, told apart by what is in
// it). Throws InputError with one clear line when there is nothing to read. For stereo layouts this is the left camera.
std::unique_ptr<FrameSource> open_frame_source(const std::string& source, const SourceOptions& options = {});

// Wraps a source: frames are decoded ahead of the consumer in a thread of their own, at most `depth` frames ahead.
// next() blocks for the thread; the destructor stops it. Other calls are forwarded safely.
std::unique_ptr<FrameSource> make_read_ahead(std::unique_ptr<FrameSource> source, int depth = 8);

}  // namespace parallax
