#include "render/window.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <imgui.h>
#include <imgui/backends/imgui_impl_glfw.h>

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "core/error.h"
#include "render/gl_functions.h"
#include "render/imgui_fonts.h"

namespace parallax {
namespace {

std::string glfw_error() {
  const char* text = nullptr;
  glfwGetError(&text);
  return text != nullptr ? text : "no reason given";
}

bool is_set(const char* variable) {
  const char* value = std::getenv(variable);
  return value != nullptr && *value != '\0';
}

// The screen that shows most of this; null when none shows any.
GLFWmonitor* screen_of(const WindowGeometry& geometry) {
  int count = 0, most = 0;
  GLFWmonitor** screens = glfwGetMonitors(&count);
  GLFWmonitor* best = nullptr;
  for (int i = 0; i < count; ++i) {
    int x = 0, y = 0;
    glfwGetMonitorPos(screens[i], &x, &y);
    const GLFWvidmode* mode = glfwGetVideoMode(screens[i]);
    if (mode == nullptr) continue;
    const int across = std::min(geometry.x + geometry.width, x + mode->width) - std::max(geometry.x, x);
    const int down = std::min(geometry.y + geometry.height, y + mode->height) - std::max(geometry.y, y);
    if (across <= 0 || down <= 0 || across * down <= most) continue;
    most = across * down;
    best = screens[i];
  }
  return best;
}

struct GlfwWindowCloser {
  void operator()(GLFWwindow* window) const { glfwDestroyWindow(window); }
};

}  // namespace

struct Window::Implementation {
  bool glfw_started = false, interface_started = false;
  std::unique_ptr<GLFWwindow, GlfwWindowCloser> window;
  GladGLContext functions{};
  ImGuiContext* interface = nullptr;
  std::vector<KeyEvent> keys;
  double scroll = 0, last_scroll = 0;
  WindowGeometry windowed;  // to return to from full screen
  bool full_screen = false;
  float font_scale = 0, interface_scale = 1;
  double pressed_x = 0, pressed_y = 0;

  ~Implementation() {
    if (interface_started) {
      ImGui::SetCurrentContext(interface);
      ImGui_ImplGlfw_Shutdown();
    }
    if (interface != nullptr) ImGui::DestroyContext(interface);
    if (current_gl() == &functions) set_current_gl(nullptr);
    window.reset();
    if (glfw_started) glfwTerminate();
  }

  static Implementation& of(GLFWwindow* window) {
    return *static_cast<Implementation*>(glfwGetWindowUserPointer(window));
  }

  static void on_key(GLFWwindow* window, int key, int, int action, int modifiers) {
    if (action == GLFW_REPEAT || key == GLFW_KEY_UNKNOWN) return;
    Implementation& self = of(window);
    if (action == GLFW_PRESS && ImGui::GetIO().WantTextInput) return;
    self.keys.push_back({key, modifiers, action == GLFW_PRESS});
  }
  static void on_scroll(GLFWwindow* window, double, double steps) { of(window).scroll += steps; }

  static void on_button(GLFWwindow* window, int, int action, int) {
    if (action == GLFW_PRESS) glfwGetCursorPos(window, &of(window).pressed_x, &of(window).pressed_y);
  }

  float scale() const {
    float x = 1, y = 1;
    glfwGetWindowContentScale(window.get(), &x, &y);
    return x > 0.1f ? x : 1.0f;
  }

  // Pixels of the framebuffer for a unit of window coordinates: 1 on X11, 2 on a high-DPI Wayland screen.
  float pixel_ratio() const {
    int width = 0, height = 0, pixels = 0, rows = 0;
    glfwGetWindowSize(window.get(), &width, &height);
    glfwGetFramebufferSize(window.get(), &pixels, &rows);
    return width > 0 && pixels > 0 ? static_cast<float>(pixels) / static_cast<float>(width) : 1.0f;
  }

  void load_fonts() {
    const float wanted = scale() * interface_scale;
    if (wanted == font_scale) return;
    font_scale = wanted;
    load_interface_font(wanted);
    const float ratio = pixel_ratio();
    ImGui::GetIO().FontGlobalScale = 1 / ratio;
    ImGui::GetStyle() = ImGuiStyle();
    ImGui::StyleColorsDark();
    ImGui::GetStyle().WindowRounding = 4;
    ImGui::GetStyle().ScaleAllSizes(wanted / ratio);
  }
};

Window::Window(const std::string& title, const WindowGeometry& geometry, double interface_scale)
    : implementation_(std::make_unique<Implementation>()) {
  Implementation& self = *implementation_;
  if (!available()) throw RunError("window: no display: found neither DISPLAY nor WAYLAND_DISPLAY in the environment");
  if (!glfwInit()) throw RunError("window: cannot reach the display: " + glfw_error());
  self.glfw_started = true;
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
  glfwWindowHint(GLFW_DEPTH_BITS, 0);
  glfwWindowHint(GLFW_STENCIL_BITS, 0);
  glfwWindowHint(GLFW_ALPHA_BITS, 0);
  glfwWindowHint(GLFW_VISIBLE, GLFW_FALSE);
  glfwWindowHintString(GLFW_X11_CLASS_NAME, "parallax");
  glfwWindowHintString(GLFW_X11_INSTANCE_NAME, "parallax");
  self.windowed = geometry;
  self.windowed.full_screen = false;
  self.interface_scale = static_cast<float>(interface_scale);
  self.window.reset(
      glfwCreateWindow(std::max(64, geometry.width), std::max(64, geometry.height), title.c_str(), nullptr, nullptr));
  if (!self.window) throw RunError("window: cannot open one with OpenGL 3.3: " + glfw_error());
  GLFWwindow* window = self.window.get();
  glfwSetWindowUserPointer(window, &self);
  if (geometry.x >= 0 && screen_of(geometry) != nullptr) glfwSetWindowPos(window, geometry.x, std::max(0, geometry.y));
  glfwSetWindowSizeLimits(window, 320, 240, GLFW_DONT_CARE, GLFW_DONT_CARE);
  glfwMakeContextCurrent(window);
  self.functions = load_gl_functions(glfwGetProcAddress);
  set_current_gl(&self.functions);
  glfwSwapInterval(1);

  // Ours first: Dear ImGui's call those that were there before.
  glfwSetKeyCallback(window, Implementation::on_key);
  glfwSetScrollCallback(window, Implementation::on_scroll);
  glfwSetMouseButtonCallback(window, Implementation::on_button);
  IMGUI_CHECKVERSION();
  self.interface = ImGui::CreateContext();
  ImGui::SetCurrentContext(self.interface);
  ImGui::GetIO().IniFilename = nullptr;
  ImGui::GetIO().LogFilename = nullptr;
  self.interface_started = ImGui_ImplGlfw_InitForOpenGL(window, true);
  // Wide pictures and many letters have more than 65536 vertices in one list.
  ImGui::GetIO().BackendFlags |= ImGuiBackendFlags_RendererHasVtxOffset;
  self.load_fonts();
  glfwShowWindow(window);
  if (geometry.full_screen) set_full_screen(true);
}

Window::~Window() = default;

void Window::make_current() {
  glfwMakeContextCurrent(implementation_->window.get());
  set_current_gl(&implementation_->functions);
}

bool Window::available() { return is_set("DISPLAY") || is_set("WAYLAND_DISPLAY"); }

std::vector<KeyEvent> Window::poll() {
  Implementation& self = *implementation_;
  ImGui::SetCurrentContext(self.interface);
  self.scroll = 0;
  glfwPollEvents();
  self.last_scroll = self.scroll;
  return std::exchange(self.keys, {});
}

bool Window::closing() const { return glfwWindowShouldClose(implementation_->window.get()); }

void Window::close() { glfwSetWindowShouldClose(implementation_->window.get(), GLFW_TRUE); }

bool Window::key_down(int key) const {
  if (ImGui::GetIO().WantTextInput) return false;
  return glfwGetKey(implementation_->window.get(), key) == GLFW_PRESS;
}

PointerState Window::pointer() const {
  GLFWwindow* window = implementation_->window.get();
  PointerState out;
  glfwGetCursorPos(window, &out.x, &out.y);
  const double ratio = implementation_->pixel_ratio();
  out.x *= ratio;
  out.y *= ratio;
  out.pressed_x = ratio * implementation_->pressed_x;
  out.pressed_y = ratio * implementation_->pressed_y;
  out.scroll = implementation_->last_scroll;
  out.left = glfwGetMouseButton(window, GLFW_MOUSE_BUTTON_LEFT) == GLFW_PRESS;
  out.middle = glfwGetMouseButton(window, GLFW_MOUSE_BUTTON_MIDDLE) == GLFW_PRESS;
  out.right = glfwGetMouseButton(window, GLFW_MOUSE_BUTTON_RIGHT) == GLFW_PRESS;
  return out;
}

int Window::framebuffer_width() const {
  int width = 0, height = 0;
  glfwGetFramebufferSize(implementation_->window.get(), &width, &height);
  return width;
}

int Window::framebuffer_height() const {
  int width = 0, height = 0;
  glfwGetFramebufferSize(implementation_->window.get(), &width, &height);
  return height;
}

float Window::content_scale() const { return implementation_->scale(); }

void Window::set_full_screen(bool on) {
  Implementation& self = *implementation_;
  if (on == self.full_screen) return;
  GLFWwindow* window = self.window.get();
  if (on) {
    self.windowed = geometry();
    GLFWmonitor* monitor = screen_of(self.windowed);
    if (monitor == nullptr) monitor = glfwGetPrimaryMonitor();
    const GLFWvidmode* mode = monitor != nullptr ? glfwGetVideoMode(monitor) : nullptr;
    if (mode == nullptr) return;
    glfwSetWindowMonitor(window, monitor, 0, 0, mode->width, mode->height, mode->refreshRate);
  } else {
    glfwSetWindowMonitor(window, nullptr, std::max(0, self.windowed.x), std::max(0, self.windowed.y),
                         self.windowed.width, self.windowed.height, GLFW_DONT_CARE);
  }
  self.full_screen = on;
}

WindowGeometry Window::geometry() const {
  const Implementation& self = *implementation_;
  WindowGeometry out = self.windowed;  // while full screen: what it goes back to
  if (!self.full_screen) {
    glfwGetWindowPos(self.window.get(), &out.x, &out.y);
    glfwGetWindowSize(self.window.get(), &out.width, &out.height);
  }
  out.full_screen = self.full_screen;
  return out;
}

void Window::set_title(const std::string& title) { glfwSetWindowTitle(implementation_->window.get(), title.c_str()); }

void Window::begin_interface() {
  Implementation& self = *implementation_;
  ImGui::SetCurrentContext(self.interface);
  self.load_fonts();  // moved to another screen?
  ImGui_ImplGlfw_NewFrame();
  ImGui::NewFrame();
}

void Window::end_interface() { ImGui::Render(); }

void Window::swap() { glfwSwapBuffers(implementation_->window.get()); }

}  // namespace parallax
