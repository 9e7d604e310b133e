#include <imgui.h>

#include "app/panels_draw.h"

namespace parallax {

void draw_map_panel(LiveState* state, LiveEngine* engine, const LiveFrame* frame) {
  if (!begin_panel("Map", &state->panels.map, 1, 20)) return ImGui::End();
  const bool mapped = frame != nullptr && frame->map && !frame->map->empty();
  if (mapped) {
    const std::size_t planes = frame->map->planes.size();
    ImGui::Text("%zu keyframes, %d points, %zu plane%s", frame->map->keyframes.size(), frame->map->size(), planes,
                planes == 1 ? "" : "s");
  } else {
    ImGui::TextUnformatted("no map yet");
  }
  ImGui::Separator();
  ImGui::TextUnformatted("Show");
  ImGui::Checkbox("points", &state->view.points);
  ImGui::SameLine();
  ImGui::Checkbox("missed", &state->view.missed_points);
  ImGui::SameLine();
  ImGui::Checkbox("grid", &state->view.grid);
  ImGui::Checkbox("other planes", &state->view.other_planes);
  ImGui::SameLine();
  ImGui::Checkbox("content", &state->view.content);
  ImGui::SameLine();
  ImGui::Checkbox("cross-hair", &state->view.crosshair);
  ImGui::Separator();
  ImGui::BeginDisabled(!mapped);
  if (ImGui::Button("Find the table again")) state->requests.find_plane = true;
  ImGui::TextUnformatted("Scale");
  if (ImGui::Button("Two points and their distance")) state->requests.measure = true;
  ImGui::SetNextItemWidth(6 * ImGui::GetFontSize());
  ImGui::InputDouble("cm: side of a marker", &state->marker_cm, 0, 0, "%.2f");
  ImGui::EndDisabled();
  ImGui::SameLine();
  if (ImGui::Button("Print")) state->requests.print_marker = true;
  ImGui::BeginDisabled(!mapped);
  if (ImGui::Button("Take the scale from the marker")) state->requests.marker = true;
  ImGui::Separator();
  if (ImGui::Button("Forget the map")) state->requests.reset = true;
  ImGui::EndDisabled();
  ImGui::SameLine();
  if (ImGui::Button("All maps")) state->requests.maps = true;
  ImGui::End();
}

}  // namespace parallax
