// One model from the bytes of a binary glTF 2.0 file (.glb). The file's own frame is glTF's (y up, looking along +z);
// what comes out is in the model frame of render/model_set.h (z up, +x forward).
//
// Read: scenes, nodes, triangles with positions, normals (flat ones are made where there are none), texture
// coordinates, vertex colours, base colours and one PNG picture a primitive. Left aside: animations, skins, cameras,
// lights and the other properties of materials. Everything has to be in the file itself.
//
// Safe from any thread.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "render/model_set.h"

namespace parallax {

// `file` is what messages call it. Throws InputError: "FILE: found X, expected Y", one line.
Model read_model(std::span<const std::uint8_t> bytes, const std::string& file);

}  // namespace parallax
