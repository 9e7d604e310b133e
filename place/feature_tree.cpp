#include "place/feature_tree.h"

#include <limits>

#include "core/check.h"

namespace parallax {

FeatureTree minimum_spanning_tree(std::span<const std::int32_t> features, std::span<const Eigen::Vector3f> positions) {
  PARALLAX_CHECK(features.size() == positions.size(), "a position a feature");
  FeatureTree tree;
  const std::size_t n = features.size();
  if (n == 0) return tree;
  tree.feature.reserve(n);
  tree.parent.reserve(n);
  // Of those outside: how far from the tree, and from which vertex of it.
  struct Outside {
    Eigen::Vector3f at;
    float distance2 = std::numeric_limits<float>::infinity();
    std::int32_t feature = 0, nearest = -1;
  };
  std::vector<Outside> outside(n);
  for (std::size_t i = 0; i < n; ++i) outside[i].at = positions[i], outside[i].feature = features[i];
  std::size_t next = 0;
  while (!outside.empty()) {
    const Outside taken = outside[next];
    outside.erase(outside.begin() + static_cast<std::ptrdiff_t>(next));  // keeps the order of the rest
    const auto vertex = static_cast<std::int32_t>(tree.feature.size());
    tree.feature.push_back(taken.feature);
    tree.parent.push_back(taken.nearest);
    next = 0;
    for (std::size_t i = 0; i < outside.size(); ++i) {
      const float distance2 = (outside[i].at - taken.at).squaredNorm();
      if (distance2 < outside[i].distance2) outside[i].distance2 = distance2, outside[i].nearest = vertex;
      if (outside[i].distance2 < outside[next].distance2) next = i;
    }
  }
  return tree;
}

}  // namespace parallax
