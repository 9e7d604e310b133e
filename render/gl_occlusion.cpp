#include "render/gl_occlusion.h"

#include <parallax_shaders.h>

#include <algorithm>

#include "core/check.h"
#include "core/error.h"

namespace parallax {
namespace {

constexpr int kOccluderUnit = 2, kDepthUnit = 3;

void nothing_beyond_edges(GLint filter) {
  gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, filter);
  gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, filter);
  gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAX_LEVEL, 0);
}

}  // namespace

GlOcclusion::GlOcclusion()
    : program_("occluders", std::string(shaders::lens) + shaders::mesh_vertex, shaders::occluder_fragment) {}

void GlOcclusion::prepare(const DrawList& list, const GlLens& lens, int width, int height, GlMeshCache* meshes) {
  width_ = width;
  height_ = height;
  has_depth_ = upload_depth(list.occlusion_depth);
  has_occluders_ = draw_occluders(list, lens, meshes);
}

bool GlOcclusion::draw_occluders(const DrawList& list, const GlLens& lens, GlMeshCache* meshes) {
  const auto drawn = [](const auto& mesh) { return mesh != nullptr && !mesh->indices.empty(); };
  if (std::none_of(list.occluders.begin(), list.occluders.end(), drawn)) return false;
  const Eigen::Affine3f camera_from_model = in_camera(*list.camera_from_world, list.world_from_occluders);
  if (!camera_from_model.matrix().allFinite()) return false;
  if (!framebuffer_) {
    framebuffer_ = GlFramebuffer::make();
    occluder_depth_ = GlObject<GlKind::texture>::make();
  }
  gl().BindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
  if (width_ != allocated_width_ || height_ != allocated_height_) {
    gl().BindTexture(GL_TEXTURE_2D, occluder_depth_.id());
    gl().TexImage2D(GL_TEXTURE_2D, 0, GL_DEPTH_COMPONENT24, width_, height_, 0, GL_DEPTH_COMPONENT, GL_UNSIGNED_INT,
                    nullptr);
    nothing_beyond_edges(GL_LINEAR);
    gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
    gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_COMPARE_FUNC, GL_LEQUAL);
    gl().FramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, occluder_depth_.id(), 0);
    gl().DrawBuffer(GL_NONE);
    gl().ReadBuffer(GL_NONE);
    if (gl().CheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
      throw RunError("OpenGL: cannot make the depth picture of what hides virtual things");
    gl().BindTexture(GL_TEXTURE_2D, 0);
    allocated_width_ = width_;
    allocated_height_ = height_;
  }
  gl().Viewport(0, 0, width_, height_);
  gl().DepthMask(GL_TRUE);
  gl().Clear(GL_DEPTH_BUFFER_BIT);
  gl().Enable(GL_DEPTH_TEST);
  gl().DepthFunc(GL_LEQUAL);
  gl().Disable(GL_CULL_FACE);
  program_.use();
  lens.set_uniforms(program_);
  gl().UniformMatrix4fv(program_.uniform("camera_from_model"), 1, GL_FALSE, camera_from_model.matrix().data());
  for (const auto& mesh : list.occluders)
    if (drawn(mesh)) meshes->draw(meshes->entry(mesh), *mesh, camera_from_model, lens);
  gl().Disable(GL_DEPTH_TEST);
  return true;
}

bool GlOcclusion::upload_depth(const cv::Mat1f& depth) {
  if (depth.empty()) return false;
  if (!occlusion_depth_) occlusion_depth_ = GlObject<GlKind::texture>::make();
  gl().BindTexture(GL_TEXTURE_2D, occlusion_depth_.id());
  gl().PixelStorei(GL_UNPACK_ALIGNMENT, 4);
  gl().PixelStorei(GL_UNPACK_ROW_LENGTH, static_cast<GLint>(depth.step / depth.elemSize()));
  gl().TexImage2D(GL_TEXTURE_2D, 0, GL_R32F, depth.cols, depth.rows, 0, GL_RED, GL_FLOAT, depth.data);
  gl().PixelStorei(GL_UNPACK_ROW_LENGTH, 0);
  nothing_beyond_edges(GL_NEAREST);
  gl().BindTexture(GL_TEXTURE_2D, 0);
  return true;
}

void GlOcclusion::set_uniforms(const GlProgram& program) const {
  gl().Uniform1i(program.uniform("has_occluders"), has_occluders_);
  gl().Uniform1i(program.uniform("has_occlusion_depth"), has_depth_);
  gl().Uniform1i(program.uniform("occluder_depth"), kOccluderUnit);
  gl().Uniform1i(program.uniform("occlusion_depth"), kDepthUnit);
  gl().Uniform2f(program.uniform("picture_size"), static_cast<float>(width_), static_cast<float>(height_));
  gl().ActiveTexture(GL_TEXTURE0 + kOccluderUnit);
  gl().BindTexture(GL_TEXTURE_2D, has_occluders_ ? occluder_depth_.id() : 0);
  gl().ActiveTexture(GL_TEXTURE0 + kDepthUnit);
  gl().BindTexture(GL_TEXTURE_2D, has_depth_ ? occlusion_depth_.id() : 0);
  gl().ActiveTexture(GL_TEXTURE0);
}

}  // namespace parallax
