#include "render/gl_framebuffer.h"

#include <algorithm>

#include "core/error.h"

namespace parallax {
namespace {

void check_complete(const char* what) {
  const GLenum status = gl().CheckFramebufferStatus(GL_FRAMEBUFFER);
  if (status != GL_FRAMEBUFFER_COMPLETE)
    throw RunError(std::string("OpenGL: cannot make the ") + what + " to draw into (status " + std::to_string(status) +
                   ")");
}

}  // namespace

GlContentFramebuffer::GlContentFramebuffer(int samples) {
  GLint most = 1;
  gl().GetIntegerv(GL_MAX_SAMPLES, &most);
  samples_ = std::clamp(samples, 1, std::max(1, static_cast<int>(most)));
}

void GlContentFramebuffer::allocate(int width, int height) {
  GLint most = 0;
  gl().GetIntegerv(GL_MAX_TEXTURE_SIZE, &most);
  if (width > most || height > most)
    throw RunError("OpenGL: picture size: found " + std::to_string(width) + "x" + std::to_string(height) +
                   ", expected at most " + std::to_string(most) + " pixels a side");
  width_ = width;
  height_ = height;
  has_samples_ = false;
  if (!resolved_) {
    resolved_ = GlFramebuffer::make();
    colour_ = GlObject<GlKind::texture>::make();
    depth_ = GlRenderbuffer::make();
  }
  gl().BindTexture(GL_TEXTURE_2D, colour_.id());
  gl().TexImage2D(GL_TEXTURE_2D, 0, GL_RGBA16F, width, height, 0, GL_RGBA, GL_HALF_FLOAT, nullptr);
  gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  gl().TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAX_LEVEL, 0);
  gl().BindRenderbuffer(GL_RENDERBUFFER, depth_.id());
  gl().RenderbufferStorage(GL_RENDERBUFFER, GL_DEPTH_COMPONENT24, width, height);
  gl().BindFramebuffer(GL_FRAMEBUFFER, resolved_.id());
  gl().FramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, colour_.id(), 0);
  gl().FramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth_.id());
  check_complete("picture");
}

void GlContentFramebuffer::allocate_samples() {
  if (!multisampled_) {
    multisampled_ = GlFramebuffer::make();
    many_colours_ = GlRenderbuffer::make();
    many_depths_ = GlRenderbuffer::make();
  }
  gl().BindRenderbuffer(GL_RENDERBUFFER, many_colours_.id());
  gl().RenderbufferStorageMultisample(GL_RENDERBUFFER, samples_, GL_RGBA16F, width_, height_);
  gl().BindRenderbuffer(GL_RENDERBUFFER, many_depths_.id());
  gl().RenderbufferStorageMultisample(GL_RENDERBUFFER, samples_, GL_DEPTH_COMPONENT24, width_, height_);
  gl().BindFramebuffer(GL_FRAMEBUFFER, multisampled_.id());
  gl().FramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, many_colours_.id());
  gl().FramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, many_depths_.id());
  check_complete("multi-sampled picture");
  has_samples_ = true;
}

void GlContentFramebuffer::begin(int width, int height, bool multisampled) {
  if (width != width_ || height != height_) allocate(width, height);
  in_samples_ = multisampled && samples_ > 1;
  if (in_samples_ && !has_samples_) allocate_samples();
  gl().BindFramebuffer(GL_FRAMEBUFFER, in_samples_ ? multisampled_.id() : resolved_.id());
  gl().Viewport(0, 0, width, height);
  gl().DepthMask(GL_TRUE);
  gl().ClearColor(0, 0, 0, 0);
  gl().Clear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  gl().Enable(GL_MULTISAMPLE);
  gl().Enable(GL_BLEND);
  gl().BlendEquation(GL_FUNC_ADD);
  gl().BlendFunc(GL_ONE, GL_ONE_MINUS_SRC_ALPHA);
}

void GlContentFramebuffer::end() {
  gl().Disable(GL_BLEND);
  gl().DepthMask(GL_TRUE);
  if (!in_samples_) return;
  gl().BindFramebuffer(GL_READ_FRAMEBUFFER, multisampled_.id());
  gl().BindFramebuffer(GL_DRAW_FRAMEBUFFER, resolved_.id());
  gl().BlitFramebuffer(0, 0, width_, height_, 0, 0, width_, height_, GL_COLOR_BUFFER_BIT, GL_NEAREST);
}

void GlContentFramebuffer::bind_result(int unit, const GlTexture& instead) const {
  gl().ActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
  gl().BindTexture(GL_TEXTURE_2D, colour_ ? colour_.id() : instead.id());
}

}  // namespace parallax
