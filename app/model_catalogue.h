// The shapes a user can place, by name. Each is about 1 m in its longest side, stands on z = 0 and is centred on the
// z axis; made once and shared.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "render/draw_list.h"

namespace parallax {

// "cube", "ball", ...: in the order they are offered.
const std::vector<std::string>& model_names();

// Null for a name that is not in the catalogue. Safe from any thread.
std::shared_ptr<const Mesh> model_mesh(const std::string& name);

}  // namespace parallax
