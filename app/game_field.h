// The playing field of a map: the mapped part of its dominant plane, followed as the map grows, is adjusted, and its
// world is scaled or moved.
//
// It is put down when the map has a few keyframes: before that its plane, and all heights, are still about to change.
// From then on it is held by the map's points on the table (anchors): when these are moved by an adjustment the field
// goes where they go, so that what was put on a spot of the real table stays on that spot, also where the plane's own
// frame does not.
//
// A value; one thread at a time.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "games/playing_field.h"
#include "map/tracking_snapshot.h"

namespace parallax {

class GameField {
 public:
  // Looks at the map when it has changed. True when the field has become another one: begun, grown, moved or scaled.
  // `anyway`: it is not to wait for more keyframes any longer.
  bool update(const TrackingSnapshot& map, bool anyway = false);
  // Nothing without a plane with enough points on it.
  const std::optional<PlayingField>& field() const { return field_; }
  // There is a table, but it is not known well enough yet.
  bool settling() const { return settling_; }
  // What stands on the plane, as it is known now.
  void set_surface(const std::shared_ptr<const SceneSurface>& surface);

 private:
  void begin(const TrackingSnapshot& map, const Plane& plane, const std::vector<Eigen::Vector2d>& outline);
  void rescale(double factor);
  bool follow_points(const TrackingSnapshot& map, const Plane& plane);
  void hold_by_points(const TrackingSnapshot& map);

  std::optional<PlayingField> field_;
  std::map<PointId, Eigen::Vector2d> anchors_;  // where points lie on the field, in its lengths of when it began
  bool settling_ = false;
  RigidTransform plane_from_field_;  // fixed for as long as the plane is the same one
  RigidTransform world_from_plane_;  // the plane as it was followed last
  WorldStamp world_;
  std::uint64_t map_version_ = 0, version_ = 0;
  std::size_t keyframes_ = 0;
  int begun_ = 0;  // fields so far
};

// The hull of what lies on a plane, in the plane's frame, counter-clockwise: of the largest patch without wide gaps (a
// worktop at the height of the table is not the table) where nothing is seen below (neither is a wall). Empty when
// there are too few.
std::vector<Eigen::Vector2d> mapped_outline(const TrackingSnapshot& map, const RigidTransform& world_from_plane);

}  // namespace parallax
