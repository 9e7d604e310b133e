// How the world of a map moves, when it does not move as one: a closed loop moves every keyframe by a similarity
// transform of its own, and what hangs on the map follows the keyframe that saw it.
//
// Everything is kept in the first world of a map, which never moves: the world is world_from_first times the warps so
// far, in order. Immutable once made, then safe from any thread. Metres of the first world.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "core/se3.h"
#include "map/identifiers.h"

namespace parallax {

// A keyframe as it was before, and what became of its surroundings.
struct WarpNode {
  KeyframeId keyframe;
  RigidTransform camera_from_first;
  double mean_depth = 1;  // of what it sees
  SimilarityTransform new_from_old;
};

class WorldWarp {
 public:
  // Nodes in order of age; at least one.
  explicit WorldWarp(std::vector<WarpNode> nodes);

  // What a place is moved by. `seen_from`: the keyframe that sees it, or the one next in age that is among the nodes;
  // not valid: the keyframe whose view has the place nearest its middle, at about the distance it sees things at.
  const SimilarityTransform& at(const Eigen::Vector3d& in_first, KeyframeId seen_from = {}) const;

  const std::vector<WarpNode>& nodes() const { return nodes_; }

 private:
  std::vector<WarpNode> nodes_;
};

using WorldWarps = std::vector<std::shared_ptr<const WorldWarp>>;

// Which world it was, noted to come back to it later.
struct WorldStamp {
  SimilarityTransform world_from_first;
  std::size_t warps = 0;
};

struct WorldState {
  SimilarityTransform world_from_first;
  WorldWarps warps;

  // Takes what was at `position` in an earlier world of the same map to where it is now. Exactly the identity while
  // nothing has moved.
  SimilarityTransform now_from(const WorldStamp& then, const Eigen::Vector3d& position,
                               KeyframeId seen_from = {}) const;
  // Takes a camera of an earlier world to where it would be now.
  RigidTransform rebase(const WorldStamp& then, const RigidTransform& camera_from_then, KeyframeId seen_from) const {
    return now_from(then, camera_from_then.inverse().t, seen_from).rebase(camera_from_then);
  }
};

// A node of a warp from a keyframe of a world that stands as `world_from_first`.
WarpNode warp_node(KeyframeId keyframe, const RigidTransform& camera_from_world, double mean_depth,
                   const SimilarityTransform& new_from_old, const SimilarityTransform& world_from_first);

}  // namespace parallax
