// Coloured points with their uncertainty, as maps are shown and written. Plain values.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>

namespace parallax {

struct ColouredPoint {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  // world, metres
  std::array<std::uint8_t, 3> rgb{};
  float sigma_m = 0;  // standard deviation along the ray it was seen on
};

// Turns the world upright for `up` (unit length, world): x to the right and y away on a plan, z up. x is the world's
// own x as far as the plan shows it (its z when x points up). A world that already has z up stays as it is; of one that
// began as a camera's (y down), z is what is away.
inline Eigen::Matrix3d upright_from_world(const Eigen::Vector3d& up) {
  Eigen::Vector3d right = Eigen::Vector3d::UnitX() - up.x() * up;
  if (right.norm() < 0.1) right = Eigen::Vector3d::UnitZ() - up.z() * up;
  right.normalize();
  Eigen::Matrix3d upright;
  upright.row(0) = right.transpose();
  upright.row(1) = up.cross(right).transpose();
  upright.row(2) = up.transpose();
  return upright;
}

}  // namespace parallax
