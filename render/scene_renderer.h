// Draws a DrawList with OpenGL 3.3: the camera's image, and over it the virtual content with the lens's own distortion
// (every vertex goes through CamProj, PTAM Eq. 2-4, in the shader; long edges are cut into short ones first), linear
// light, anti-aliased. The same code in a window and off-screen.
//
// Belongs to the thread whose OpenGL context was current when it was made.
#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>

#include "render/draw_list.h"

struct ImDrawData;

namespace parallax {

// Where on the current framebuffer the image goes, in framebuffer pixels from the bottom left.
struct Viewport {
  int x = 0, y = 0, width = 0, height = 0;
};

// The largest viewport of the image's shape within a framebuffer, centred.
Viewport fit_viewport(int image_width, int image_height, int framebuffer_width, int framebuffer_height);

struct SceneRendererOptions {
  int samples = 4;  // multi-sampling; what the driver cannot do is lowered
};

class SceneRenderer {
 public:
  // Throws RunError when a shader does not compile or a framebuffer cannot be made.
  explicit SceneRenderer(const SceneRendererOptions& options = {});
  ~SceneRenderer();
  SceneRenderer(const SceneRenderer&) = delete;
  SceneRenderer& operator=(const SceneRenderer&) = delete;

  // Draws into the viewport of the framebuffer that is bound (0: window or OSMesa's own). What is outside the viewport
  // is left alone.
  void draw(const DrawList& list, const Viewport& viewport);

  // Draws Dear ImGui's output over the whole framebuffer. Its textures are made on demand from the current ImGui
  // context's font atlas.
  void draw_interface(const ImDrawData& data, int framebuffer_width, int framebuffer_height);

  // A picture as an ImTextureID for ImGui::Image (keyframe pictures); updated in place when called again with the same
  // key. CV_8UC1 or CV_8UC3 BGR.
  void* picture(int key, const cv::Mat& image);

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

// The current framebuffer's colours as BGR, top row first.
cv::Mat3b read_framebuffer(int width, int height);

}  // namespace parallax
