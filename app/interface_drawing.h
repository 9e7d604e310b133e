// Small things that are drawn over a picture with Dear ImGui in more than one place: text on a dark ground, gauges,
// colours.
//
// Between ImGui::NewFrame() and ImGui::Render(), on the thread of the current context. Lengths are ImGui's display
// units; text is as high as the current font unless a size is said.
#pragma once

#include <imgui.h>

#include <string>

#include "render/draw_list.h"

namespace parallax {

inline constexpr ImU32 kInterfaceText = IM_COL32(240, 240, 240, 255);
inline constexpr ImU32 kInterfaceGround = IM_COL32(12, 14, 18, 190);
inline constexpr ImU32 kInterfaceGauge = IM_COL32(70, 74, 82, 255);  // the empty part
inline constexpr ImU32 kInterfaceAmber = IM_COL32(255, 190, 60, 255);

ImU32 interface_colour(const DrawColour& colour);

// `size` 0: the font's own; `wrap` 0: on one line.
ImVec2 text_extent(const std::string& text, float size = 0, float wrap = 0);
// At a whole pixel, as letters need it.
void text_at(ImDrawList* list, float x, float y, ImU32 colour, const std::string& text, float size = 0, float wrap = 0);
// Text with its upper left corner there, on a dark ground that reaches `edge_x` and `edge_y` beyond it.
void text_on_ground(ImDrawList* list, float x, float y, const std::string& text, float edge_x, float edge_y,
                    float size = 0, float wrap = 0);
// A bar, filled from the left; `share` 0..1, what lies beyond is clamped.
void filled_bar(ImDrawList* list, ImVec2 from, ImVec2 to, float share, ImU32 colour, float rounding);

}  // namespace parallax
