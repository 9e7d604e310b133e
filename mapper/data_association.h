// Data association refinement (PTAM §6.4), lowest priority: new points are looked for in old keyframes, and
// measurements that an adjustment threw out get their second chance with a far tighter search.
#pragma once

#include <deque>
#include <set>
#include <stop_token>
#include <utility>
#include <vector>

#include "map/shared_map.h"
#include "mapper/mapper_options.h"

namespace parallax {

// Not thread-safe; belongs to the mapping thread.
class DataAssociation {
 public:
  DataAssociation(const CameraModel& camera, const MapperOptions& options) : camera_(camera), options_(options) {}

  // Another map: nothing that was noted holds.
  void clear() {
    second_chances_.clear();
    given_.clear();
  }
  // Measurements that were taken out of the map. Each pair is tried once only.
  void add_outliers(const std::vector<std::pair<KeyframeId, PointId>>& outliers);

  // Works on at most `max_points` points; stops early when asked. Returns the number of measurements added; `idle` is
  // set when nothing is left to look at.
  int refine(SharedMap* map, int max_points, std::stop_token stop, bool* idle);

 private:
  int refine_new_points(SharedMap* map, int max_points, std::stop_token stop, bool* idle);
  int give_second_chances(SharedMap* map, std::stop_token stop);

  CameraModel camera_;
  MapperOptions options_;
  std::deque<std::pair<KeyframeId, PointId>> second_chances_;  // waiting
  std::set<std::pair<KeyframeId, PointId>> given_;             // ever since the map was made
};

}  // namespace parallax
