#include "app/game_hud.h"

#include <algorithm>

#include "app/interface_drawing.h"

namespace parallax {
namespace {

constexpr ImU32 kHairs = IM_COL32(255, 255, 255, 220);
constexpr ImU32 kHairsEdge = IM_COL32(0, 0, 0, 160);
// Of the picture's height: the arms of the cross-hairs.
constexpr float kHairsLength = 0.035f, kHairsGap = 0.012f;
constexpr float kBig = 2.0f;      // of the font: score and messages
constexpr float kHuge = 4.0f;     // the count-down
constexpr float kGaugeWidth = 7;  // in heights of the font

void shaded_text(ImDrawList* list, float x, float y, float size, const std::string& text, float wrap = 0) {
  const float edge = 0.25f * ImGui::GetFontSize();
  text_on_ground(list, x, y, text, edge, edge / 2, size, wrap);
}

void draw_cross_hairs(ImDrawList* list, const PictureArea& a, const CameraModel* camera) {
  const Eigen::Vector2f at = camera != nullptr ? a.from_pixel(*camera, camera->centre_px())
                                               : Eigen::Vector2f(a.x + a.width / 2, a.y + a.height / 2);
  const float x = at.x(), y = at.y();
  const float near = kHairsGap * a.height, far = near + kHairsLength * a.height;
  for (const float sign : {-1.0f, 1.0f}) {
    for (const auto& [colour, width] : {std::pair{kHairsEdge, 4.0f}, std::pair{kHairs, 1.5f}}) {
      list->AddLine({x + sign * near, y}, {x + sign * far, y}, colour, width);
      list->AddLine({x, y + sign * near}, {x, y + sign * far}, colour, width);
    }
  }
  list->AddCircleFilled({x, y}, 2.0f, kHairs);
}

// Cross-hairs, score, gauges and lines.
void draw_standing(const GameHudView& view, ImDrawList* list) {
  const PictureArea& a = view.area;
  const float unit = ImGui::GetFontSize();
  if (view.hud.cross_hairs && view.status.empty()) draw_cross_hairs(list, a, view.camera);

  const std::string score = std::to_string(view.hud.score);
  shaded_text(list, a.x + a.width - text_extent(score, kBig * unit).x - unit, a.y + 0.5f * unit, kBig * unit, score);

  float y = a.y + 0.5f * unit;
  for (const GameGauge& gauge : view.hud.gauges) {
    const float label = text_extent(gauge.label).x + 0.5f * unit, left = a.x + 0.75f * unit;
    list->AddRectFilled({left - 0.25f * unit, y}, {left + label + kGaugeWidth * unit + 0.25f * unit, y + 1.3f * unit},
                        kInterfaceGround, 0.25f * unit);
    text_at(list, left, y + 0.15f * unit, kInterfaceText, gauge.label);
    filled_bar(list, {left + label, y + 0.4f * unit}, {left + label + kGaugeWidth * unit, y + 0.9f * unit},
               static_cast<float>(gauge.value), interface_colour(gauge.colour), 0.2f * unit);
    y += 1.5f * unit;
  }
  for (const std::string& line : view.hud.lines) {
    if (line.empty()) continue;
    shaded_text(list, a.x + 0.75f * unit, y + 0.1f * unit, unit, line);
    y += 1.5f * unit;
  }
}

}  // namespace

void draw_game_hud(const GameHudView& view) {
  ImDrawList* list = ImGui::GetBackgroundDrawList();
  const PictureArea& a = view.area;
  const float unit = ImGui::GetFontSize();
  if (view.begun) draw_standing(view, list);

  // One thing at a time in the middle: why nothing moves, before what the game says.
  const std::string& middle = view.status.empty() ? view.hud.message : view.status;
  if (middle.empty()) return;
  const float lines = middle.size() <= 2 ? kHuge : middle.size() <= 24 ? kBig : 1.25f;
  const float size = lines * unit, wrap = 0.8f * a.width;
  const ImVec2 extent = text_extent(middle, size, wrap);
  const float top = a.y + 0.3f * a.height - extent.y / 2;
  shaded_text(list, a.x + (a.width - extent.x) / 2, top, size, middle, wrap);
  if (!view.below.empty())
    shaded_text(list, a.x + (a.width - text_extent(view.below).x) / 2, top + extent.y + 0.6f * unit, unit, view.below);
}

}  // namespace parallax
