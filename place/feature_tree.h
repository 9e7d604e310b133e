// The minimum spanning tree of a scene's features (MS §4.1): which features depend on each other when two scenes are
// matched.
//
// Plain values and functions, safe from any thread.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace parallax {

// Vertices in the order in which the tree grew: a parent always comes before its children.
struct FeatureTree {
  std::vector<std::int32_t> feature;  // row of the scene's features
  std::vector<std::int32_t> parent;   // vertex; -1 for the first

  int size() const { return static_cast<int>(feature.size()); }
};

// By Prim's algorithm (1957), dense: O(n^2) time, O(n) memory. `positions` are those of `features`, in any unit (image
// metric: z = 0). Of equally long edges the one to the earlier feature is taken, so that the same input gives the same
// tree. Positions are finite.
FeatureTree minimum_spanning_tree(std::span<const std::int32_t> features, std::span<const Eigen::Vector3f> positions);

}  // namespace parallax
