// What real things hide: their meshes drawn as depth alone into a texture of the picture's size, and a depth image of
// the frame, both for assets/shaders/occlusion.glsl. Kept apart from the depth buffer of the virtual things, so that
// lines, which nothing real hides, still go behind those. Internal to render/.
#pragma once

#include "render/draw_list.h"
#include "render/gl_lens.h"
#include "render/gl_mesh_cache.h"
#include "render/gl_objects.h"

namespace parallax {

class GlOcclusion {
 public:
  GlOcclusion();

  // Draws the list's occluders for a picture of this size, and uploads its depth image. Leaves another framebuffer
  // bound.
  void prepare(const DrawList& list, const GlLens& lens, int width, int height, GlMeshCache* meshes);
  // For a program in use whose fragment shader begins with occlusion.glsl. Binds texture units 2 and 3.
  void set_uniforms(const GlProgram& program) const;

 private:
  bool draw_occluders(const DrawList& list, const GlLens& lens, GlMeshCache* meshes);
  bool upload_depth(const cv::Mat1f& depth);

  GlProgram program_;
  GlFramebuffer framebuffer_;
  GlObject<GlKind::texture> occluder_depth_, occlusion_depth_;
  int width_ = 0, height_ = 0, allocated_width_ = 0, allocated_height_ = 0;
  bool has_occluders_ = false, has_depth_ = false;
};

}  // namespace parallax
