#include "app/surface_worker.h"

#include <chrono>
#include <stop_token>
#include <utility>

#include "core/interruption.h"
#include "mapper/surface_reconstruction.h"

namespace parallax {

SurfaceWorker::SurfaceWorker(const CameraModel& camera, const Share& share)
    : camera_(camera), share_(share), thread_([this](const std::stop_token& stop) { run(stop); }) {}

SurfaceWorker::~SurfaceWorker() = default;

void SurfaceWorker::update(std::shared_ptr<const TrackingSnapshot> map) {
  {
    MutexLock lock(mutex_);
    next_ = std::move(map);
  }
  wake_.notify_one();
}

std::shared_ptr<const SceneSurface> SurfaceWorker::surface() const {
  MutexLock lock(mutex_);
  return surface_;
}

void SurfaceWorker::run(const std::stop_token& stop) {
  SurfaceReconstruction reconstruction(camera_);
  const Interruption interrupt(stop);
  const std::chrono::duration<double, std::milli> rest(share_.period_ms - share_.work_ms);
  bool more = false;
  while (!stop.stop_requested()) {
    std::shared_ptr<const TrackingSnapshot> next;
    {
      MutexLock lock(mutex_);
      const auto there = [this]() PARALLAX_REQUIRES(mutex_) { return next_ != nullptr; };
      if (more) {
        // The others' share of the time: nothing but the end is worth waking up for.
        wake_.wait_for(mutex_, stop, rest, [] { return false; });
      } else {
        wake_.wait(mutex_, stop, there);
      }
      next = std::exchange(next_, nullptr);
    }
    if (stop.stop_requested()) return;
    if (next) reconstruction.update(std::move(next));
    more = reconstruction.step(share_.work_ms, interrupt);
    auto made = reconstruction.surface();
    MutexLock lock(mutex_);
    surface_ = std::move(made);
  }
}

}  // namespace parallax
