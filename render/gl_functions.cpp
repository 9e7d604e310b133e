#include "render/gl_functions.h"

#include "core/check.h"
#include "core/error.h"

namespace parallax {
namespace {
thread_local const GladGLContext* current = nullptr;
}  // namespace

GladGLContext load_gl_functions(GlLoader loader) {
  GladGLContext functions{};
  const int version = gladLoadGLContext(&functions, loader);
  if (version < GLAD_MAKE_VERSION(3, 3))
    throw RunError("OpenGL: found version " + std::to_string(GLAD_VERSION_MAJOR(version)) + "." +
                   std::to_string(GLAD_VERSION_MINOR(version)) + ", expected 3.3 or later");
  return functions;
}

void set_current_gl(const GladGLContext* functions) { current = functions; }

const GladGLContext* current_gl() { return current; }

const GladGLContext& gl() {
  PARALLAX_CHECK(current != nullptr, "no OpenGL context is current on this thread");
  return *current;
}

void check_gl([[maybe_unused]] const char* where) {
#ifndef NDEBUG
  const GLenum error = gl().GetError();
  if (error == GL_NO_ERROR) return;
  const char* name = error == GL_INVALID_ENUM                    ? "invalid enum"
                     : error == GL_INVALID_VALUE                 ? "invalid value"
                     : error == GL_INVALID_OPERATION             ? "invalid operation"
                     : error == GL_INVALID_FRAMEBUFFER_OPERATION ? "invalid framebuffer operation"
                     : error == GL_OUT_OF_MEMORY                 ? "out of memory"
                                                                 : "unknown error";
  throw RunError(std::string("OpenGL: ") + name + " in " + where);
#endif
}

}  // namespace parallax
