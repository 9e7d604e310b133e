#include "app/session_view.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <imgui.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <exception>
#include <optional>
#include <utility>

#include "app/session_report_data.h"
#include "app/session_view_drawing.h"
#include "core/error.h"
#include "render/scene_renderer.h"
#include "render/window.h"

namespace parallax {
namespace {

constexpr std::chrono::milliseconds kWaitForNews{30};
constexpr std::chrono::milliseconds kRedraw{200};  // for the clocks of the interface, when nothing is new
// Where the processor draws, the run has most of it: after drawing that took so long it is left alone for that many
// times as long.
constexpr int kRestShare = 5;
constexpr std::size_t kMostImages = 4;
constexpr int kFirstImageKey = 1;
constexpr float kImageWidth = 240;

ImVec4 text_colour(CanvasColour c) {
  const auto part = [](int value) { return static_cast<float>(60 + value * 195 / 255) / 255.0f; };
  return {part(c.red), part(c.green), part(c.blue), 1};
}

class SessionViewWindow {
 public:
  SessionViewWindow(SessionFeed* feed, const std::vector<std::string>& names)
      : feed_(feed), names_(names), window_("Parallax: sessions", {}), snapshot_(feed->snapshot()) {
    orbit_.camera.yaw = -1.2;
    orbit_.camera.pitch = 0.9;
  }

  // Until it is closed.
  void show(const std::atomic<bool>& over) {
    auto last_draw = SteadyClock::time_point();
    SteadyClock::duration took{0};  // the last drawing
    bool wanted = false;            // the user has done something since
    while (!window_.closing()) {
      const bool input = take_input();
      const std::uint64_t version = feed_->version();
      over_ = over;
      const bool news = !held_ && version != version_;
      wanted |= input;
      const auto since = SteadyClock::now() - last_draw;
      if ((wanted && since > took) || (news && since > kRestShare * took) || since > kRedraw + kRestShare * took) {
        if (!held_) {
          version_ = version;
          snapshot_ = feed_->snapshot();
          images_ = feed_->images();
        }
        const auto begin = SteadyClock::now();
        draw();
        last_draw = SteadyClock::now();
        took = last_draw - begin;
        wanted = false;
      } else if (news) {
        feed_->wait_newer(version, kWaitForNews);
      } else {
        feed_->wait_newer(held_ ? version : version_, kWaitForNews);
      }
    }
  }

 private:
  bool take_input() {
    bool any = false;
    for (const KeyEvent& event : window_.poll()) {
      if (!event.pressed) continue;
      any = true;
      switch (event.key) {
        case GLFW_KEY_ESCAPE:
        case GLFW_KEY_Q:
          window_.close();
          break;
        case GLFW_KEY_E:
          settings_.elevation = !settings_.elevation;
          fitted_ = false;
          break;
        case GLFW_KEY_C:
          settings_.ellipses = !settings_.ellipses;
          break;
        case GLFW_KEY_L:
          settings_.links = !settings_.links;
          break;
        case GLFW_KEY_P:
          settings_.points = !settings_.points;
          break;
        case GLFW_KEY_F:
          fitted_ = false;
          orbit_.camera.turned = false;
          break;
        case GLFW_KEY_SPACE:
          held_ = !held_;
          break;
        case GLFW_KEY_F1:
        case GLFW_KEY_H:
          help_ = !help_;
          break;
        default:
          any = false;
      }
    }
    const PointerState p = window_.pointer();
    const bool moved = p.scroll != 0 || ((p.left || p.middle || p.right) && (p.x != pointer_.x || p.y != pointer_.y));
    scroll_ += p.scroll;
    pointer_ = p;
    return any || moved;
  }

  void point_camera() {
    if (ImGui::GetIO().WantCaptureMouse) {
      orbit_.release();
      scroll_ = 0;
      return;
    }
    const OrbitCamera before = orbit_.camera;
    const bool shift = window_.key_down(GLFW_KEY_LEFT_SHIFT) || window_.key_down(GLFW_KEY_RIGHT_SHIFT);
    orbit_.update({pointer_.x, pointer_.y, scroll_, pointer_.left, pointer_.middle, pointer_.right, shift},
                  window_.framebuffer_height());
    scroll_ = 0;
    if (before.distance != orbit_.camera.distance || before.target != orbit_.camera.target) follow_ = false;
  }

  void draw() {
    const int width = window_.framebuffer_width(), height = window_.framebuffer_height();
    if (width <= 0 || height <= 0) return;
    window_.begin_interface();
    point_camera();
    const SessionStage stage(*snapshot_, settings_.elevation);
    if (!fitted_) follow_ = true;
    if (follow_) orbit_.camera = fit_to_sessions(stage, orbit_.camera);
    fitted_ = true;
    renderer_.draw(session_view_list(*snapshot_, settings_, orbit_.camera, width, height), {0, 0, width, height});
    draw_images();
    draw_sessions_panel(stage);
    if (help_) draw_help();
    window_.end_interface();
    renderer_.draw_interface(*ImGui::GetDrawData(), width, height);
    window_.swap();
  }

  static bool begin_corner(const char* title, ImVec2 corner, ImVec2 pivot) {
    ImGui::SetNextWindowPos(corner, ImGuiCond_Always, pivot);
    ImGui::SetNextWindowBgAlpha(0.8f);
    return ImGui::Begin(
        title, nullptr,
        ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoFocusOnAppearing);
  }

  // The newest images of those that have moved on last; a few are enough to look at.
  void draw_images() {
    const ImVec2 display = ImGui::GetIO().DisplaySize;
    if (begin_corner("Cameras", {display.x - 8, 8}, {1, 0})) {
      const float width = std::min(kImageWidth, 0.28f * display.x);
      std::size_t shown = 0;
      for (std::size_t i = images_.size(); i-- > 0 && shown < kMostImages;) {
        const SessionImage& image = images_[i];
        if (image.picture.empty()) continue;
        ++shown;
        void* texture = renderer_.picture(kFirstImageKey + static_cast<int>(i), image.picture);
        ImGui::Text("%s  frame %d  %s  %d features", names_[i].c_str(), image.frame, image.state.c_str(), image.tracks);
        ImGui::Image(texture,
                     {width, width * static_cast<float>(image.picture.rows) / static_cast<float>(image.picture.cols)});
      }
      if (shown == 0) ImGui::TextUnformatted("no image yet");
    }
    ImGui::End();
  }

  void draw_sessions_panel(const SessionStage& stage) {
    if (begin_corner("Sessions", {8, 8}, {0, 0})) {
      const SessionScene& scene = snapshot_->scene;
      for (const SceneSession& session : scene.sessions)
        ImGui::TextColored(text_colour(session.colour), "%s  %d poses  %.1f m  %.0f s", session.name.c_str(),
                           static_cast<int>(session.poses.size()), session.path_m(), session.seconds());
      if (scene.sessions.empty()) ImGui::TextUnformatted("none has begun yet");
      if (stage.components() > 1) ImGui::Text("%d parts have not met: they stand side by side", stage.components());
      int within = 0, between = 0;
      for (const SceneLink& link : scene.links) ++(link.within_session() ? within : between);
      ImGui::TextColored(text_colour(kWithinSessionColour), "loops within a session: %d", within);
      ImGui::TextColored(text_colour(kBetweenSessionsColour), "encounters between sessions: %d", between);
      ImGui::Text("not confirmed: %d, refused: %d", snapshot_->waiting, snapshot_->refused);
      ImGui::Separator();
      draw_loads();
      ImGui::Separator();
      if (over_) ImGui::TextUnformatted("all sessions have ended: q closes and writes what was asked for");
      if (held_) ImGui::TextUnformatted("the view is held, the run goes on: Space");
      ImGui::TextUnformatted(settings_.elevation ? "height is session time: e" : "F1: keys");
    }
    ImGui::End();
  }

  void draw_loads() {
    if (!ImGui::BeginTable("loads", 4, ImGuiTableFlags_SizingFixedFit)) return;
    const auto cell = [](const std::string& text) {
      ImGui::TableNextColumn();
      ImGui::TextUnformatted(text.c_str());
    };
    for (const char* title : {"milliseconds", "mean", "last", "worst"}) cell(title);
    for (int m = 0; m < kSessionModules; ++m) {
      const ModuleLoad& load = snapshot_->loads[static_cast<std::size_t>(m)];
      cell(name_of(static_cast<SessionModule>(m)));
      for (const double ms : {load.mean_ms, load.last_ms, load.worst_ms}) {
        std::array<char, 32> text{"-"};
        if (load.steps > 0) std::snprintf(text.data(), text.size(), "%.1f", ms);
        cell(text.data());
      }
    }
    ImGui::EndTable();
  }

  void draw_help() {
    const ImVec2 display = ImGui::GetIO().DisplaySize;
    if (begin_corner("Keys", {8, display.y - 8}, {0, 1})) {
      constexpr std::pair<const char*, const char*> keys[] = {{"drag", "turn"},
                                                              {"right drag, Shift and drag", "move"},
                                                              {"wheel", "nearer, farther"},
                                                              {"f", "all in sight, and kept so"},
                                                              {"e", "height grows with session time"},
                                                              {"c", "95 % ellipses of the places"},
                                                              {"l", "links: loops and encounters"},
                                                              {"p", "points of the map"},
                                                              {"Space", "hold the view; the run goes on"},
                                                              {"F1, h", "these keys"},
                                                              {"Esc, q", "close the view; the run goes on to its end"}};
      if (ImGui::BeginTable("keys", 2, ImGuiTableFlags_SizingFixedFit)) {
        for (const auto& [key, what] : keys) {
          ImGui::TableNextColumn();
          ImGui::TextUnformatted(key);
          ImGui::TableNextColumn();
          ImGui::TextUnformatted(what);
        }
        ImGui::EndTable();
      }
    }
    ImGui::End();
  }

  SessionFeed* feed_;
  std::vector<std::string> names_;
  Window window_;
  SceneRenderer renderer_;
  OrbitControl orbit_;
  SessionViewSettings settings_;
  std::shared_ptr<const SessionViewSnapshot> snapshot_;
  std::vector<SessionImage> images_;
  PointerState pointer_;
  double scroll_ = 0;
  std::uint64_t version_ = 0;
  bool held_ = false, help_ = true, fitted_ = false, follow_ = true, over_ = false;
};

}  // namespace

void watch_sessions(SessionFeed* feed, const std::vector<std::string>& names, const std::function<void()>& run) {
  std::optional<SessionViewWindow> window;
  try {
    window.emplace(feed, names);
  } catch (const RunError& e) {
    throw InputError(std::string("--view: found no display that shows a window, expected one (") + e.what() + ")");
  }
  std::atomic<bool> over = false;
  std::exception_ptr failure;
  {
    std::jthread running([&] {
      try {
        run();
      } catch (...) {
        failure = std::current_exception();
      }
      over = true;
      feed->wake();
    });
    window->show(over);
    window.reset();
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace parallax
