// Soft round spots that face the camera, sorted and drawn as squares through the lens. Internal to render/.
#pragma once

#include <vector>

#include "render/draw_list.h"
#include "render/gl_objects.h"

namespace parallax {

struct SpriteVertex {
  float position[3];  // camera frame
  float corner[2];
  float colour[4];  // linear
  float additive;
};

// Four corners a sprite, farthest sprite first; each stands across the line of sight to its middle. Sprites that are
// not finite, have no size or no alpha are left out.
std::vector<SpriteVertex> sprite_squares(const std::vector<Sprite>& sprites, const RigidTransform& camera_from_world);

class GlSprites {
 public:
  void draw(const std::vector<SpriteVertex>& squares);

 private:
  GlVertexArray array_;
  GlBuffer vertices_, indices_;
};

}  // namespace parallax
