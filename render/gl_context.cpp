#include "render/gl_context.h"

#include <dlfcn.h>

#include <string>
#include <vector>

#include "core/error.h"
#include "render/gl_functions.h"

namespace parallax {
namespace {

// OSMesa's interface, declared here: its header needs libGL's. Values from GL/osmesa.h.
using OsMesaContext = void*;
constexpr int kOsMesaFormat = 0x22, kOsMesaProfile = 0x33, kOsMesaCoreProfile = 0x34;
constexpr int kOsMesaMajorVersion = 0x36, kOsMesaMinorVersion = 0x37;

struct OsMesa {
  OsMesaContext (*create)(const int* attributes, OsMesaContext share) = nullptr;
  void (*destroy)(OsMesaContext) = nullptr;
  unsigned char (*make_current)(OsMesaContext, void* buffer, GLenum type, GLsizei width, GLsizei height) = nullptr;
  OsMesaContext (*current)() = nullptr;
  GlLoader get_address = nullptr;
};

template <typename Function>
void find(void* library, const char* name, Function* function) {
  *function = reinterpret_cast<Function>(dlsym(library, name));
  if (*function == nullptr) throw RunError(std::string("OSMesa: libOSMesa.so.8 has no ") + name);
}

// Loaded once, kept to the end: Mesa's threads do not like to be unloaded.
const OsMesa& osmesa() {
  static const OsMesa functions = [] {
    void* library = dlopen("libOSMesa.so.8", RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr)
      throw RunError(
          std::string("OSMesa: cannot load libOSMesa.so.8, which draws without a display: install the package "
                      "libosmesa6 (") +
          dlerror() + ")");
    OsMesa out;
    find(library, "OSMesaCreateContextAttribs", &out.create);
    find(library, "OSMesaDestroyContext", &out.destroy);
    find(library, "OSMesaMakeCurrent", &out.make_current);
    find(library, "OSMesaGetCurrentContext", &out.current);
    find(library, "OSMesaGetProcAddress", &out.get_address);
    return out;
  }();
  return functions;
}

}  // namespace

struct OffscreenContext::Implementation {
  int width, height;
  std::vector<unsigned char> buffer;  // OSMesa's own framebuffer
  OsMesaContext context = nullptr;
  GladGLContext functions{};

  ~Implementation() {
    if (context == nullptr) return;
    if (current_gl() == &functions) set_current_gl(nullptr);
    if (osmesa().current() == context) osmesa().make_current(nullptr, nullptr, 0, 0, 0);
    osmesa().destroy(context);
  }

  void make_current() {
    if (!osmesa().make_current(context, buffer.data(), GL_UNSIGNED_BYTE, width, height))
      throw RunError("OSMesa: cannot draw into a picture of " + std::to_string(width) + "x" + std::to_string(height) +
                     " pixels");
  }
};

OffscreenContext::OffscreenContext(int width, int height) : implementation_(std::make_unique<Implementation>()) {
  Implementation& self = *implementation_;
  self.width = width;
  self.height = height;
  if (width < 1 || height < 1)
    throw RunError("OSMesa: picture size: found " + std::to_string(width) + "x" + std::to_string(height) +
                   ", expected at least 1x1");
  const int attributes[] = {
      kOsMesaFormat, GL_RGBA, kOsMesaProfile, kOsMesaCoreProfile, kOsMesaMajorVersion, 3, kOsMesaMinorVersion, 3, 0};
  self.context = osmesa().create(attributes, nullptr);
  if (self.context == nullptr) throw RunError("OSMesa: cannot make an OpenGL 3.3 core context");
  self.buffer.resize(4 * static_cast<std::size_t>(width) * height);
  self.make_current();
  self.functions = load_gl_functions(osmesa().get_address);
  set_current_gl(&self.functions);
}

OffscreenContext::~OffscreenContext() = default;

void OffscreenContext::make_current() {
  implementation_->make_current();
  set_current_gl(&implementation_->functions);
}

}  // namespace parallax
