// The one map that the tracking and the mapping thread share. The lock is held for the time of a copy; whoever
// computes, extracts first and commits afterwards. The mapper is the only structural writer. Every member is safe from
// any thread.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "core/mutex.h"
#include "core/time.h"
#include "map/map.h"
#include "map/tracking_snapshot.h"

namespace parallax {

// How long the lock was waited for and held, in milliseconds.
struct LockTimes {
  std::vector<float> wait_ms, hold_ms;
};

// A state of the map: `world_from_first` and `warps` as in TrackingSnapshot.
struct MapCopy {
  Map map;
  std::uint64_t map_version = 0, world_version = 0;
  SimilarityTransform world_from_first;
  WorldWarps warps;
  WorldState world() const { return {world_from_first, warps}; }
};

class SharedMap {
 public:
  SharedMap();

  // Scoped access: read(fn(const Map&)), write(fn(Map&)). The function must not keep references.
  template <class Function>
  auto read(Function&& function) const PARALLAX_EXCLUDES(mutex_) {
    const Timer timer(this);
    MutexLock lock(mutex_);
    timer.locked();
    return std::forward<Function>(function)(static_cast<const Map&>(map_));
  }
  template <class Function>
  auto write(Function&& function) PARALLAX_EXCLUDES(mutex_) {
    const Timer timer(this);
    MutexLock lock(mutex_);
    timer.locked();
    return std::forward<Function>(function)(map_);
  }

  // What the tracker sees: a pointer taken under a lock of its own. Never null.
  std::shared_ptr<const TrackingSnapshot> snapshot() const PARALLAX_EXCLUDES(snapshot_mutex_);

  // The whole map with the versions of its world, one consistent state; images are shared. The lock is held for the
  // copy: a millisecond or two for 10,000 points.
  MapCopy copy() const PARALLAX_EXCLUDES(mutex_, snapshot_mutex_);

  // Builds a snapshot of the map as it is and makes it the tracker's (mapper only).
  void publish() PARALLAX_EXCLUDES(mutex_, snapshot_mutex_);

  // Called at every publication on the thread that publishes; set before there are two threads (a replay keeps every
  // version until it has been used).
  void set_publication_listener(std::function<void(std::shared_ptr<const TrackingSnapshot>)> listener) {
    listener_ = std::move(listener);
  }

  // Moves the world (Map::transform_world); the next publication carries the transform (mapper only).
  void move_world(const SimilarityTransform& new_from_old) PARALLAX_EXCLUDES(mutex_, snapshot_mutex_);
  // The same map, corrected: every place moved as the warp says. The lock is held for an exchange; the next publication
  // carries the warp (mapper only, and nothing was written since the map was copied to be corrected).
  void warp_world(Map corrected, std::shared_ptr<const WorldWarp> warp) PARALLAX_EXCLUDES(mutex_, snapshot_mutex_);
  // Another map, which may be empty: nothing that referred to the old one is valid (mapper only).
  void replace_map(Map map) PARALLAX_EXCLUDES(mutex_, snapshot_mutex_);

  // Waits and holds of the map's lock since the start (the newest 20,000 at least), and waits for the
  // snapshot pointer alone.
  LockTimes lock_times() const PARALLAX_EXCLUDES(times_mutex_);
  std::vector<float> snapshot_waits_ms() const PARALLAX_EXCLUDES(times_mutex_);

 private:
  class Timer {
   public:
    explicit Timer(const SharedMap* map) : map_(map), start_(SteadyClock::now()), locked_(start_) {}
    ~Timer();
    void locked() const { locked_ = SteadyClock::now(); }
    Timer(const Timer&) = delete;
    Timer& operator=(const Timer&) = delete;

   private:
    const SharedMap* map_;
    SteadyClock::time_point start_;
    mutable SteadyClock::time_point locked_;
  };

  mutable Mutex mutex_;
  Map map_ PARALLAX_GUARDED_BY(mutex_);

  mutable Mutex snapshot_mutex_;
  std::shared_ptr<const TrackingSnapshot> snapshot_ PARALLAX_GUARDED_BY(snapshot_mutex_);
  std::uint64_t world_version_ PARALLAX_GUARDED_BY(snapshot_mutex_) = 0;
  std::uint64_t map_version_ PARALLAX_GUARDED_BY(snapshot_mutex_) = 0;
  SimilarityTransform world_from_first_ PARALLAX_GUARDED_BY(snapshot_mutex_);
  WorldWarps warps_ PARALLAX_GUARDED_BY(snapshot_mutex_);

  std::function<void(std::shared_ptr<const TrackingSnapshot>)> listener_;

  mutable Mutex times_mutex_;
  mutable LockTimes times_ PARALLAX_GUARDED_BY(times_mutex_);
  mutable std::vector<float> snapshot_waits_ms_ PARALLAX_GUARDED_BY(times_mutex_);
};

}  // namespace parallax
