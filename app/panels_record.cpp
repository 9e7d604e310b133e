#include <imgui.h>

#include "app/panels_draw.h"

namespace parallax {

void draw_record_panel(LiveState* state, LiveEngine* engine) {
  if (!begin_panel("Recording", &state->panels.record, 1, 22)) return ImGui::End();
  const KeyBindings& keys = state->settings.keys;
  if (ImGui::Button("Screenshot")) state->requests.screenshot = true;
  ImGui::SameLine();
  ImGui::TextUnformatted(keys.chord_names(Action::screenshot).c_str());
  if (ImGui::Button(state->video_running ? "End the video" : "Video of the window")) state->requests.video = true;
  ImGui::SameLine();
  ImGui::TextUnformatted(keys.chord_names(Action::video).c_str());
  ImGui::TextWrapped("into %s and %s", state->picture_folder.c_str(), state->video_folder.c_str());
  ImGui::Separator();
  if (engine->session() != nullptr) {
    const LiveSession::Statistics statistics = engine->session()->statistics();
    if (statistics.recording) {
      ImGui::TextWrapped("recording the session into %s", engine->record_path().c_str());
      ImGui::Text("%d frames, %d not kept", statistics.frames_read, statistics.recorder_frames_dropped);
      if (ImGui::Button("End the recording (the map starts anew)")) state->requests.record = true;
    } else {
      ImGui::TextWrapped(
          "A recording of the session keeps every frame as it came; `parallax run FILE` plays it again.");
      if (ImGui::Button("Record (the map starts anew)")) state->requests.record = true;
    }
  }
  ImGui::End();
}

}  // namespace parallax
