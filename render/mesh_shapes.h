// Simple solids as meshes, for labels, games and the map view. Metres; colours are white, so that an instance's tint
// shows; normals point outwards. Throws nothing; sizes are taken as they are.
#pragma once

#include <Eigen/Core>
#include <memory>

#include "render/draw_list.h"

namespace parallax {

// Centred on the origin; the size along each axis.
std::shared_ptr<const Mesh> box_mesh(const Eigen::Vector3f& size);
// Centred on the origin.
std::shared_ptr<const Mesh> sphere_mesh(float radius, int segments = 32);
// Standing on z = 0 and growing along z.
std::shared_ptr<const Mesh> cylinder_mesh(float radius, float height, int segments = 32);
std::shared_ptr<const Mesh> cone_mesh(float radius, float height, int segments = 32);
// From the origin along z: a shaft and a head of 2.5 times its radius.
std::shared_ptr<const Mesh> arrow_mesh(float length, float shaft_radius, int segments = 24);
// Around z, centred on the origin: the ring's radius and the tube's.
std::shared_ptr<const Mesh> torus_mesh(float radius, float tube_radius, int segments = 48, int tube_segments = 16);
// Flat, on z = 0, centred on the origin, facing +z; uv (0, 0) at its lowest x and highest y, so that a texture stands
// upright for who looks down with y up.
std::shared_ptr<const Mesh> quad_mesh(float width, float height, const cv::Mat4b& texture = {}, bool two_sided = true);
// A disc on z = 0, facing +z.
std::shared_ptr<const Mesh> disc_mesh(float radius, int segments = 48);
// What a camera sees: apex at the origin, base at z = depth, two-sided; the base spans half_width, half_height.
std::shared_ptr<const Mesh> frustum_mesh(float half_width, float half_height, float depth);
// A standing pin: a cone with its point on z = 0 and a ball on top, `height` in all.
std::shared_ptr<const Mesh> pin_mesh(float height, int segments = 24);

// Three axes from the origin, red x, green y, blue z, as arrows.
std::shared_ptr<const Mesh> axes_mesh(float length);

// Puts `part`, moved and coloured, at the end of `whole` (its texture is not taken).
void append(const Mesh& part, const Eigen::Affine3f& whole_from_part, const DrawColour& colour, Mesh* whole);

}  // namespace parallax
