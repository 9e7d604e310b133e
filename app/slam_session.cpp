#include "app/slam_session.h"

#include <algorithm>
#include <exception>
#include <optional>
#include <thread>
#include <utility>

#include "core/bounded_queue.h"
#include "core/error.h"
#include "core/mutex.h"
#include "tracker/stereo_check.h"

namespace parallax {
namespace {

constexpr std::size_t kArriving = 2;    // pairs that wait for the tracker; the newest are kept
constexpr std::size_t kKeyframes = 64;  // that wait for the window
constexpr int kFramesToRefuse = 20;     // a rig that shows itself wrong so early is refused, later it is told

// The rig, not the moment, is at fault: no later pair will be better.
bool is_lasting(StereoProblem problem) {
  return problem == StereoProblem::swapped || problem == StereoProblem::rows_apart ||
         problem == StereoProblem::one_image;
}

// World poses of the keyframes as the tracking thread knows them.
class KnownPoses {
 public:
  void add(const StereoKeyframe& keyframe) {
    previous_from_this_.push_back(keyframe.previous_from_this);
    world_from_.push_back(world_from_.empty() ? RigidTransform() : world_from_.back() * keyframe.previous_from_this);
  }
  // What follows the keyframe follows it.
  void take(const StereoWindowUpdate& update) {
    if (update.keyframe < 0 || update.keyframe >= static_cast<int>(world_from_.size())) return;
    auto at = static_cast<std::size_t>(update.keyframe);
    world_from_[at] = update.world_from_keyframe;
    for (++at; at < world_from_.size(); ++at) world_from_[at] = world_from_[at - 1] * previous_from_this_[at];
  }
  RigidTransform world_from(int keyframe) const {
    return keyframe < static_cast<int>(world_from_.size()) ? world_from_[static_cast<std::size_t>(keyframe)]
                                                           : RigidTransform();
  }

 private:
  std::vector<RigidTransform> world_from_, previous_from_this_;
};

// The tracking thread's work on one pair.
class FrontEnd {
 public:
  FrontEnd(const StereoCalibration& calibration, const SlamOptions& options, const std::string& name,
           const SlamObserver& observer)
      : rectifier_(calibration, {}, name),
        odometry_(rectifier_.camera(), options.tracker, rectifier_.left_mask()),
        name_(name),
        observer_(observer) {}

  const StereoRectifier& rectifier() const { return rectifier_; }

  void take(const StereoWindowUpdate& update) {
    odometry_.take(update);
    known_.take(update);
  }

  // The keyframe, when the pair has become one, is for the window.
  std::optional<StereoKeyframe> process(const StereoFrame& pair, SlamResult* out) {
    const auto begin = SteadyClock::now();
    StereoImages images;
    rectifier_.rectify(pair, &images);
    SlamFrame frame;
    frame.rectification_ms = milliseconds_since(begin);
    look_at_rig(images, pair.left.index, out);
    frame.result = odometry_.process(pair.left.index, pair.left.time, images.left, images.right);
    std::optional<StereoKeyframe> keyframe = std::move(frame.result.keyframe);
    frame.result.keyframe.reset();
    if (keyframe) known_.add(*keyframe);
    frame.is_keyframe = keyframe.has_value();
    frame.world_from_reference = known_.world_from(frame.result.reference);
    const bool failed = (keyframe && keyframe->after_failure) || !frame.has_pose();
    if (failed) ++out->failures;
    if (failed && !failing_) look_for_reason(images, frame.result, out);
    failing_ = failed;
    if (observer_) observer_(frame, images, odometry_);
    out->frames.push_back(std::move(frame));
    return keyframe;
  }

 private:
  // What is wrong with the rig is refused while nothing has been made of it, and told later.
  void look_at_rig(const StereoImages& images, int frame, SlamResult* out) {
    const auto verdict = watch_.look(images.left, images.right);
    if (!verdict || verdict->text.empty()) return;
    if (is_lasting(verdict->problem) && static_cast<int>(out->frames.size()) < kFramesToRefuse)
      throw InputError(name_ + ": " + verdict->text);
    out->warnings.push_back({frame, "frame " + std::to_string(frame) + ": " + verdict->text});
  }

  // Told once a failure: of the rig, or of what is seen.
  static void look_for_reason(const StereoImages& images, const StereoFrameResult& result, SlamResult* out) {
    const StereoVerdict verdict = check_stereo_pair(images.left, images.right);
    const std::string& why = verdict.text.empty() ? result.reason : verdict.text;
    out->warnings.push_back({result.frame, "frame " + std::to_string(result.frame) + ": the motion was lost: " + why});
  }

  StereoRectifier rectifier_;
  StereoOdometry odometry_;
  StereoWatch watch_;
  bool failing_ = false;
  KnownPoses known_;
  std::string name_;
  SlamObserver observer_;
};

void collect_warnings(StereoSource* source, SlamResult* out) {
  for (SourceWarning& warning : source->take_warnings()) out->warnings.push_back(std::move(warning));
}

void run_lockstep(StereoSource* source, FrontEnd* front, StereoWindow* window, const SlamKeyframeObserver& keyframes,
                  SlamResult* out) {
  while (auto pair = source->next()) {
    ++out->frames_read;
    if (auto keyframe = front->process(*pair, out)) {
      front->take(window->add(*keyframe));
      if (keyframes && keyframes(*keyframe, *window)) window->finish();
    }
    collect_warnings(source, out);
  }
}

// Frames arrive at their time stamps; the tracker takes the newest, the window works beside it.
class RealtimeRun {
 public:
  RealtimeRun(StereoSource* source, FrontEnd* front, StereoWindow* window, const SlamKeyframeObserver& keyframes,
              double speed, SlamResult* out)
      : source_(source),
        front_(front),
        window_(window),
        keyframe_observer_(keyframes),
        speed_(speed),
        out_(out),
        arriving_(kArriving),
        keyframes_(kKeyframes) {}

  void run() {
    std::jthread smoothing([this] { guarded([this] { smooth(); }); });
    {
      std::jthread reading([this](const std::stop_token& stop) { guarded([&] { read(stop); }); });
      try {
        while (auto pair = arriving_.pop()) {
          take_updates();
          if (auto keyframe = front_->process(*pair, out_)) keyframes_.push(std::move(*keyframe));
        }
      } catch (...) {
        keep(std::current_exception());
        arriving_.close();
      }
    }
    keyframes_.close();
    smoothing.join();
    take_updates();
    collect_warnings(source_, out_);
    MutexLock lock(mutex_);
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  template <class Work>
  void guarded(const Work& work) {
    try {
      work();
    } catch (...) {
      keep(std::current_exception());
      arriving_.close();
      keyframes_.close();
    }
  }
  void keep(std::exception_ptr failure) {
    MutexLock lock(mutex_);
    if (!failure_) failure_ = std::move(failure);
  }

  void read(const std::stop_token& stop) {
    std::optional<Timestamp> first;
    const auto begin = SteadyClock::now();
    while (!stop.stop_requested()) {
      auto pair = source_->next();
      if (!pair) break;
      if (!first) first = pair->left.time;
      const auto due = begin + std::chrono::nanoseconds(static_cast<std::int64_t>(
                                   static_cast<double>((pair->left.time - *first).count()) / speed_));
      std::this_thread::sleep_until(due);
      ++out_->frames_read;
      if (arriving_.push_drop_oldest(std::move(*pair))) ++out_->frames_dropped;
    }
    arriving_.close();
  }

  void smooth() {
    while (auto keyframe = keyframes_.pop()) {
      StereoWindowUpdate update = window_->add(*keyframe);
      if (keyframe_observer_ && keyframe_observer_(*keyframe, *window_)) window_->finish();
      MutexLock lock(mutex_);
      updates_.push_back(std::move(update));
    }
  }

  void take_updates() {
    std::vector<StereoWindowUpdate> updates;
    {
      MutexLock lock(mutex_);
      updates.swap(updates_);
    }
    for (const StereoWindowUpdate& update : updates) front_->take(update);
  }

  StereoSource* source_;
  FrontEnd* front_;
  StereoWindow* window_;
  const SlamKeyframeObserver& keyframe_observer_;
  double speed_;
  SlamResult* out_;  // frames_read and frames_dropped: the reader's until it has ended
  BoundedQueue<StereoFrame> arriving_;
  BoundedQueue<StereoKeyframe> keyframes_;
  Mutex mutex_;
  std::vector<StereoWindowUpdate> updates_ PARALLAX_GUARDED_BY(mutex_);
  std::exception_ptr failure_ PARALLAX_GUARDED_BY(mutex_);
};

}  // namespace

Trajectory SlamResult::live_trajectory() const {
  Trajectory out;
  for (const SlamFrame& frame : frames)
    if (frame.has_pose()) out.push_back({frame.result.time, frame.world_from_camera() * rectified_from_left});
  return out;
}

Trajectory SlamResult::final_trajectory() const {
  Trajectory out;
  for (const SlamFrame& frame : frames) {
    const auto reference = static_cast<std::size_t>(frame.result.reference);
    if (!frame.has_pose() || reference >= keyframes.size()) continue;
    out.push_back({frame.result.time,
                   keyframes[reference].world_from_camera * frame.result.reference_from_camera * rectified_from_left});
  }
  return out;
}

Trajectory SlamResult::keyframe_trajectory() const {
  Trajectory out;
  for (const StereoSessionPose& pose : keyframes)
    out.push_back({pose.time, pose.world_from_camera * rectified_from_left});
  return out;
}

SlamResult run_slam(StereoSource* source, const StereoCalibration& calibration, const SlamOptions& options,
                    const SlamObserver& observer, const SlamKeyframeObserver& keyframes) {
  SlamResult out;
  const auto start = SteadyClock::now();
  FrontEnd front(calibration, options, source->description(), observer);
  StereoWindow window(front.rectifier().camera(), options.window);
  out.camera = front.rectifier().camera();
  out.rectified_from_left = front.rectifier().rectified_from_left();
  if (options.pace == Pace::lockstep)
    run_lockstep(source, &front, &window, keyframes, &out);
  else
    RealtimeRun(source, &front, &window, keyframes, options.speed, &out).run();
  collect_warnings(source, &out);
  window.finish();
  out.keyframes = window.poses();
  out.constraints = window.constraints();
  out.points = window.points();
  out.window_timings = window.timings();
  out.windows = window.windows();
  out.wall_seconds = milliseconds_since(start) * 1e-3;
  return out;
}

}  // namespace parallax
