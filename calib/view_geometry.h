// How a target lies in a view: the words and angles that calibration_session and its coverage share. Internal to
// calib/.
#pragma once

#include <Eigen/Core>
#include <string>

#include "calib/calibration_session.h"
#include "core/se3.h"

namespace parallax {

// "upper left", "middle", "right"... of a cell of the image.
std::string cell_in_words(int cell, int columns, int rows);

// The target's normal (pointing away from the camera) seen along the line of sight to its middle: x and y. Negative x:
// the left edge is nearer.
Eigen::Vector2d tilt_against_sight(const RigidTransform& camera_from_target, const Eigen::Vector3d& middle);
BoardTilt tilt_of(const Eigen::Vector2d& normal_xy, double limit_rad);

}  // namespace parallax
