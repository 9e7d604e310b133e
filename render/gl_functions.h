// The OpenGL functions of the context that is current on this thread: gl().Clear(...). Each context has a table of its
// own, filled by glad through that context's loader; nothing links libGL. Internal to render/.
#pragma once

#include <glad/gl.h>

#include <string>

namespace parallax {

using GlLoader = GLADapiproc (*)(const char* name);

// Fills a table for the context that is current. Throws RunError when that is older than OpenGL 3.3.
GladGLContext load_gl_functions(GlLoader loader);

// The table that gl() gives on this thread; null when no context is current. Not owned.
void set_current_gl(const GladGLContext* functions);
const GladGLContext* current_gl();

// A CHECK fails when no context is current.
const GladGLContext& gl();

// In debug builds, throws RunError with OpenGL's error and `where` when there was one since the last check.
void check_gl(const char* where);

}  // namespace parallax
