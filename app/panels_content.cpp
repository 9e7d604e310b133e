#include <imgui.h>

#include <cstring>

#include "app/panels_draw.h"

namespace parallax {

void draw_content_panel(LiveState* state, const LiveFrame* frame) {
  if (!begin_panel("Labels and models", &state->panels.content, 1, 20)) return ImGui::End();
  const KeyBindings& keys = state->settings.keys;
  ImGui::PushTextWrapPos(0);
  ImGui::Text("%s: a label, %s: a model where the cursor points; %s removes it.",
              keys.chord_names(Action::label).c_str(), keys.chord_names(Action::model).c_str(),
              keys.chord_names(Action::erase).c_str());
  ImGui::PopTextWrapPos();
  if (state->content.items().empty()) ImGui::TextUnformatted("nothing placed on this map");
  std::optional<int> erased;
  for (const ContentItem& item : state->content.items()) {
    ImGui::PushID(item.id);
    std::array<char, 64> text{};
    std::strncpy(text.data(), item.text.c_str(), text.size() - 1);
    if (ImGui::RadioButton("##selected", state->selected == item.id)) state->selected = item.id;
    ImGui::SameLine();
    if (item.kind == ContentKind::label) {
      ImGui::SetNextItemWidth(9 * ImGui::GetFontSize());
      if (ImGui::InputText("##text", text.data(), text.size())) {
        state->content.rename(item.id, text.data());
        ImGui::PopID();
        break;  // the list has changed
      }
    } else if (item.kind == ContentKind::model) {
      ImGui::TextUnformatted(item.text.c_str());
      ImGui::SameLine();
      float size_cm = static_cast<float>(item.size_m * 100);
      ImGui::SetNextItemWidth(6 * ImGui::GetFontSize());
      if (ImGui::DragFloat("cm", &size_cm, 0.1f, 0.5f, 200, "%.1f")) {
        state->content.resize(item.id, std::clamp(size_cm, 0.5f, 200.0f) / 100.0);
        ImGui::PopID();
        break;
      }
    } else {
      ImGui::Text("%.1f cm", item.length_m() * 100);
    }
    ImGui::SameLine();
    if (ImGui::SmallButton("x")) erased = item.id;
    ImGui::PopID();
  }
  if (erased) state->content.erase(*erased);
  if (state->content.parked() > 0) {
    ImGui::Text("%d placed on maps that were forgotten", state->content.parked());
    ImGui::SameLine();
    if (ImGui::SmallButton("drop them")) state->content.clear_parked();
  }
  ImGui::End();
}

}  // namespace parallax
