#include "map/world_warp.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/check.h"

namespace parallax {

WorldWarp::WorldWarp(std::vector<WarpNode> nodes) : nodes_(std::move(nodes)) {
  PARALLAX_CHECK(!nodes_.empty(), "a warp has nodes");
  for (std::size_t i = 1; i < nodes_.size(); ++i)
    PARALLAX_CHECK(nodes_[i - 1].keyframe < nodes_[i].keyframe, "the nodes of a warp are in order of age");
}

const SimilarityTransform& WorldWarp::at(const Eigen::Vector3d& in_first, KeyframeId seen_from) const {
  if (seen_from.valid()) {
    const auto after = std::upper_bound(nodes_.begin(), nodes_.end(), seen_from,
                                        [](KeyframeId id, const WarpNode& node) { return id < node.keyframe; });
    return (after == nodes_.begin() ? after : after - 1)->new_from_old;
  }
  const WarpNode *best = nullptr, *nearest = nullptr;
  double best_cost = INFINITY, nearest_distance = INFINITY;
  for (const WarpNode& node : nodes_) {
    const Eigen::Vector3d p = node.camera_from_first * in_first;
    if (p.norm() < nearest_distance) {
      nearest_distance = p.norm();
      nearest = &node;
    }
    if (!(p.z() > 0)) continue;
    const double cost = p.head<2>().norm() / p.z() + std::abs(std::log(p.z() / node.mean_depth));
    if (cost < best_cost) {
      best_cost = cost;
      best = &node;
    }
  }
  PARALLAX_CHECK(nearest != nullptr, "a place is somewhere");
  return (best ? best : nearest)->new_from_old;
}

SimilarityTransform WorldState::now_from(const WorldStamp& then, const Eigen::Vector3d& position,
                                         KeyframeId seen_from) const {
  const SimilarityTransform &f = then.world_from_first, &g = world_from_first;
  // Nothing has moved: exactly nothing.
  if (then.warps >= warps.size() && f.s == g.s && f.t == g.t && f.R == g.R) return {};
  SimilarityTransform first_from_then = f.inverse();
  for (std::size_t i = then.warps; i < warps.size(); ++i)
    first_from_then = warps[i]->at(first_from_then * position, seen_from) * first_from_then;
  return world_from_first * first_from_then;
}

WarpNode warp_node(KeyframeId keyframe, const RigidTransform& camera_from_world, double mean_depth,
                   const SimilarityTransform& new_from_old, const SimilarityTransform& world_from_first) {
  const SimilarityTransform first_from_world = world_from_first.inverse();
  return {keyframe, first_from_world.rebase(camera_from_world), mean_depth * first_from_world.s,
          first_from_world * new_from_old * world_from_first};
}

}  // namespace parallax
