// The window: GLFW, OpenGL 3.3 core, Dear ImGui's input. Everything here runs on the main thread (GLFW's rule).
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace parallax {

// A key as GLFW names it (GLFW_KEY_*), with its modifiers (GLFW_MOD_*).
struct KeyEvent {
  int key = 0;
  int modifiers = 0;
  bool pressed = true;  // else released; repeats are not reported
};

struct WindowGeometry {
  // Screen coordinates. Where no screen would show it (x < 0, or the screen is gone) it is put wherever the system
  // likes.
  int x = -1, y = -1, width = 1280, height = 960;
  bool full_screen = false;
};

struct PointerState {
  double x = 0, y = 0;                  // framebuffer pixels from the top left
  double scroll = 0;                    // steps since the last poll
  double pressed_x = 0, pressed_y = 0;  // where a button was pressed last, however long ago that is
  bool left = false, middle = false, right = false;
};

class Window {
 public:
  // Opens it and makes its context current; text and panels are `interface_scale` times their ordinary size. Throws
  // RunError with the reason (no display...) when it cannot be opened.
  Window(const std::string& title, const WindowGeometry& geometry, double interface_scale = 1);
  ~Window();
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;

  // Makes its context current again, after an off-screen one was (render/gl_context.h).
  void make_current();

  // Whether a display is there at all (DISPLAY or WAYLAND_DISPLAY).
  static bool available();

  // Handles what the user did; key events since the last call, in order. Keys that the interface is typing into are
  // left out.
  std::vector<KeyEvent> poll();
  bool closing() const;
  void close();
  bool key_down(int key) const;
  PointerState pointer() const;
  int framebuffer_width() const;
  int framebuffer_height() const;
  float content_scale() const;  // 2 on a high-DPI screen
  void set_full_screen(bool on);
  WindowGeometry geometry() const;
  void set_title(const std::string& title);

  // One frame of Dear ImGui: begin, the caller's widgets, then end, after which ImGui::GetDrawData() is to be drawn.
  void begin_interface();
  void end_interface();
  void swap();

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace parallax
