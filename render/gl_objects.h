// Owners of OpenGL objects, and the few calls that make them. Each lives and dies on the thread of its context; one
// that outlives the context lets go of its name without a call. Internal to render/.
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <utility>

#include "render/gl_functions.h"

namespace parallax {

enum class GlKind { buffer, vertex_array, texture, framebuffer, renderbuffer, program };

template <GlKind kind>
class GlObject {
 public:
  GlObject() = default;
  explicit GlObject(GLuint id) : id_(id) {}
  GlObject(GlObject&& other) noexcept : id_(std::exchange(other.id_, 0)) {}
  GlObject& operator=(GlObject&& other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }
  ~GlObject() {
    if (id_ == 0 || current_gl() == nullptr) return;
    if constexpr (kind == GlKind::buffer) gl().DeleteBuffers(1, &id_);
    if constexpr (kind == GlKind::vertex_array) gl().DeleteVertexArrays(1, &id_);
    if constexpr (kind == GlKind::texture) gl().DeleteTextures(1, &id_);
    if constexpr (kind == GlKind::framebuffer) gl().DeleteFramebuffers(1, &id_);
    if constexpr (kind == GlKind::renderbuffer) gl().DeleteRenderbuffers(1, &id_);
    if constexpr (kind == GlKind::program) gl().DeleteProgram(id_);
  }
  static GlObject make() {
    GLuint id = 0;
    if constexpr (kind == GlKind::buffer) gl().GenBuffers(1, &id);
    if constexpr (kind == GlKind::vertex_array) gl().GenVertexArrays(1, &id);
    if constexpr (kind == GlKind::texture) gl().GenTextures(1, &id);
    if constexpr (kind == GlKind::framebuffer) gl().GenFramebuffers(1, &id);
    if constexpr (kind == GlKind::renderbuffer) gl().GenRenderbuffers(1, &id);
    if constexpr (kind == GlKind::program) id = gl().CreateProgram();
    return GlObject(id);
  }
  GLuint id() const { return id_; }
  explicit operator bool() const { return id_ != 0; }

 private:
  GLuint id_ = 0;
};

using GlBuffer = GlObject<GlKind::buffer>;
using GlVertexArray = GlObject<GlKind::vertex_array>;
using GlFramebuffer = GlObject<GlKind::framebuffer>;
using GlRenderbuffer = GlObject<GlKind::renderbuffer>;

// A vertex and a fragment shader, linked. Throws RunError with the compiler's words.
class GlProgram {
 public:
  GlProgram() = default;
  GlProgram(const char* name, const std::string& vertex_source, const std::string& fragment_source);
  GLint uniform(const char* name) const { return gl().GetUniformLocation(program_.id(), name); }
  void use() const { gl().UseProgram(program_.id()); }

 private:
  GlObject<GlKind::program> program_;
};

// A two-dimensional texture and what it was last filled with.
class GlTexture {
 public:
  // 8-bit images of one channel (grey), three (BGR) or four (RGBA). `srgb`: sampled as linear light (four channels
  // only). Makes it, or updates it in place when shape and kind have not changed. Sampling is bilinear; with mipmaps
  // trilinear.
  void upload(const cv::Mat& image, bool srgb = false, bool mipmaps = false);
  void bind(int unit) const;
  GLuint id() const { return texture_.id(); }
  int width() const { return width_; }
  int height() const { return height_; }

 private:
  GlObject<GlKind::texture> texture_;
  int width_ = 0, height_ = 0, channels_ = 0;
  bool srgb_ = false;
};

}  // namespace parallax
