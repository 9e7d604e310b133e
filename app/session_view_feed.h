// What the live view of running sessions shows, gathered from the threads of the run as a snapshot behind a mutex.
//
// The run's threads put, the window takes. A thread of its own asks the back end for its state a few times a second.
#pragma once

#include <array>
#include <condition_variable>
#include <map>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <thread>
#include <vector>

#include "app/session_view_scene.h"
#include "app/session_view_watcher.h"
#include "core/mutex.h"

namespace parallax {

inline constexpr int kSessionModules = 5;

// Of one module, so far.
struct ModuleLoad {
  std::size_t steps = 0;
  double mean_ms = 0, last_ms = 0, worst_ms = 0;
  void add(double ms);
};

// The way of a session that the back end's graph does not hold yet, and the camera at its end; global frame.
struct SceneTail {
  int session = 0;
  std::vector<Eigen::Vector3d> places;
  RigidTransform global_from_camera;
};

struct SessionViewSnapshot {
  SessionScene scene;
  std::vector<SceneTail> tails;
  std::array<ModuleLoad, kSessionModules> loads;
  int waiting = 0, refused = 0;  // encounters
};

// The newest left image of a session with the features that are tracked.
struct SessionImage {
  cv::Mat3b picture;
  std::string state;
  int frame = 0, tracks = 0;
};

class SessionFeed : public SlamWatcher {
 public:
  explicit SessionFeed(std::size_t sessions);
  ~SessionFeed() override;

  void frame(std::size_t k, const SlamFrame& frame, const StereoImages& images, const StereoOdometry& odometry) override
      PARALLAX_EXCLUDES(mutex_);
  void keyframe(const StereoKeyframe& keyframe, const StereoWindow& window, const SlamLinkPart& part) override
      PARALLAX_EXCLUDES(mutex_);
  void back_end(BackEndWorker* worker) override PARALLAX_EXCLUDES(mutex_);

  // Grows with everything that is new.
  std::uint64_t version() const PARALLAX_EXCLUDES(mutex_);
  // Never null.
  std::shared_ptr<const SessionViewSnapshot> snapshot() const PARALLAX_EXCLUDES(mutex_);
  // Of the sessions as planned; empty pictures before their first frames.
  std::vector<SessionImage> images() const PARALLAX_EXCLUDES(mutex_);
  // Waits at most so long for a version above this one.
  void wait_newer(std::uint64_t version, std::chrono::milliseconds most) PARALLAX_EXCLUDES(mutex_);
  // The run is over: wakes who waits.
  void wake() PARALLAX_EXCLUDES(mutex_);

  // What the back end is at this moment becomes the snapshot; called on the back end's thread.
  void take(const BackEnd& back_end) PARALLAX_EXCLUDES(mutex_);

 private:
  struct FrontEndPose {
    PoseKey key;
    RigidTransform session_from_camera;
  };
  void poll(const std::stop_token& stop, BackEndWorker* worker);

  mutable Mutex mutex_;
  mutable std::condition_variable_any changed_;
  std::uint64_t version_ PARALLAX_GUARDED_BY(mutex_) = 0;
  std::vector<SessionImage> images_ PARALLAX_GUARDED_BY(mutex_);
  std::shared_ptr<const SessionViewSnapshot> snapshot_ PARALLAX_GUARDED_BY(mutex_);
  std::array<ModuleLoad, kSessionModules> loads_ PARALLAX_GUARDED_BY(mutex_);
  std::map<PoseKey, std::vector<Eigen::Vector3f>> points_ PARALLAX_GUARDED_BY(mutex_);  // camera frame
  std::map<int, std::vector<FrontEndPose>> poses_ PARALLAX_GUARDED_BY(mutex_);          // as the front ends had them
  std::size_t timings_seen_ = 0;                                                        // the back end's thread
  std::jthread poller_;  // the thread that runs the sessions makes and ends it
};

}  // namespace parallax
