// How high the ways of a camera are over the plan, by cells of a metre: what is far above is a ceiling.
#pragma once

#include <Eigen/Core>
#include <map>
#include <utility>
#include <vector>

namespace parallax {

class WayHeights {
 public:
  // Upright map coordinates, metres, z up. The ways outlive this.
  explicit WayHeights(const std::vector<std::vector<Eigen::Vector3d>>& ways) : ways_(ways) {}

  // Of the place of a way that is nearest, on the plan, to the cell that `place` is in; infinite without ways.
  double at(const Eigen::Vector3d& place);

 private:
  const std::vector<std::vector<Eigen::Vector3d>>& ways_;
  std::map<std::pair<long, long>, double> cells_;
};

}  // namespace parallax
