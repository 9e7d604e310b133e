#include "app/first_run.h"

#include <imgui.h>

#include <algorithm>

namespace parallax {

FirstRunChoice draw_first_run(const std::string& camera) {
  const ImVec2 display = ImGui::GetIO().DisplaySize;
  const float font = ImGui::GetFontSize();
  FirstRunChoice choice = FirstRunChoice::none;
  ImGui::SetNextWindowPos({display.x / 2, display.y / 2}, ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::SetNextWindowSize({std::min(30 * font, display.x - font), 0});
  ImGui::SetNextWindowBgAlpha(0.92f);
  ImGui::Begin("First time with this camera", nullptr,
               ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoResize |
                   ImGuiWindowFlags_NoSavedSettings);
  ImGui::PushTextWrapPos(0);
  ImGui::TextUnformatted(camera.c_str());
  ImGui::Spacing();
  ImGui::TextUnformatted(
      "Nothing is known of its lens yet. Things stay where they are put only as well as the lens is known.");
  ImGui::PopTextWrapPos();
  ImGui::Spacing();
  const ImVec2 button{-1, 2.2f * font};
  if (ImGui::Button("Calibrate now (two minutes, a printed board)", button)) choice = FirstRunChoice::calibrate;
  ImGui::Spacing();
  if (ImGui::Button("Go on with an estimated wide-angle lens", button)) choice = FirstRunChoice::estimate;
  ImGui::PushTextWrapPos(0);
  ImGui::PushStyleColor(ImGuiCol_Text, {0.75f, 0.77f, 0.8f, 1});
  ImGui::TextUnformatted("The state line says so as long as the lens is estimated. It can be calibrated at any time.");
  ImGui::PopStyleColor();
  ImGui::PopTextWrapPos();
  ImGui::End();
  return choice;
}

}  // namespace parallax
