#include <imgui.h>

#include <algorithm>

#include "app/panels_draw.h"

namespace parallax {

bool begin_panel(const char* title, bool* open, int column, float width_in_fonts) {
  const ImVec2 display = ImGui::GetIO().DisplaySize;
  const float font = ImGui::GetFontSize();
  const float margin = 0.5f * font, top = 2 * font;
  const float width = std::min(width_in_fonts * font, display.x - 2 * margin);
  const float x = column == 0 ? margin : display.x - width - margin;
  ImGui::SetNextWindowPos({x, top}, ImGuiCond_Appearing);
  ImGui::SetNextWindowSizeConstraints({8 * font, 3 * font}, {width, std::max(6 * font, display.y - top - 2.5f * font)});
  ImGui::SetNextWindowSize({width, 0}, ImGuiCond_Appearing);
  ImGui::SetNextWindowBgAlpha(0.86f);
  return ImGui::Begin(title, open, ImGuiWindowFlags_NoSavedSettings);
}

bool draw_task(LiveState* state) {
  if (!state->typing()) return false;
  const ImVec2 display = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({display.x / 2, display.y * 0.75f}, ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::SetNextWindowBgAlpha(0.9f);
  bool entered = false;
  ImGui::Begin("##task", nullptr,
               ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoSavedSettings |
                   ImGuiWindowFlags_NoMove);
  if (state->focus_text) ImGui::SetKeyboardFocusHere();
  state->focus_text = false;
  ImGui::SetNextItemWidth(12 * ImGui::GetFontSize());
  const char* name = state->task == Task::write_label ? "label" : "cm between the points";
  entered = ImGui::InputText(name, state->text.data(), state->text.size(),
                             ImGuiInputTextFlags_EnterReturnsTrue | ImGuiInputTextFlags_AutoSelectAll);
  ImGui::SameLine();
  if (ImGui::Button("OK")) entered = true;
  ImGui::SameLine();
  if (ImGui::Button("Cancel") && !entered) state->task = Task::none;
  ImGui::End();
  return entered;
}

void draw_toasts(LiveState* state) {
  const ImVec2 display = ImGui::GetIO().DisplaySize;
  const float font = ImGui::GetFontSize();
  float y = display.y - 2.2f * font;
  int index = 0;
  const auto& toasts = state->toasts.current();
  for (auto it = toasts.rbegin(); it != toasts.rend(); ++it) {
    ImGui::SetNextWindowPos({display.x / 2, y}, ImGuiCond_Always, {0.5f, 1.0f});
    ImGui::SetNextWindowBgAlpha(0.8f);
    const std::string name = "##toast" + std::to_string(index++);
    ImGui::Begin(name.c_str(), nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoInputs | ImGuiWindowFlags_AlwaysAutoResize |
                     ImGuiWindowFlags_NoFocusOnAppearing | ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoNav);
    if (it->problem) ImGui::PushStyleColor(ImGuiCol_Text, {1, 0.6f, 0.4f, 1});
    ImGui::PushTextWrapPos(display.x * 0.8f);
    ImGui::TextUnformatted(it->text.c_str());
    ImGui::PopTextWrapPos();
    if (it->problem) ImGui::PopStyleColor();
    y -= ImGui::GetWindowSize().y + 0.3f * font;
    ImGui::End();
  }
}

}  // namespace parallax
