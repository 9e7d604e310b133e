// Keeps up what stands on the table (mapper/surface_reconstruction) on a thread of its own, at a small share of a
// processor, so that games and occlusion have it while tracking and mapping go on.
//
// Every public member is safe from any thread.
#pragma once

#include <condition_variable>
#include <memory>
#include <thread>

#include "core/camera_model.h"
#include "core/mutex.h"
#include "map/scene_surface.h"
#include "map/tracking_snapshot.h"

namespace parallax {

class SurfaceWorker {
 public:
  // Works for so many milliseconds of every `period_ms`.
  struct Share {
    double work_ms = 4, period_ms = 16;
  };
  explicit SurfaceWorker(const CameraModel& camera) : SurfaceWorker(camera, Share{}) {}
  SurfaceWorker(const CameraModel& camera, const Share& share);
  ~SurfaceWorker();  // within about a millisecond
  SurfaceWorker(const SurfaceWorker&) = delete;
  SurfaceWorker& operator=(const SurfaceWorker&) = delete;

  // The newest map; never waits.
  void update(std::shared_ptr<const TrackingSnapshot> map) PARALLAX_EXCLUDES(mutex_);
  // The newest surface; null before the first one.
  std::shared_ptr<const SceneSurface> surface() const PARALLAX_EXCLUDES(mutex_);

 private:
  void run(const std::stop_token& stop) PARALLAX_EXCLUDES(mutex_);

  CameraModel camera_;
  Share share_;
  mutable Mutex mutex_;
  std::condition_variable_any wake_;
  std::shared_ptr<const TrackingSnapshot> next_ PARALLAX_GUARDED_BY(mutex_);
  std::shared_ptr<const SceneSurface> surface_ PARALLAX_GUARDED_BY(mutex_);
  std::jthread thread_;  // last: ends before the rest goes
};

}  // namespace parallax
