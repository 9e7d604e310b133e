// Contact shadows: how much of the sky a thing hides from each place of the plane below it. The thing is looked at from
// above and taken to be solid between its lowest and its highest surface. A patch at height h hides
// h^2 / (pi (r^2 + h^2)^2) of an evenly bright sky from a place r away (the form factor of two parallel patches), so
// what touches the plane darkens it sharply and what is high above it softly. The thing is cut into slices, and the
// slice that hides most counts: for a wall, seen from its foot that is the lowest, and from afar the highest.
#pragma once

#include <opencv2/core/mat.hpp>

#include "render/draw_list.h"

namespace parallax {

struct ContactShadow {
  cv::Mat1b hidden;  // share of the sky, 255 is all; row 0 is the lowest y; fades to 0 at the border. Empty: no shadow
  Eigen::Vector2f low = Eigen::Vector2f::Zero(), high = Eigen::Vector2f::Zero();  // the rectangle it covers, metres
};

// `above_from_model`: a frame whose z = 0 is the plane, z up. What is below the plane is left out.
ContactShadow contact_shadow(const Mesh& mesh, const Eigen::Affine3f& above_from_model, int size = 96);

// A frame on the plane that follows an instance as it moves and turns on the plane: in it the shadow does not change.
// Returns plane_from_frame.
Eigen::Affine3f frame_below(const Eigen::Affine3f& plane_from_model);

}  // namespace parallax
