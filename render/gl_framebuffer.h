// Where virtual content is drawn before it is put over the camera's image: linear light, half floats, alpha
// premultiplied, several samples a pixel for meshes. Internal to render/.
#pragma once

#include "render/gl_objects.h"

namespace parallax {

class GlContentFramebuffer {
 public:
  // What the driver cannot do of the samples is lowered.
  explicit GlContentFramebuffer(int samples);

  // Binds it, cleared to nothing, with its viewport and blending set. Throws RunError when it cannot be made.
  void begin(int width, int height, bool multisampled);
  // Resolves the samples; the result is for bind_result().
  void end();
  // Binds the result as a texture, or `instead` when nothing has been drawn yet.
  void bind_result(int unit, const GlTexture& instead) const;

 private:
  void allocate(int width, int height);
  void allocate_samples();

  int samples_ = 1, width_ = 0, height_ = 0;
  bool in_samples_ = false, has_samples_ = false;
  GlFramebuffer resolved_, multisampled_;
  GlObject<GlKind::texture> colour_;
  GlRenderbuffer depth_, many_colours_, many_depths_;
};

}  // namespace parallax
