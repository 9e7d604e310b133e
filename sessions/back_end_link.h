// How a front end speaks to the back end: the same calls whether it is a thread of this process
// (sessions/back_end_worker.h) or another process (sessions/lcm_link.h). One link a session; one thread calls it.
//
// Whatever happens on the way, what was sent arrives once and in order, or the link says that it is broken by RunError.
#pragma once

#include <optional>
#include <vector>

#include "sessions/back_end.h"

namespace parallax {

// Where a session begins: anew, or after the last keyframe that the back end's graph holds.
struct SessionBeginning {
  SessionState state;
  std::optional<SessionPose> last;
};

class BackEndLink {
 public:
  virtual ~BackEndLink() = default;

  // First, and once. `resume`: goes on with the session of that name when there is one. Waits for the answer.
  virtual SessionBeginning begin(const SessionStart& start, bool resume) = 0;
  // These wait only while the back end is far behind.
  virtual void add(SessionKeyframe keyframe) = 0;
  virtual void add(SessionWindow window) = 0;
  virtual void add(std::vector<SessionTiming> timings) = 0;
  // The session has ended.
  virtual void end() = 0;
  // Until all that was sent has been worked on, and after end() is durable (lockstep, and the end).
  virtual void wait() = 0;
  // What the back end has answered since the last call.
  virtual std::vector<BackEndAnswer> take_answers() = 0;
};

}  // namespace parallax
