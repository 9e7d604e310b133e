#include "render/scene_renderer.h"

#include <parallax_shaders.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "core/check.h"
#include "render/gl_framebuffer.h"
#include "render/gl_lens.h"
#include "render/gl_mesh_cache.h"
#include "render/gl_occlusion.h"
#include "render/gl_shadows.h"
#include "render/gl_sprites.h"
#include "render/gl_strokes.h"
#include "render/imgui_renderer.h"

namespace parallax {
namespace {

// Most of the light comes from straight above, this much from the side.
constexpr float kLightSlant = 0.45f;
// A shadow may lie a pixel off at its ends: it is soft.
constexpr float kShadowCoarseness = 2;

std::string with_lens(const char* source) { return std::string(shaders::lens) + source; }
std::string with_occlusion(const char* source) { return std::string(shaders::occlusion) + source; }

Eigen::Affine3f affine(const RigidTransform& T) {
  Eigen::Affine3f out = Eigen::Affine3f::Identity();
  out.linear() = T.R.cast<float>();
  out.translation() = T.t.cast<float>();
  return out;
}

// Whoever called finds the framebuffers bound as before, even when something throws.
class KeptFramebuffers {
 public:
  KeptFramebuffers() {
    gl().GetIntegerv(GL_DRAW_FRAMEBUFFER_BINDING, &draw_);
    gl().GetIntegerv(GL_READ_FRAMEBUFFER_BINDING, &read_);
  }
  ~KeptFramebuffers() {
    gl().BindFramebuffer(GL_DRAW_FRAMEBUFFER, static_cast<GLuint>(draw_));
    gl().BindFramebuffer(GL_READ_FRAMEBUFFER, static_cast<GLuint>(read_));
  }
  KeptFramebuffers(const KeptFramebuffers&) = delete;
  KeptFramebuffers& operator=(const KeptFramebuffers&) = delete;

 private:
  GLint draw_ = 0, read_ = 0;
};

// Without a camera there is no world to be seen, and the screen's pixels are the background's.
bool has_pose(const DrawList& list) { return list.camera_from_world && list.camera.width() > 0; }

cv::Size image_size(const DrawList& list, const Viewport& viewport) {
  if (list.camera.width() > 0) return {list.camera.width(), list.camera.height()};
  return list.background.empty() ? cv::Size(viewport.width, viewport.height) : list.background.size();
}

bool has_content(const DrawList& list) {
  const bool world = has_pose(list) && !(list.grids.empty() && list.meshes.empty() && list.sprites.empty() &&
                                         list.world_lines.empty() && list.world_points.empty());
  return world || !list.screen_lines.empty() || !list.screen_points.empty();
}

}  // namespace

Viewport fit_viewport(int image_width, int image_height, int framebuffer_width, int framebuffer_height) {
  if (image_width < 1 || image_height < 1) return {0, 0, framebuffer_width, framebuffer_height};
  const double scale = std::min(static_cast<double>(framebuffer_width) / image_width,
                                static_cast<double>(framebuffer_height) / image_height);
  Viewport out;
  out.width = std::clamp(static_cast<int>(std::lround(scale * image_width)), 0, std::max(0, framebuffer_width));
  out.height = std::clamp(static_cast<int>(std::lround(scale * image_height)), 0, std::max(0, framebuffer_height));
  out.x = (framebuffer_width - out.width) / 2;
  out.y = (framebuffer_height - out.height) / 2;
  return out;
}

struct SceneRenderer::Implementation {
  explicit Implementation(const SceneRendererOptions& options)
      : content(options.samples),
        mesh_program("meshes", with_lens(shaders::mesh_vertex), with_occlusion(shaders::mesh_fragment)),
        shadow_program("shadows", with_lens(shaders::mesh_vertex), with_occlusion(shaders::shadow_fragment)),
        sprite_program("sprites", with_lens(shaders::sprite_vertex), with_occlusion(shaders::sprite_fragment)),
        stroke_program("lines and points", shaders::stroke_vertex, shaders::stroke_fragment),
        composite_program("composite", shaders::composite_vertex, shaders::composite_fragment),
        nothing(GlVertexArray::make()) {
    white.upload(cv::Mat4b(1, 1, cv::Vec4b(255, 255, 255, 255)), true);
  }

  const GlLens& lens_of(const CameraModel& camera) {
    if (!lens || !(lens->camera() == camera)) lens.emplace(camera);
    return *lens;
  }

  void draw_world(const DrawList& list, const GlLens& lens, const Viewport& viewport);
  void draw_shadows(const DrawList& list, const GlLens& lens);
  void draw_meshes(const DrawList& list, const GlLens& lens);
  void draw_sprites(const DrawList& list, const GlLens& lens);
  void draw_strokes(const Strokes& batch, const Viewport& viewport);
  void composite(const DrawList& list, const Viewport& viewport, bool with_content);

  GlContentFramebuffer content;
  GlProgram mesh_program, shadow_program, sprite_program, stroke_program, composite_program;
  GlVertexArray nothing;
  GlTexture white, background;
  std::optional<GlLens> lens;
  GlMeshCache meshes;
  GlShadows shadows;
  GlOcclusion occlusion;
  GlSprites sprites;
  GlStrokes strokes;
  std::optional<ImguiRenderer> interface;

  ImguiRenderer& the_interface() {
    if (!interface) interface.emplace();
    return *interface;
  }
};

SceneRenderer::SceneRenderer(const SceneRendererOptions& options)
    : implementation_(std::make_unique<Implementation>(options)) {
  check_gl("making the renderer");
}

SceneRenderer::~SceneRenderer() = default;

void SceneRenderer::draw(const DrawList& list, const Viewport& viewport) {
  if (viewport.width < 1 || viewport.height < 1) return;
  Implementation& self = *implementation_;
  gl().Disable(GL_SCISSOR_TEST);
  gl().Disable(GL_FRAMEBUFFER_SRGB);

  const bool with_content = has_content(list);
  if (with_content) {
    const KeptFramebuffers kept;
    const GlLens& lens = self.lens_of(list.camera);
    // Lines and points have smooth edges of their own; only meshes need several samples.
    const bool with_meshes = has_pose(list) && !list.meshes.empty();
    if (with_meshes || (has_pose(list) && !list.sprites.empty()))
      self.occlusion.prepare(list, viewport.width, viewport.height);
    self.content.begin(viewport.width, viewport.height, with_meshes);
    self.draw_world(list, lens, viewport);
    self.content.end();
  }
  self.composite(list, viewport, with_content);
  self.meshes.collect();
  self.shadows.collect();
  check_gl("drawing");
}

void SceneRenderer::Implementation::draw_world(const DrawList& list, const GlLens& the_lens, const Viewport& viewport) {
  const cv::Size image = image_size(list, viewport);
  const StrokeMaker maker(the_lens, image, {viewport.width, viewport.height});
  if (has_pose(list)) {
    draw_shadows(list, the_lens);
    draw_meshes(list, the_lens);
    Strokes world;
    for (const PlaneGrid& grid : list.grids) maker.grid(*list.camera_from_world, grid, &world);
    for (const WorldLine& line : list.world_lines) maker.world_line(*list.camera_from_world, line, &world);
    for (const WorldPoint& point : list.world_points) maker.world_point(*list.camera_from_world, point, &world);
    gl().Enable(GL_DEPTH_TEST);
    draw_strokes(world, viewport);
    draw_sprites(list, the_lens);
  }
  Strokes screen;
  for (const ScreenLine& line : list.screen_lines) maker.screen_line(line, &screen);
  for (const ScreenPoint& point : list.screen_points) maker.screen_point(point, &screen);
  gl().Disable(GL_DEPTH_TEST);
  draw_strokes(screen, viewport);
}

void SceneRenderer::Implementation::draw_shadows(const DrawList& list, const GlLens& the_lens) {
  if (!list.shadow_plane || list.meshes.empty()) return;
  const RigidTransform camera_from_plane = *list.camera_from_world * *list.shadow_plane;
  if (!(camera_from_plane.inverse().t.z() > 0)) return;  // seen from below
  const Eigen::Affine3f plane_from_world = affine(list.shadow_plane->inverse());
  gl().Disable(GL_DEPTH_TEST);
  gl().Disable(GL_CULL_FACE);
  shadow_program.use();
  the_lens.set_uniforms(shadow_program);
  occlusion.set_uniforms(shadow_program);
  gl().Uniform1i(shadow_program.uniform("surface"), 0);
  for (const MeshInstance& instance : list.meshes) {
    if (!instance.casts_shadow || instance.mesh == nullptr || instance.tint.a < 0.02f) continue;
    const GlShadows::Shadow shadow = shadows.find(instance.mesh, plane_from_world * instance.world_from_model);
    if (shadow.texture == nullptr) continue;
    shadow.texture->bind(0);
    const Eigen::Affine3f camera_from_frame = in_camera(camera_from_plane, shadow.plane_from_frame);
    gl().UniformMatrix4fv(shadow_program.uniform("camera_from_model"), 1, GL_FALSE, camera_from_frame.matrix().data());
    meshes.draw_once(GlShadows::receiver(shadow, instance.tint.a), camera_from_frame, the_lens, kShadowCoarseness);
  }
}

void SceneRenderer::Implementation::draw_meshes(const DrawList& list, const GlLens& the_lens) {
  if (list.meshes.empty()) return;
  struct Item {
    const MeshInstance* instance;
    GlMeshCache::Entry* entry;
    Eigen::Affine3f camera_from_model;
    float distance;
  };
  std::vector<Item> solid, see_through;
  for (const MeshInstance& instance : list.meshes) {
    if (instance.mesh == nullptr || instance.mesh->indices.empty()) continue;
    GlMeshCache::Entry& entry = meshes.entry(instance.mesh);
    Item item{&instance, &entry, in_camera(*list.camera_from_world, instance.world_from_model), 0};
    if (!item.camera_from_model.matrix().allFinite()) continue;
    item.distance = (item.camera_from_model * entry.centre).norm();
    (entry.see_through || instance.tint.a < 0.999f ? see_through : solid).push_back(item);
  }
  std::stable_sort(see_through.begin(), see_through.end(),
                   [](const Item& a, const Item& b) { return a.distance > b.distance; });

  mesh_program.use();
  the_lens.set_uniforms(mesh_program);
  occlusion.set_uniforms(mesh_program);
  const Eigen::Vector3f up = list.shadow_plane ? Eigen::Vector3f(list.shadow_plane->R.col(2).cast<float>())
                                               : Eigen::Vector3f(Eigen::Vector3f::UnitZ());
  const Eigen::Vector3f side =
      list.shadow_plane ? Eigen::Vector3f((list.shadow_plane->R * Eigen::Vector3d(0.6, 0.8, 0)).cast<float>())
                        : Eigen::Vector3f(0.6f, 0.8f, 0);
  const Eigen::Vector3f towards_light = (up + kLightSlant * side).normalized();
  gl().Uniform3fv(mesh_program.uniform("up"), 1, up.data());
  gl().Uniform3fv(mesh_program.uniform("towards_light"), 1, towards_light.data());
  gl().Uniform3fv(mesh_program.uniform("light"), 1, list.ambient_light.data());
  gl().Uniform1i(mesh_program.uniform("surface"), 0);
  const GLint tint_at = mesh_program.uniform("tint"), emission_at = mesh_program.uniform("emission");
  const GLint pose_at = mesh_program.uniform("camera_from_model");
  const GLint normal_at = mesh_program.uniform("world_normal_from_model");
  gl().Enable(GL_DEPTH_TEST);
  gl().DepthFunc(GL_LEQUAL);
  gl().CullFace(GL_BACK);
  const auto draw_item = [&](const Item& item, bool one_side) {
    const DrawColour& tint = item.instance->tint;
    const Eigen::Matrix3f linear = item.instance->world_from_model.linear();
    const float determinant = linear.determinant();
    const Eigen::Matrix3f normals =
        std::abs(determinant) > 1e-20f ? Eigen::Matrix3f(linear.inverse().transpose()) : linear;
    gl().Uniform4f(tint_at, linear_from_srgb(tint.r), linear_from_srgb(tint.g), linear_from_srgb(tint.b), tint.a);
    gl().Uniform1f(emission_at, item.instance->emission);
    gl().UniformMatrix4fv(pose_at, 1, GL_FALSE, item.camera_from_model.matrix().data());
    gl().UniformMatrix3fv(normal_at, 1, GL_FALSE, normals.data());
    gl().FrontFace(determinant < 0 ? GL_CW : GL_CCW);
    if (item.instance->mesh->two_sided && !one_side) {
      gl().Disable(GL_CULL_FACE);
    } else {
      gl().Enable(GL_CULL_FACE);
    }
    (item.entry->texture.id() != 0 ? item.entry->texture : white).bind(0);
    meshes.draw(*item.entry, *item.instance->mesh, item.camera_from_model, the_lens);
  };
  // What one sees through a thing of its own inside lies behind its front.
  const auto draw_see_through = [&](const Item& item) {
    if (item.instance->mesh->two_sided) {
      gl().CullFace(GL_FRONT);
      draw_item(item, true);
      gl().CullFace(GL_BACK);
    }
    draw_item(item, true);
  };
  gl().DepthMask(GL_TRUE);
  for (const Item& item : solid) draw_item(item, false);
  gl().DepthMask(GL_FALSE);
  for (const Item& item : see_through) draw_see_through(item);
  gl().Disable(GL_CULL_FACE);
  gl().FrontFace(GL_CCW);
}

void SceneRenderer::Implementation::draw_sprites(const DrawList& list, const GlLens& the_lens) {
  if (list.sprites.empty()) return;
  sprite_program.use();
  the_lens.set_uniforms(sprite_program);
  occlusion.set_uniforms(sprite_program);
  gl().Enable(GL_DEPTH_TEST);
  gl().DepthFunc(GL_LEQUAL);
  gl().DepthMask(GL_FALSE);
  gl().Disable(GL_CULL_FACE);
  sprites.draw(sprite_squares(list.sprites, *list.camera_from_world));
}

void SceneRenderer::Implementation::draw_strokes(const Strokes& batch, const Viewport& viewport) {
  if (batch.indices.empty()) return;
  stroke_program.use();
  gl().Uniform2f(stroke_program.uniform("viewport_size"), static_cast<float>(viewport.width),
                 static_cast<float>(viewport.height));
  gl().Uniform1f(stroke_program.uniform("near_plane"), kNearPlane_m);
  gl().DepthMask(GL_FALSE);
  strokes.draw(batch);
}

void SceneRenderer::Implementation::composite(const DrawList& list, const Viewport& viewport, bool with_content) {
  gl().Viewport(viewport.x, viewport.y, viewport.width, viewport.height);
  gl().Disable(GL_DEPTH_TEST);
  gl().Disable(GL_BLEND);
  composite_program.use();
  const bool has_image = !list.background.empty();
  if (has_image) {
    PARALLAX_CHECK(list.background.type() == CV_8UC1 || list.background.type() == CV_8UC3,
                   "the background is a grey or BGR image");
    gl().ActiveTexture(GL_TEXTURE0);
    background.upload(list.background);
    // At its own size every pixel is taken as it is.
    const bool same_size = list.background.cols == viewport.width && list.background.rows == viewport.height;
    gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, same_size ? GL_NEAREST : GL_LINEAR);
    gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, same_size ? GL_NEAREST : GL_LINEAR);
  } else {
    white.bind(0);
  }
  content.bind_result(1, white);
  gl().Uniform1i(composite_program.uniform("image"), 0);
  gl().Uniform1i(composite_program.uniform("content"), 1);
  gl().Uniform1i(composite_program.uniform("has_image"), has_image);
  gl().Uniform1i(composite_program.uniform("has_content"), with_content);
  gl().Uniform3f(composite_program.uniform("colour"), list.background_colour.r, list.background_colour.g,
                 list.background_colour.b);
  gl().Uniform2i(composite_program.uniform("origin"), viewport.x, viewport.y);
  gl().BindVertexArray(nothing.id());
  gl().DrawArrays(GL_TRIANGLES, 0, 3);
  gl().BindVertexArray(0);
  gl().ActiveTexture(GL_TEXTURE1);
  gl().BindTexture(GL_TEXTURE_2D, 0);
  gl().ActiveTexture(GL_TEXTURE0);
  gl().BindTexture(GL_TEXTURE_2D, 0);
  gl().UseProgram(0);
}

void SceneRenderer::draw_interface(const ImDrawData& data, int framebuffer_width, int framebuffer_height) {
  implementation_->the_interface().draw(data, framebuffer_width, framebuffer_height);
}

void* SceneRenderer::picture(int key, const cv::Mat& image) {
  return implementation_->the_interface().picture(key, image);
}

cv::Mat3b read_framebuffer(int width, int height) {
  cv::Mat4b rgba(height, width);
  gl().PixelStorei(GL_PACK_ALIGNMENT, 1);
  gl().ReadPixels(0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE, rgba.data);
  cv::Mat3b bgr, out;
  cv::cvtColor(rgba, bgr, cv::COLOR_RGBA2BGR);
  cv::flip(bgr, out, 0);
  check_gl("reading the framebuffer");
  return out;
}

}  // namespace parallax
