#include "map/shared_map.h"

#include "map/append_bounded.h"

namespace parallax {
namespace {
constexpr std::size_t kSamplesKept = 20000;
}

SharedMap::SharedMap() : snapshot_(std::make_shared<TrackingSnapshot>()) {}

SharedMap::Timer::~Timer() {
  using Milliseconds = std::chrono::duration<float, std::milli>;
  const auto end = SteadyClock::now();
  MutexLock lock(map_->times_mutex_);
  append_bounded(Milliseconds(locked_ - start_).count(), kSamplesKept, &map_->times_.wait_ms);
  append_bounded(Milliseconds(end - locked_).count(), kSamplesKept, &map_->times_.hold_ms);
}

std::shared_ptr<const TrackingSnapshot> SharedMap::snapshot() const {
  const auto start = SteadyClock::now();
  std::shared_ptr<const TrackingSnapshot> out;
  {
    MutexLock lock(snapshot_mutex_);
    out = snapshot_;
  }
  const auto wait = std::chrono::duration<float, std::milli>(SteadyClock::now() - start).count();
  MutexLock lock(times_mutex_);
  append_bounded(wait, kSamplesKept, &snapshot_waits_ms_);
  return out;
}

void SharedMap::publish() {
  // The mapper is the only structural writer and the only publisher, so the map does not change between the two locks.
  const auto made = read([](const Map& map) { return make_snapshot(map); });
  auto numbered = std::const_pointer_cast<TrackingSnapshot>(made);
  MutexLock lock(snapshot_mutex_);
  numbered->version = snapshot_->version + 1;
  numbered->world_version = world_version_;
  numbered->map_version = map_version_;
  numbered->world_from_first = world_from_first_;
  numbered->warps = warps_;
  snapshot_ = made;
  lock.unlock();
  if (listener_) listener_(made);
}

MapCopy SharedMap::copy() const {
  return read([this](const Map& map) {
    MapCopy out;
    out.map = map;
    MutexLock lock(snapshot_mutex_);
    out.map_version = map_version_;
    out.world_version = world_version_;
    out.world_from_first = world_from_first_;
    out.warps = warps_;
    return out;
  });
}

void SharedMap::move_world(const SimilarityTransform& new_from_old) {
  // Both under the map's lock: no copy has the one without the other.
  write([&](Map& map) {
    map.transform_world(new_from_old);
    MutexLock lock(snapshot_mutex_);
    ++world_version_;
    world_from_first_ = new_from_old * world_from_first_;
  });
}

void SharedMap::warp_world(Map corrected, std::shared_ptr<const WorldWarp> warp) {
  write([&](Map& map) {
    std::swap(map, corrected);
    MutexLock lock(snapshot_mutex_);
    ++world_version_;
    warps_.push_back(std::move(warp));
  });
}

void SharedMap::replace_map(Map map) {
  write([&](Map& shared) {
    std::swap(shared, map);
    MutexLock lock(snapshot_mutex_);
    ++map_version_;
    world_from_first_ = SimilarityTransform();
    warps_.clear();
  });
}

LockTimes SharedMap::lock_times() const {
  MutexLock lock(times_mutex_);
  return times_;
}

std::vector<float> SharedMap::snapshot_waits_ms() const {
  MutexLock lock(times_mutex_);
  return snapshot_waits_ms_;
}

}  // namespace parallax
