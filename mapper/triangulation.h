// Points from two rays. triangulate() itself is declared in mapper/two_view.h.
#pragma once

#include <Eigen/Core>

#include "core/se3.h"

namespace parallax {

// The angle between two rays that see the same point, in radians: R ray1 against ray2.
double parallax_angle(const RigidTransform& second_from_first, const Eigen::Vector3d& ray1,
                      const Eigen::Vector3d& ray2);

// Depths (third coordinates) at which the rays (x, y, 1) come closest, for cheirality tests: signed, and without
// regard to how far the rays miss each other. False when they are parallel.
bool ray_depths(const RigidTransform& second_from_first, const Eigen::Vector3d& ray1, const Eigen::Vector3d& ray2,
                double* depth1, double* depth2);

}  // namespace parallax
