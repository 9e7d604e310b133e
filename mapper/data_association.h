// Data association refinement (PTAM §6.4), lowest priority: new points are looked for in old keyframes, and
// measurements that an adjustment threw out get their second chance with a far tighter search.
#pragma once

#include <deque>
#include <set>
#include <utility>
#include <vector>

#include "core/interruption.h"
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
  int refine(SharedMap* map, int max_points, const Interruption& stop, bool* idle);

 private:
  int refine_new_points(SharedMap* map, int max_points, const Interruption& stop, bool* idle);
  void forget_absent(const SharedMap& map);
  int give_second_chances(SharedMap* map, const Interruption& stop);

  CameraModel camera_;
  MapperOptions options_;
  std::deque<std::pair<KeyframeId, PointId>> second_chances_;  // waiting
  std::set<std::pair<KeyframeId, PointId>> given_;             // ever, while keyframe and point are there
  std::size_t forget_above_ = 10000;                           // pairs: those of what is gone are forgotten
};

}  // namespace parallax
