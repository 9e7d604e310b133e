// Who looks on while sessions run. Interface of the runner (app/slam_sessions) to the live view.
#pragma once

#include <cstddef>

#include "app/slam_link.h"
#include "sessions/back_end_worker.h"

namespace parallax {

// Calls come from the threads of the run, several at once, and hold them up: soon back.
class SlamWatcher {
 public:
  virtual ~SlamWatcher() = default;
  // Of session `k` (0, 1... as planned), after each frame: on its tracking thread.
  virtual void frame(std::size_t k, const SlamFrame& frame, const StereoImages& images,
                     const StereoOdometry& odometry) = 0;
  // A keyframe was smoothed, and belongs to this part: on its window's thread.
  virtual void keyframe(const StereoKeyframe& keyframe, const StereoWindow& window, const SlamLinkPart& part) = 0;
  // The back end of this process, which may be asked from now on until the call with null. Not called when it is
  // elsewhere.
  virtual void back_end(BackEndWorker* worker) = 0;
};

}  // namespace parallax
