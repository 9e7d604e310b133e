// Meshes made of others, and coarser ones: what is drawn in hundreds is one mesh each, as fine as its size on the
// screen asks for.
//
// Plain functions on values.
#pragma once

#include <memory>
#include <vector>

#include "render/draw_list.h"
#include "render/model_set.h"

namespace parallax {

// All parts of a model as one mesh in the model's frame, moved as draw_model() would. Null when a part has a texture,
// which one mesh cannot keep apart.
std::shared_ptr<const Mesh> merged_model(const Model& model, const std::vector<PartMotion>& part_motion);

// All vertices in one cell of a grid, `cell` wide, go to their middle, where those that face the same way (by octants)
// and have about the same colour become one; triangles that lose a corner that way are gone (Rossignac and Borrel
// 1993). A vertex moves less than the cell's diagonal. For meshes without a texture.
Mesh clustered_mesh(const Mesh& mesh, float cell);

}  // namespace parallax
