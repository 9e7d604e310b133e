#include "app/slam_link.h"

#include <algorithm>
#include <utility>

namespace parallax {

SlamLink::SlamLink(SlamLinkMaker maker, const SessionStart& start, bool resume, const SlamLinkOptions& options)
    : maker_(std::move(maker)), link_(maker_()), start_(start), options_(options) {
  SessionBeginning beginning = link_->begin(start_, resume);
  SlamLinkPart part;
  part.state = beginning.state;
  if (beginning.last) {
    part.first_keyframe = beginning.last->key.keyframe;
    part.session_from_front_end = beginning.last->session_from_camera;
  }
  last_ = beginning.last;
  parts_.push_back(std::move(part));
}

bool SlamLink::keyframe(const StereoKeyframe& keyframe, const StereoWindow& window) {
  if (keyframe.after_failure && options_.new_session_after_failure) begin_part(keyframe, window);
  const SlamLinkPart& part = parts_.back();
  SessionKeyframe message;
  message.index = part.keyframe_of(keyframe.index);
  message.frame = keyframe.frame;
  message.time = keyframe.time;
  message.after_failure = keyframe.after_failure;
  message.session_from_camera = part.session_from_front_end * window.poses().back().world_from_camera;
  message.left = keyframe.left;
  message.right = keyframe.right;
  link_->add(std::move(message));
  send_window(window.constraints(), window.settled_points(), window.poses());
  std::vector<SessionTiming> timings;
  for (; timings_sent_ < window.timings().size(); ++timings_sent_) {
    const StereoWindowTiming& t = window.timings()[timings_sent_];
    if (t.keyframe < part.first_local) continue;
    timings.push_back({{part.state.id, part.keyframe_of(t.keyframe)}, SessionModule::window, t.smoothing_ms, false});
  }
  if (!timings.empty()) link_->add(std::move(timings));
  if (options_.lockstep) link_->wait();
  bool loop = false;
  take_answers(&loop);
  return loop && options_.hand_over_at_loop;
}

// All before the loss goes to the session that ends here; the constraint across it to none.
void SlamLink::begin_part(const StereoKeyframe& keyframe, const StereoWindow& window) {
  std::vector<StereoConstraint> before = window.constraints();
  std::erase_if(before, [&](const StereoConstraint& c) { return c.to >= keyframe.index; });
  send_window(before, window.settled_points(), window.poses());
  constraints_sent_ = window.constraints().size();
  end_session();
  link_ = maker_();
  SlamLinkPart part;
  part.state = link_->begin(start_, false).state;
  part.first_local = keyframe.index;
  part.session_from_front_end = window.poses().back().world_from_camera.inverse();
  parts_.push_back(std::move(part));
}

void SlamLink::take_answers(bool* loop) {
  for (BackEndAnswer& answer : link_->take_answers()) {
    if (loop) *loop |= answer.loop;
    for (SessionMeeting& meeting : answer.meetings) meetings_.push_back(std::move(meeting));
  }
}

void SlamLink::send_window(const std::vector<StereoConstraint>& constraints, const std::vector<StereoMapPoint>& points,
                           const std::vector<StereoSessionPose>& poses) {
  if (constraints.size() <= constraints_sent_) return;
  const SlamLinkPart& part = parts_.back();
  SessionWindow window;
  for (; constraints_sent_ < constraints.size(); ++constraints_sent_) {
    window.constraints.push_back(constraints[constraints_sent_]);
    window.constraints.back().from = part.keyframe_of(window.constraints.back().from);
    window.constraints.back().to = part.keyframe_of(window.constraints.back().to);
  }
  for (; points_sent_ < points.size(); ++points_sent_) {
    const StereoMapPoint& point = points[points_sent_];
    if (point.keyframe < part.first_local) continue;
    const RigidTransform& reference = poses[static_cast<std::size_t>(point.keyframe)].world_from_camera;
    window.points.push_back(
        {part.keyframe_of(point.keyframe), (reference.inverse() * point.world).cast<float>(), point.poses});
  }
  link_->add(std::move(window));
}

void SlamLink::end_session() {
  link_->end();
  link_->wait();
  take_answers(nullptr);
}

void SlamLink::finish(const SlamResult& result) {
  send_window(result.constraints, result.points, result.keyframes);
  std::vector<SessionTiming> timings;
  for (const SlamFrame& frame : result.frames) {
    const PoseKey key{parts_.front().state.id, frame.result.frame};
    timings.push_back({key, SessionModule::feature_tracking, frame.result.timing.feature_tracking_ms, false});
    timings.push_back({key, SessionModule::stereo_odometry, frame.result.timing.odometry_ms, false});
  }
  link_->add(std::move(timings));
  end_session();
}

}  // namespace parallax
