#include <imgui.h>

#include <algorithm>

#include "app/game_session.h"
#include "app/panels_draw.h"

namespace parallax {

void draw_debug_panel(LiveState* state, LiveEngine* engine, const LiveFrame* frame) {
  if (!begin_panel("Timings", &state->panels.debug, 0, 27)) return ImGui::End();
  ImGui::Text("window: %.1f ms to draw (slowest %.0f), %.1f a second", state->drawing_ms, state->slowest_draw_ms,
              state->frame_interval_ms > 0 ? 1000 / state->frame_interval_ms : 0.0);
  if (state->latency.capture_to_display_s() > 0) {
    ImGui::Text("latency: %.0f ms from %s to display", 1e3 * state->latency.capture_to_display_s(),
                state->latency.exact() ? "capture" : "the fastest arrival");
    ImGui::Text("games: aim predicted %.0f ms ahead",
                1e3 * std::min(state->latency.horizon_s(), kFarthestPrediction_s));
  }
  if (engine->is_open()) {
    const CameraStatus status = engine->feed().status();
    ImGui::Text("camera: %.1f a second", status.measured_fps);
  }
  if (engine->session() != nullptr) {
    const LiveSession::Statistics statistics = engine->session()->statistics();
    ImGui::Text("frames: %d read, %d dropped", statistics.frames_read, statistics.frames_dropped);
  }
  if (frame != nullptr) {
    const TrackingResult& t = frame->tracked;
    ImGui::Text("tracking: %.1f a second", frame->frames_per_second);
    const std::pair<const char*, float> rows[] = {{"features", t.times.features}, {"projection", t.times.projection},
                                                  {"search", t.times.search},     {"pose", t.times.pose},
                                                  {"recovery", t.times.recovery}, {"total", t.times.total},
                                                  {"processor", t.times.cpu}};
    for (const auto& [name, ms] : rows) ImGui::Text("  %-10s %6.2f ms", name, static_cast<double>(ms));
    ImGui::Text("sigma %.2f, coarse stage %s", t.sigma, t.coarse_stage ? "on" : "off");
    for (int level = 0; level < kPyramidLevels; ++level) {
      const auto i = static_cast<std::size_t>(level);
      ImGui::Text("  level %d: %d of %d found", level, t.found[i], t.attempted[i]);
    }
  }
  ImGui::End();
}

}  // namespace parallax
