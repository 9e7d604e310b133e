#include "app/way_heights.h"

#include <cmath>
#include <limits>

namespace parallax {

double WayHeights::at(const Eigen::Vector3d& place) {
  constexpr double kCellM = 1;
  const std::pair<long, long> cell(std::lround(place.x() / kCellM), std::lround(place.y() / kCellM));
  const auto [found, fresh] = cells_.try_emplace(cell, std::numeric_limits<double>::infinity());
  if (!fresh) return found->second;
  const Eigen::Vector2d middle(static_cast<double>(cell.first) * kCellM, static_cast<double>(cell.second) * kCellM);
  double nearest = std::numeric_limits<double>::max();
  for (const auto& way : ways_)
    for (const Eigen::Vector3d& p : way) {
      const double distance = (p.head<2>() - middle).squaredNorm();
      if (distance >= nearest) continue;
      nearest = distance;
      found->second = p.z();
    }
  return found->second;
}

}  // namespace parallax
