#include "games/playing_field.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace parallax {
namespace {

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

}  // namespace

double length_factor(const PlayingField& from, const PlayingField& to) {
  const double factor = from.number == to.number ? to.scale / from.scale : to.radius_m / from.radius_m;
  return std::isfinite(factor) && factor > 0 ? factor : 1.0;
}

bool inside_outline(const PlayingField& field, const Eigen::Vector2d& position_m) {
  const std::size_t corners = field.outline_m.size();
  if (corners < 3) return false;
  for (std::size_t i = 0; i < corners; ++i) {
    const Eigen::Vector2d& a = field.outline_m[i];
    const Eigen::Vector2d& b = field.outline_m[(i + 1) % corners];
    if (cross(b - a, position_m - a) < 0) return false;
  }
  return true;
}

Eigen::Vector2d nearest_on_outline(const PlayingField& field, const Eigen::Vector2d& position_m) {
  const std::size_t corners = field.outline_m.size();
  if (corners < 3) return position_m;
  Eigen::Vector2d best = position_m;
  double best_distance = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < corners; ++i) {
    const Eigen::Vector2d& a = field.outline_m[i];
    const Eigen::Vector2d side = field.outline_m[(i + 1) % corners] - a;
    const double length = side.squaredNorm();
    const double part = length > 0 ? std::clamp((position_m - a).dot(side) / length, 0.0, 1.0) : 0.0;
    const Eigen::Vector2d at = a + part * side;
    const double distance = (at - position_m).squaredNorm();
    if (distance < best_distance) {
      best_distance = distance;
      best = at;
    }
  }
  return best;
}

bool meets_plane(const Eigen::Vector3d& start, const Eigen::Vector3d& direction, Eigen::Vector2d* position_m) {
  const double along = -start.z() / direction.z();
  if (!std::isfinite(along) || !(along > 0)) return false;
  *position_m = (start + along * direction).head<2>();
  return true;
}

PlayingField empty_field(double radius_m) {
  PlayingField field;
  field.radius_m = radius_m;
  field.outline_m = {{-radius_m, -radius_m}, {radius_m, -radius_m}, {radius_m, radius_m}, {-radius_m, radius_m}};
  return field;
}

}  // namespace parallax
