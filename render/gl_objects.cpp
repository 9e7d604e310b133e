#include "render/gl_objects.h"

#include <algorithm>

#include "core/check.h"
#include "core/error.h"

namespace parallax {
namespace {

GLuint compile(const char* name, GLenum stage, const std::string& source) {
  const GLuint shader = gl().CreateShader(stage);
  const std::string text = "#version 330 core\n" + source;
  const char* pointer = text.c_str();
  gl().ShaderSource(shader, 1, &pointer, nullptr);
  gl().CompileShader(shader);
  GLint good = 0;
  gl().GetShaderiv(shader, GL_COMPILE_STATUS, &good);
  if (good) return shader;
  char log[1024] = "";
  gl().GetShaderInfoLog(shader, sizeof(log), nullptr, log);
  gl().DeleteShader(shader);
  std::string line(log);
  std::replace(line.begin(), line.end(), '\n', ' ');
  throw RunError(std::string("OpenGL: the ") + (stage == GL_VERTEX_SHADER ? "vertex" : "fragment") + " shader of '" +
                 name + "' does not compile: " + line);
}

}  // namespace

GlProgram::GlProgram(const char* name, const std::string& vertex_source, const std::string& fragment_source)
    : program_(GlObject<GlKind::program>::make()) {
  const GLuint vertex = compile(name, GL_VERTEX_SHADER, vertex_source);
  GLuint fragment = 0;
  try {
    fragment = compile(name, GL_FRAGMENT_SHADER, fragment_source);
  } catch (...) {
    gl().DeleteShader(vertex);
    throw;
  }
  gl().AttachShader(program_.id(), vertex);
  gl().AttachShader(program_.id(), fragment);
  gl().LinkProgram(program_.id());
  gl().DeleteShader(vertex);
  gl().DeleteShader(fragment);
  GLint good = 0;
  gl().GetProgramiv(program_.id(), GL_LINK_STATUS, &good);
  if (good) return;
  char log[1024] = "";
  gl().GetProgramInfoLog(program_.id(), sizeof(log), nullptr, log);
  throw RunError(std::string("OpenGL: the shaders of '") + name + "' do not link: " + log);
}

void GlTexture::upload(const cv::Mat& image, bool srgb, bool mipmaps) {
  PARALLAX_CHECK(!image.empty() && image.depth() == CV_8U && image.channels() != 2, "a texture wants an 8-bit image");
  const int channels = image.channels();
  const bool fresh =
      !texture_ || image.cols != width_ || image.rows != height_ || channels != channels_ || srgb != srgb_;
  if (!texture_) texture_ = GlObject<GlKind::texture>::make();
  gl().BindTexture(GL_TEXTURE_2D, texture_.id());
  gl().PixelStorei(GL_UNPACK_ALIGNMENT, 1);
  gl().PixelStorei(GL_UNPACK_ROW_LENGTH, static_cast<GLint>(image.step / image.elemSize()));
  const GLenum format = channels == 1 ? GL_RED : channels == 3 ? GL_BGR : GL_RGBA;
  const GLint internal = channels == 1 ? GL_R8 : channels == 3 ? GL_RGB8 : srgb ? GL_SRGB8_ALPHA8 : GL_RGBA8;
  if (fresh) {
    width_ = image.cols;
    height_ = image.rows;
    channels_ = channels;
    srgb_ = srgb;
    gl().TexImage2D(GL_TEXTURE_2D, 0, internal, width_, height_, 0, format, GL_UNSIGNED_BYTE, image.data);
    gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, mipmaps ? GL_LINEAR_MIPMAP_LINEAR : GL_LINEAR);
    if (!mipmaps) gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAX_LEVEL, 0);
    if (channels == 1) {
      gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_SWIZZLE_G, GL_RED);
      gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_SWIZZLE_B, GL_RED);
    } else {
      gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_SWIZZLE_G, GL_GREEN);
      gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_SWIZZLE_B, GL_BLUE);
    }
  } else {
    gl().TexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width_, height_, format, GL_UNSIGNED_BYTE, image.data);
  }
  if (mipmaps) gl().GenerateMipmap(GL_TEXTURE_2D);
  gl().PixelStorei(GL_UNPACK_ALIGNMENT, 4);
  gl().PixelStorei(GL_UNPACK_ROW_LENGTH, 0);
}

void GlTexture::bind(int unit) const {
  gl().ActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
  gl().BindTexture(GL_TEXTURE_2D, texture_.id());
}

}  // namespace parallax
