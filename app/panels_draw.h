// The panels of the live window. Each draws itself with Dear ImGui between NewFrame and Render, closes itself, and
// leaves what it wants done in LiveState::requests. Laid out to be usable at 640x480. The window's thread.
#pragma once

#include "app/live_engine.h"
#include "app/live_state.h"

namespace parallax {

// Null where nothing was tracked yet.
void draw_help_panel(LiveState* state);
void draw_camera_panel(LiveState* state, LiveEngine* engine);
void draw_map_panel(LiveState* state, LiveEngine* engine, const LiveFrame* frame);
void draw_content_panel(LiveState* state, const LiveFrame* frame);
void draw_record_panel(LiveState* state, LiveEngine* engine);
void draw_debug_panel(LiveState* state, LiveEngine* engine, const LiveFrame* frame);

// The text field or the question of the present task; true when the task ended with Enter.
bool draw_task(LiveState* state);
void draw_toasts(LiveState* state);

// Begins a panel at a corner of the display that fits small windows: column 0 left, 1 right. Ends with ImGui::End().
// False when folded.
bool begin_panel(const char* title, bool* open, int column, float width_in_fonts);

}  // namespace parallax
