// Cuts the triangles of a mesh until no edge is too long, so that a lens can bend them. Whether an edge is cut depends
// on the edge alone, so triangles that share one stay joined.
#pragma once

#include <functional>

#include "render/draw_list.h"

namespace parallax {

// The same surface with every edge cut for which too_long(a, b) holds (positions in the mesh's frame; must not depend
// on their order). Gives up at max_triangles, then leaving the rest as it is. Texture and sidedness are kept.
Mesh subdivide(const Mesh& mesh, const std::function<bool(const Eigen::Vector3f&, const Eigen::Vector3f&)>& too_long,
               std::size_t max_triangles = 400'000);

}  // namespace parallax
