#include <imgui.h>

#include <algorithm>

#include "app/panels_draw.h"
#include "core/error.h"

namespace parallax {

namespace {

constexpr std::chrono::seconds kAskControls{2};

void draw_control(const CameraControl& control, LiveState* state, LiveCamera* camera) {
  ImGui::PushID(control.name.c_str());
  std::int64_t value = control.value;
  bool changed = false;
  ImGui::BeginDisabled(control.read_only || control.inactive);
  if (!control.menu.empty()) {
    const auto now =
        std::find_if(control.menu.begin(), control.menu.end(), [&](const auto& m) { return m.first == value; });
    if (ImGui::BeginCombo("##value", now == control.menu.end() ? "" : now->second.c_str())) {
      for (const auto& [key, text] : control.menu) {
        if (!ImGui::Selectable(text.c_str(), key == value)) continue;
        value = key;
        changed = true;
      }
      ImGui::EndCombo();
    }
  } else if (control.minimum == 0 && control.maximum == 1) {
    bool on = value != 0;
    changed = ImGui::Checkbox("##value", &on);
    value = on ? 1 : 0;
  } else {
    changed = ImGui::SliderScalar("##value", ImGuiDataType_S64, &value, &control.minimum, &control.maximum);
  }
  ImGui::EndDisabled();
  ImGui::PopID();
  if (!changed) return;
  try {
    camera->set_control(control.name, value);
  } catch (const std::exception& e) {
    state->toasts.add(e.what(), true);
  }
  state->controls_time = {};
}

void draw_controls(LiveState* state, LiveCamera* camera) {
  const auto now = SteadyClock::now();
  if (now - state->controls_time > kAskControls) {
    state->controls = camera->controls();
    state->controls_time = now;
  }
  if (state->controls.empty()) {
    ImGui::TextUnformatted("This camera has no controls.");
    return;
  }
  if (!ImGui::BeginTable("controls", 2)) return;
  const std::vector<CameraControl> controls = state->controls;
  for (const CameraControl& control : controls) {
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    ImGui::AlignTextToFramePadding();
    ImGui::TextUnformatted(control.name.c_str());
    ImGui::TableNextColumn();
    ImGui::SetNextItemWidth(-1);
    draw_control(control, state, camera);
  }
  ImGui::EndTable();
}

}  // namespace

void draw_camera_panel(LiveState* state, LiveEngine* engine) {
  if (!begin_panel("Camera", &state->panels.camera, 1, 24)) return ImGui::End();
  if (!engine->is_open()) {
    ImGui::TextUnformatted("opening the camera");
    return ImGui::End();
  }
  const LiveSource& source = engine->source();
  const CameraStatus status = engine->feed().status();
  ImGui::TextWrapped("%s", source.name.c_str());
  ImGui::TextWrapped("%s", source.identity.c_str());
  ImGui::Text("%d x %d, %.1f of %.0f frames a second", source.width, source.height, status.measured_fps,
              status.requested_fps);
  if (!status.fps_reason.empty()) ImGui::TextWrapped("slow: %s", status.fps_reason.c_str());
  if (status.skipped > 0) ImGui::Text("%llu frames skipped", static_cast<unsigned long long>(status.skipped));
  if (!status.text.empty()) ImGui::TextWrapped("%s", status.text.c_str());
  if (engine->session() != nullptr) {
    const CameraModel& lens = engine->lens();
    ImGui::Text("lens: %s, focal length %.1f px%s", to_string(lens.kind()), lens.mean_focal_px(),
                engine->lens_is_estimated() ? " (estimated)" : "");
  }
  if (ImGui::Button("Calibrate...")) state->requests.calibrate = true;
  ImGui::Separator();
  if (source.camera != nullptr) draw_controls(state, source.camera);
  ImGui::End();
}

}  // namespace parallax
