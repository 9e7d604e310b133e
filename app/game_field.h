// The playing field of a map: the mapped part of its dominant plane, followed as the map grows and its world is scaled
// or moved.
//
// A value; one thread at a time.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "games/playing_field.h"
#include "map/tracking_snapshot.h"

namespace parallax {

class GameField {
 public:
  // Looks at the map when it has changed. True when the field has become another one: begun, grown, moved or scaled.
  bool update(const TrackingSnapshot& map);
  // Nothing without a plane with enough points on it.
  const std::optional<PlayingField>& field() const { return field_; }
  // What stands on the plane, as it is known now.
  void set_surface(const std::shared_ptr<const SceneSurface>& surface);

 private:
  void begin(const TrackingSnapshot& map, const Plane& plane, const std::vector<Eigen::Vector2d>& outline);

  std::optional<PlayingField> field_;
  RigidTransform plane_from_field_;  // fixed for as long as the plane is the same one
  RigidTransform world_from_plane_;  // the plane as it was followed last
  SimilarityTransform world_from_first_;
  std::uint64_t map_version_ = 0, version_ = 0;
  std::size_t keyframes_ = 0;
  int begun_ = 0;  // fields so far
};

// The hull of what lies on a plane, in the plane's frame, counter-clockwise: without the few points far from all
// others. Empty when there are too few.
std::vector<Eigen::Vector2d> mapped_outline(const TrackingSnapshot& map, const RigidTransform& world_from_plane);

}  // namespace parallax
