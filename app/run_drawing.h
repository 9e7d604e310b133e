// `run --video` and `--frames`: the recording with points, grid and state line drawn in.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "camera/video_writer.h"
#include "core/frame.h"
#include "map/entities.h"
#include "tracker/tracking_types.h"

namespace parallax {

// Used on the tracking thread. Throws RunError when an output cannot be written.
class RunDrawing {
 public:
  // Either path may be empty. The folder of `frames_folder` is made when it is not there.
  RunDrawing(const CameraModel& camera, double frames_per_second, const std::string& video_path,
             const std::string& frames_folder);

  void draw(const Frame& frame, const TrackingResult& tracked, const std::optional<Plane>& plane);
  void close();

 private:
  CameraModel camera_;
  std::optional<VideoWriter> video_;
  std::string folder_;
};

// The state line: "good  712/804 found  17 keyframes  2434 points  3.1 ms".
std::string state_line(const TrackingResult& tracked);

}  // namespace parallax
