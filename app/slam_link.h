// A stereo session's side of the link to the back end: what the window makes of the frames becomes messages.
//
// A front end whose motion was lost goes on in the same session over a weak constraint, or, by setting, in a session of
// its own that is joined to the others when it recognises a place (MS §5.1).
//
// keyframe() is called on the window's thread, finish() after it has ended.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "app/slam_session.h"
#include "sessions/back_end_link.h"

namespace parallax {

struct SlamLinkOptions {
  bool lockstep = false;                   // every keyframe waits for its answer
  bool hand_over_at_loop = false;          // the paper's way: a loop ends the window (MS §3.2)
  bool new_session_after_failure = false;  // else a constraint of zero motion with a large covariance
};

// Part of a front end's keyframes: those from `first_local` on are the session's keyframes from `first_keyframe` on.
struct SlamLinkPart {
  SessionState state;
  int first_local = 0, first_keyframe = 0;
  RigidTransform session_from_front_end;

  int keyframe_of(int local) const { return local - first_local + first_keyframe; }
};

using SlamLinkMaker = std::function<std::unique_ptr<BackEndLink>()>;

class SlamLink {
 public:
  // Begins the session (waits for the back end). `resume`: goes on with the session of that name.
  SlamLink(SlamLinkMaker maker, const SessionStart& start, bool resume, const SlamLinkOptions& options);

  // Where the session goes on when it was resumed.
  const std::optional<SessionPose>& last() const { return last_; }
  // In order; one, unless the motion was lost.
  const std::vector<SlamLinkPart>& parts() const { return parts_; }

  // True: a loop was found, and the window is to be handed over.
  bool keyframe(const StereoKeyframe& keyframe, const StereoWindow& window);
  // What the last window left; the session ends, and all of it is durable when this returns.
  void finish(const SlamResult& result);

  // Meetings with other sessions, in order, as the back end told of them.
  const std::vector<SessionMeeting>& meetings() const { return meetings_; }

 private:
  void begin_part(const StereoKeyframe& keyframe, const StereoWindow& window);
  void send_window(const std::vector<StereoConstraint>& constraints, const std::vector<StereoMapPoint>& points,
                   const std::vector<StereoSessionPose>& poses);
  void end_session();
  void take_answers(bool* loop);

  SlamLinkMaker maker_;
  std::unique_ptr<BackEndLink> link_;
  SessionStart start_;
  SlamLinkOptions options_;
  std::optional<SessionPose> last_;
  std::vector<SlamLinkPart> parts_;
  std::size_t constraints_sent_ = 0, points_sent_ = 0, timings_sent_ = 0;
  std::vector<SessionMeeting> meetings_;
};

}  // namespace parallax
