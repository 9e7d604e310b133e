// What real things hide: a depth image of the frame for assets/shaders/occlusion.glsl. Kept apart from the depth buffer
// of the virtual things, so that lines, which nothing real hides, still go behind those. Internal to render/.
#pragma once

#include "render/draw_list.h"
#include "render/gl_objects.h"

namespace parallax {

class GlOcclusion {
 public:
  // Uploads the list's depth image for a picture of this size.
  void prepare(const DrawList& list, int width, int height);
  // For a program in use whose fragment shader begins with occlusion.glsl. Binds texture unit 2.
  void set_uniforms(const GlProgram& program) const;

 private:
  GlObject<GlKind::texture> depth_;
  int width_ = 0, height_ = 0;
  bool has_depth_ = false;
};

}  // namespace parallax
