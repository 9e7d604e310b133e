// The part of the real table that a game is played on. Plane frame: z up, the table is z = 0, metres of the map (whose
// scale may be a guess: games size everything by `radius_m`).
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "core/se3.h"
#include "map/scene_surface.h"

namespace parallax {

struct PlayingField {
  RigidTransform world_from_plane;
  double radius_m = 0.2;  // of the circle about the origin in which there is something to play on
  // The mapped part of the plane: convex, counter-clockwise seen from above, at least three corners.
  std::vector<Eigen::Vector2d> outline_m;
  // What stands on it; may be null: nothing is known.
  std::shared_ptr<const SceneSurface> surface;
  // Another number: another field (a new map, another plane).
  int number = 0;
  // One metre of when the field began is so many now. A field that grows has a greater radius and keeps its scale; one
  // that is scaled has both multiplied.
  double scale = 1;
};

// One field takes the place of another: what lengths that were kept are multiplied with. On the same field the change
// of scale, so that things stay where they are on the table; on another one they keep their part of the radius.
double length_factor(const PlayingField& from, const PlayingField& to);

// Whether a place lies within the outline. A field without one has no inside.
bool inside_outline(const PlayingField& field, const Eigen::Vector2d& position_m);
// The place on the outline nearest to a position; the position itself when the field has no outline.
Eigen::Vector2d nearest_on_outline(const PlayingField& field, const Eigen::Vector2d& position_m);
// Where a ray of the plane's frame meets z = 0 in front of its start; false when it does not.
bool meets_plane(const Eigen::Vector3d& start, const Eigen::Vector3d& direction, Eigen::Vector2d* position_m);
// A square field without anything on it, for tests and before anything is mapped.
PlayingField empty_field(double radius_m);

}  // namespace parallax
