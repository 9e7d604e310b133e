#include "app/game_hud.h"

#include <imgui.h>

#include <algorithm>
#include <cmath>

namespace parallax {
namespace {

constexpr ImU32 kText = IM_COL32(245, 245, 245, 255);
constexpr ImU32 kShade = IM_COL32(8, 10, 14, 170);
constexpr ImU32 kGround = IM_COL32(70, 74, 82, 255);
constexpr ImU32 kHairs = IM_COL32(255, 255, 255, 220);
constexpr ImU32 kHairsEdge = IM_COL32(0, 0, 0, 160);
// Of the picture's height: the arms of the cross-hairs.
constexpr float kHairsLength = 0.035f, kHairsGap = 0.012f;
constexpr float kBig = 2.0f;      // of the font: score and messages
constexpr float kGaugeWidth = 7;  // in heights of the font

ImU32 colour_of(const DrawColour& c) {
  const auto byte = [](float part) { return static_cast<int>(std::lround(255 * std::clamp(part, 0.0f, 1.0f))); };
  return IM_COL32(byte(c.r), byte(c.g), byte(c.b), byte(c.a));
}

ImVec2 size_of(const std::string& text, float size, float wrap = 0) {
  return ImGui::GetFont()->CalcTextSizeA(size, 1e9f, wrap, text.c_str());
}

void shaded_text(ImDrawList* list, float x, float y, float size, const std::string& text, float wrap = 0) {
  const ImVec2 extent = size_of(text, size, wrap);
  const float edge = 0.25f * ImGui::GetFontSize();
  list->AddRectFilled({x - edge, y - edge / 2}, {x + extent.x + edge, y + extent.y + edge / 2}, kShade, edge);
  list->AddText(ImGui::GetFont(), size, {std::floor(x), std::floor(y)}, kText, text.c_str(), nullptr, wrap);
}

void draw_cross_hairs(ImDrawList* list, const PictureArea& a) {
  const float x = a.x + a.width / 2, y = a.y + a.height / 2;
  const float near = kHairsGap * a.height, far = near + kHairsLength * a.height;
  for (const float sign : {-1.0f, 1.0f}) {
    for (const auto& [colour, width] : {std::pair{kHairsEdge, 4.0f}, std::pair{kHairs, 1.5f}}) {
      list->AddLine({x + sign * near, y}, {x + sign * far, y}, colour, width);
      list->AddLine({x, y + sign * near}, {x, y + sign * far}, colour, width);
    }
  }
  list->AddCircleFilled({x, y}, 2.0f, kHairs);
}

}  // namespace

void draw_game_hud(const GameHudView& view) {
  ImDrawList* list = ImGui::GetBackgroundDrawList();
  const PictureArea& a = view.area;
  const float unit = ImGui::GetFontSize();
  if (view.hud.cross_hairs && view.status.empty()) draw_cross_hairs(list, a);

  const std::string score = std::to_string(view.hud.score);
  const ImVec2 score_size = size_of(score, kBig * unit);
  shaded_text(list, a.x + a.width - score_size.x - unit, a.y + 0.5f * unit, kBig * unit, score);

  float y = a.y + 0.5f * unit;
  for (const GameGauge& gauge : view.hud.gauges) {
    const float label = size_of(gauge.label, unit).x + 0.5f * unit, left = a.x + 0.75f * unit;
    list->AddRectFilled({left - 0.25f * unit, y}, {left + label + kGaugeWidth * unit + 0.25f * unit, y + 1.3f * unit},
                        kShade, 0.25f * unit);
    list->AddText(ImGui::GetFont(), unit, {std::floor(left), std::floor(y + 0.15f * unit)}, kText, gauge.label.c_str());
    const float from = left + label, top = y + 0.4f * unit, bottom = y + 0.9f * unit;
    const float part = static_cast<float>(std::clamp(gauge.value, 0.0, 1.0));
    list->AddRectFilled({from, top}, {from + kGaugeWidth * unit, bottom}, kGround, 0.2f * unit);
    if (part > 0)
      list->AddRectFilled({from, top}, {from + part * kGaugeWidth * unit, bottom}, colour_of(gauge.colour),
                          0.2f * unit);
    y += 1.5f * unit;
  }
  for (const std::string& line : view.hud.lines) {
    if (line.empty()) continue;
    shaded_text(list, a.x + 0.75f * unit, y + 0.1f * unit, unit, line);
    y += 1.5f * unit;
  }

  // One thing at a time in the middle: why nothing moves, before what the game says.
  const std::string& middle = view.status.empty() ? view.hud.message : view.status;
  if (middle.empty()) return;
  const float size = middle.size() <= 24 ? kBig * unit : 1.25f * unit, wrap = 0.8f * a.width;
  const ImVec2 extent = size_of(middle, size, wrap);
  shaded_text(list, a.x + (a.width - extent.x) / 2, a.y + 0.3f * a.height - extent.y / 2, size, middle, wrap);
}

}  // namespace parallax
