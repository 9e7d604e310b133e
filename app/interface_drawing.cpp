#include "app/interface_drawing.h"

#include <algorithm>
#include <cmath>

namespace parallax {
namespace {

float size_or_own(float size) { return size > 0 ? size : ImGui::GetFontSize(); }

}  // namespace

ImU32 interface_colour(const DrawColour& colour) {
  const auto byte = [](float part) { return static_cast<int>(std::lround(255 * std::clamp(part, 0.0f, 1.0f))); };
  return IM_COL32(byte(colour.r), byte(colour.g), byte(colour.b), byte(colour.a));
}

ImVec2 text_extent(const std::string& text, float size, float wrap) {
  constexpr float kNoEnd = 1e9f;
  return ImGui::GetFont()->CalcTextSizeA(size_or_own(size), kNoEnd, wrap, text.c_str());
}

void text_at(ImDrawList* list, float x, float y, ImU32 colour, const std::string& text, float size, float wrap) {
  list->AddText(ImGui::GetFont(), size_or_own(size), {std::floor(x), std::floor(y)}, colour, text.c_str(), nullptr,
                wrap);
}

void text_on_ground(ImDrawList* list, float x, float y, const std::string& text, float edge_x, float edge_y, float size,
                    float wrap) {
  const ImVec2 extent = text_extent(text, size, wrap);
  list->AddRectFilled({x - edge_x, y - edge_y}, {x + extent.x + edge_x, y + extent.y + edge_y}, kInterfaceGround,
                      0.25f * ImGui::GetFontSize());
  text_at(list, x, y, kInterfaceText, text, size, wrap);
}

void filled_bar(ImDrawList* list, ImVec2 from, ImVec2 to, float share, ImU32 colour, float rounding) {
  list->AddRectFilled(from, to, kInterfaceGauge, rounding);
  const float filled = std::clamp(share, 0.0f, 1.0f) * (to.x - from.x);
  if (filled >= 1) list->AddRectFilled(from, {from.x + filled, to.y}, colour, rounding);
}

}  // namespace parallax
