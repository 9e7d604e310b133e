// OpenGL 3.3 core contexts: an off-screen one on OSMesa (no display, no window system). The window's context lives in
// render/window. Both serve the same renderer through one loader (glad).
//
// A context belongs to the thread that made it current; every OpenGL call happens on that thread.
#pragma once

#include <memory>

namespace parallax {

class OffscreenContext {
 public:
  // Loads libOSMesa at run time and makes a context current on this thread. Throws RunError, saying which package to
  // install, when it is not there.
  OffscreenContext(int width, int height);
  ~OffscreenContext();
  OffscreenContext(const OffscreenContext&) = delete;
  OffscreenContext& operator=(const OffscreenContext&) = delete;

  void make_current();

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace parallax
