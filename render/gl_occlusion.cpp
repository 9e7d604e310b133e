#include "render/gl_occlusion.h"

namespace parallax {
namespace {

constexpr int kDepthUnit = 2;

}  // namespace

void GlOcclusion::prepare(const DrawList& list, int width, int height) {
  width_ = width;
  height_ = height;
  const cv::Mat1f& depth = list.occlusion_depth;
  has_depth_ = !depth.empty();
  if (!has_depth_) return;
  if (!depth_) depth_ = GlObject<GlKind::texture>::make();
  gl().BindTexture(GL_TEXTURE_2D, depth_.id());
  gl().PixelStorei(GL_UNPACK_ALIGNMENT, 4);
  gl().PixelStorei(GL_UNPACK_ROW_LENGTH, static_cast<GLint>(depth.step / depth.elemSize()));
  gl().TexImage2D(GL_TEXTURE_2D, 0, GL_R32F, depth.cols, depth.rows, 0, GL_RED, GL_FLOAT, depth.data);
  gl().PixelStorei(GL_UNPACK_ROW_LENGTH, 0);
  gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAX_LEVEL, 0);
  gl().BindTexture(GL_TEXTURE_2D, 0);
}

void GlOcclusion::set_uniforms(const GlProgram& program) const {
  gl().Uniform1i(program.uniform("has_occlusion_depth"), has_depth_);
  gl().Uniform1i(program.uniform("occlusion_depth"), kDepthUnit);
  gl().Uniform2f(program.uniform("picture_size"), static_cast<float>(width_), static_cast<float>(height_));
  gl().ActiveTexture(GL_TEXTURE0 + kDepthUnit);
  gl().BindTexture(GL_TEXTURE_2D, has_depth_ ? depth_.id() : 0);
  gl().ActiveTexture(GL_TEXTURE0);
}

}  // namespace parallax
