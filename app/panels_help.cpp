#include <imgui.h>

#include "app/panels_draw.h"

namespace parallax {

void draw_help_panel(LiveState* state) {
  if (!begin_panel("Help", &state->panels.help, 0, 27)) return ImGui::End();
  ImGui::PushTextWrapPos(0);
  ImGui::TextUnformatted(
      "Point the camera at a table with some texture. Press Space, slide the camera sideways by a hand's width, press "
      "Space again: the grid lies on the table.");
  ImGui::PopTextWrapPos();
  ImGui::Separator();
  if (ImGui::BeginTable("keys", 2)) {
    ImGui::TableSetupColumn("key", ImGuiTableColumnFlags_WidthFixed);
    ImGui::TableSetupColumn("action", ImGuiTableColumnFlags_WidthStretch);
    for (int i = 0; i < kActions; ++i) {
      const auto action = static_cast<Action>(i);
      ImGui::TableNextRow();
      ImGui::TableNextColumn();
      ImGui::TextUnformatted(state->settings.keys.chord_names(action).c_str());
      ImGui::TableNextColumn();
      ImGui::TextWrapped("%s", action_help(action));
    }
    ImGui::EndTable();
  }
  ImGui::Separator();
  ImGui::PushTextWrapPos(0);
  ImGui::TextUnformatted(
      "Click selects a label or model, dragging moves it. The synthetic camera turns when the picture is dragged, and "
      "goes forward with the wheel. In the map view: drag turns, right drag pans, the wheel zooms, a click picks a "
      "keyframe.");
  for (const std::string& remark : state->settings.key_remarks) ImGui::TextUnformatted(remark.c_str());
  const std::string path = settings_path();
  if (!path.empty()) ImGui::Text("Keys are changed in %s", path.c_str());
  ImGui::PopTextWrapPos();
  ImGui::End();
}

}  // namespace parallax
