#include <imgui.h>

#include <algorithm>
#include <cmath>

#include "app/panels_draw.h"

namespace parallax {

namespace {
// A panel opens below the hint and its gauge, in heights of the font.
constexpr float kBelowHint = 3.9f;
constexpr ImU32 kToast = IM_COL32(12, 14, 18, 225), kNews = IM_COL32(255, 255, 255, 255),
                kProblem = IM_COL32(255, 153, 102, 255);
}  // namespace

bool begin_panel(const char* title, bool* open, int column, float width_in_fonts) {
  const ImVec2 display = ImGui::GetIO().DisplaySize;
  const float font = ImGui::GetFontSize();
  const float margin = 0.5f * font, top = std::min(kBelowHint * font, 0.15f * display.y);
  const float width = std::min(width_in_fonts * font, display.x - 2 * margin);
  const float x = column == 0 ? margin : display.x - width - margin;
  ImGui::SetNextWindowPos({x, top}, ImGuiCond_Appearing);
  ImGui::SetNextWindowSizeConstraints({8 * font, 3 * font}, {width, std::max(6 * font, display.y - top - 2.5f * font)});
  ImGui::SetNextWindowSize({width, 0}, ImGuiCond_Always);  // as high as what it holds
  ImGui::SetNextWindowBgAlpha(0.86f);
  return ImGui::Begin(title, open, ImGuiWindowFlags_NoSavedSettings);
}

bool draw_task(LiveState* state) {
  if (state->task == Task::none) return false;
  const ImVec2 display = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({display.x / 2, display.y * 0.75f}, ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::SetNextWindowBgAlpha(0.9f);
  bool entered = false;
  ImGui::Begin("##task", nullptr,
               ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoSavedSettings |
                   ImGuiWindowFlags_NoMove);
  if (!state->typing()) {
    ImGui::TextUnformatted(state->task == Task::measure_first ? "Click the first of two points whose distance you know"
                                                              : "Click the second point");
    ImGui::SameLine();
    if (ImGui::Button("Cancel")) state->task = Task::none;
    ImGui::End();
    return false;
  }
  // The keyboard is the text's until the task ends, also after a click beside it or an Enter that was refused.
  if (state->focus_text || !ImGui::IsAnyItemActive()) ImGui::SetKeyboardFocusHere();
  state->focus_text = false;
  ImGui::SetNextItemWidth(12 * ImGui::GetFontSize());
  const char* name = state->task == Task::write_label ? "label"
                     : state->task == Task::name_map  ? "name of the map"
                                                      : "cm between the points";
  entered = ImGui::InputText(name, state->text.data(), state->text.size(),
                             ImGuiInputTextFlags_EnterReturnsTrue | ImGuiInputTextFlags_AutoSelectAll);
  ImGui::SameLine();
  if (ImGui::Button("OK")) entered = true;
  ImGui::SameLine();
  if (ImGui::Button("Cancel") && !entered) state->task = Task::none;
  ImGui::End();
  return entered;
}

// Over the panels.
void draw_toasts(LiveState* state) {
  const ImVec2 display = ImGui::GetIO().DisplaySize;
  const float font = ImGui::GetFontSize(), wrap = 0.8f * display.x, padding = 0.5f * font;
  ImDrawList* list = ImGui::GetForegroundDrawList();
  float bottom = display.y - 2.2f * font;
  const auto& toasts = state->toasts.current();
  for (auto it = toasts.rbegin(); it != toasts.rend(); ++it) {
    const ImVec2 size = ImGui::CalcTextSize(it->text.c_str(), nullptr, false, wrap);
    const float left = std::floor((display.x - size.x) / 2), top = std::floor(bottom - padding - size.y);
    list->AddRectFilled({left - padding, top - padding}, {left + size.x + padding, top + size.y + padding}, kToast,
                        0.3f * font);
    list->AddText(ImGui::GetFont(), font, {left, top}, it->problem ? kProblem : kNews, it->text.c_str(), nullptr, wrap);
    bottom = top - padding - 0.3f * font;
  }
}

}  // namespace parallax
