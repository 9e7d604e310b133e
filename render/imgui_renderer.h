// Draws Dear ImGui's output with OpenGL 3.3, in a window or off-screen (the packaged back end brings a loader that
// knows only windows). Internal to render/; the way in is SceneRenderer::draw_interface().
#pragma once

#include <map>

#include "render/gl_objects.h"

struct ImDrawData;
struct ImFontAtlas;

namespace parallax {

class ImguiRenderer {
 public:
  ImguiRenderer();
  // Over the whole framebuffer that is bound.
  void draw(const ImDrawData& data, int framebuffer_width, int framebuffer_height);
  void* picture(int key, const cv::Mat& image);

 private:
  void update_fonts();

  GlProgram program_;
  GlVertexArray array_;
  GlBuffer vertices_, indices_;
  GlTexture fonts_;
  const ImFontAtlas* atlas_ = nullptr;  // what fonts_ was made of
  const void* atlas_pixels_ = nullptr;
  std::map<int, GlTexture> pictures_;
};

}  // namespace parallax
