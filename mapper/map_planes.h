// The planes of a map: the dominant one (PTAM §6.1), found anew or picked by the user, and further ones.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <random>

#include "map/messages.h"
#include "map/shared_map.h"
#include "mapper/mapper_options.h"

namespace parallax {

// The dominant plane of all points, z towards the first keyframe; nothing when there is none.
std::optional<DominantPlane> dominant_plane_of(const Map& map, const PlaneOptions& options, std::mt19937_64* rng);

// Makes it the map's dominant plane, in the place of the one before. `world_from_plane`: where it lies in the world
// that the points are in now; its extent follows from its points. `plane.inlier` goes by the map's points in order.
void set_dominant_plane(Map* map, const DominantPlane& plane, const RigidTransform& world_from_plane);

// Whether the points are known well enough for plane_options_of() to be narrower than at the start.
bool is_mature(const Map& map);
// For the map as it is: from the first two views a point's height is known to a few percent of its distance; after a
// few keyframes the table, and what lies flat on it, are told apart.
PlaneOptions plane_options_of(const Map& map, const MapperOptions& options);

// Fits the dominant plane to the points as they are known now: it keeps its origin and axes as far as it can, so that
// what is drawn on it settles and does not turn. False when there is none; the caller publishes.
bool refine_dominant_plane(SharedMap* map, const MapperOptions& options, std::mt19937_64* rng);

// Looks for the dominant plane again. Refused without a map or a plane; the map is unchanged then. The caller
// publishes; solved outside the lock.
MapEditReply detect_plane(SharedMap* map, const MapperOptions& options, std::mt19937_64* rng);

// The plane of the points around the seed (world), centred on it: added, and made the dominant one. One that is there
// already is renewed instead. The caller publishes.
MapEditReply add_plane(SharedMap* map, const MapperOptions& options, const Eigen::Vector3d& seed, std::mt19937_64* rng);

}  // namespace parallax
