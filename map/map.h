// The map (PTAM §4): owns every entity by value. Not thread-safe by itself; SharedMap adds the lock.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "map/entities.h"
#include "map/id_table.h"

namespace parallax {

class Map {
 public:
  IdTable<KeyframeId, Keyframe> keyframes;
  IdTable<PointId, MapPoint> points;
  std::optional<Plane> plane;  // the dominant one
  std::vector<Plane> planes;   // all of them, the dominant one included, in order of finding

  bool empty() const { return keyframes.empty(); }
  void clear();

  // Adds or replaces the measurement of a point in a keyframe, and keeps both sides' lists in step.
  void add_measurement(KeyframeId keyframe, const Measurement& measurement);
  // Removes it; false when there was none.
  bool remove_measurement(KeyframeId keyframe, PointId point);
  // Notes that the point cannot be measured in the keyframe.
  void mark_failed(KeyframeId keyframe, PointId point);

  // Removes the entity and all measurements that refer to it. A point whose source keyframe goes is given another
  // source by the caller beforehand, or removed.
  void erase_point(PointId point);
  void erase_keyframe(KeyframeId keyframe);

  // Points become `keep`'s: measurements of `drop` in keyframes that do not measure `keep` move over; `drop` is erased.
  void merge_points(PointId keep, PointId drop);

  // Moves the world: p_new = new_from_old * p_old. Poses, points, normals and planes follow; images do not change.
  void transform_world(const SimilarityTransform& new_from_old);

  // Mean and standard deviation of the depths of its measured points; unchanged when it measures none.
  void update_depth(Keyframe* keyframe) const;
};

// Every invariant of the map, checked: lists in step on both sides and sorted, no dangling identifiers, finite values,
// proper rotations, unit normals, sources present and inside their images, points in front of their source. Returns
// what is wrong, a line each (at most 20).
std::vector<std::string> check_consistency(const Map& map, const CameraModel& camera);

}  // namespace parallax
