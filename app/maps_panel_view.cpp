#include "app/maps_panel_view.h"

#include <algorithm>
#include <cmath>

#include "app/interface_drawing.h"

namespace parallax {
namespace {

// In heights of the font.
constexpr float kMapsWidth = 46, kMapCardWidth = 10.4f, kMapCardGap = 0.5f, kMapButton = 1.7f;
constexpr ImU32 kMapMarked = IM_COL32(52, 84, 120, 255), kMapHovered = IM_COL32(42, 50, 62, 255);
constexpr ImU32 kMapCard = IM_COL32(26, 30, 36, 255), kMapButtonGround = IM_COL32(44, 49, 58, 255);
constexpr ImU32 kMapQuiet = IM_COL32(185, 190, 198, 255), kMapCurrent = IM_COL32(86, 180, 233, 255);

float font_height() { return ImGui::GetFontSize(); }

void quiet_line(const std::string& text) {
  ImGui::PushStyleColor(ImGuiCol_Text, kMapQuiet);
  ImGui::TextWrapped("%s", text.c_str());
  ImGui::PopStyleColor();
}

// As much of a text as fits.
std::string fitted(const std::string& text, float width) {
  if (text_extent(text).x <= width) return text;
  std::string shorter = text;
  while (!shorter.empty() && text_extent(shorter + "...").x > width) {
    do shorter.pop_back();
    while (!shorter.empty() && (static_cast<unsigned char>(shorter.back()) & 0xc0) == 0x80);
  }
  return shorter + "...";
}

bool draw_map_card(const MapCard& card, std::size_t index, void* picture, bool selected, float width) {
  const float unit = font_height(), edge = 0.2f * unit, height = 0.75f * width;
  const ImVec2 at = ImGui::GetCursorScreenPos(), size{width, height + 2.7f * unit};
  ImGui::PushID(static_cast<int>(index));
  const bool clicked = ImGui::InvisibleButton("map", size);
  const bool hovered = ImGui::IsItemHovered();
  ImGui::PopID();
  if (hovered) ImGui::SetTooltip("%s\n%s\n%s", card.map.title.c_str(), card_text(card).c_str(), card.map.file.c_str());
  ImDrawList* list = ImGui::GetWindowDrawList();
  const ImVec2 end{at.x + size.x, at.y + size.y};
  list->AddRectFilled(at, end, selected ? kMapMarked : hovered ? kMapHovered : kMapCard, 0.3f * unit);
  const ImVec2 from{at.x + edge, at.y + edge}, to{at.x + width - edge, at.y + height};
  if (picture != nullptr) {
    const ImU32 tint =
        card.map.problem.empty() && (card.fits || card.current) ? IM_COL32_WHITE : IM_COL32(255, 255, 255, 90);
    list->AddImage(picture, from, to, {0, 0}, {1, 1}, tint);
  } else {
    list->AddRectFilled(from, to, IM_COL32(14, 16, 20, 255));
    const std::string none = card.map.problem.empty() ? "no picture" : "no map";
    const ImVec2 extent = text_extent(none);
    text_at(list, (from.x + to.x - extent.x) / 2, (from.y + to.y - extent.y) / 2, kMapQuiet, none);
  }
  if (card.current) text_on_ground(list, from.x + 0.4f * unit, from.y + 0.3f * unit, "here", 0.3f * unit, 0.1f * unit);
  if (selected) list->AddRect(at, end, kInterfaceAmber, 0.3f * unit, 0, 3);
  const float room = width - 2 * edge - 0.4f * unit;
  text_at(list, at.x + 2 * edge, at.y + height + 0.25f * unit, card.current ? kMapCurrent : kInterfaceText,
          fitted(card.map.title, room));
  text_at(list, at.x + 2 * edge, at.y + height + 1.4f * unit, kMapQuiet, fitted(card_text(card), room / 0.85f),
          0.85f * unit);
  return clicked;
}

bool draw_map_button(const std::string& label, bool possible, float width) {
  const float unit = font_height();
  const ImVec2 at = ImGui::GetCursorScreenPos(), size{width, kMapButton * unit};
  const bool clicked = ImGui::InvisibleButton(label.c_str(), size) && possible;
  ImDrawList* list = ImGui::GetWindowDrawList();
  const bool hovered = possible && ImGui::IsItemHovered();
  list->AddRectFilled(at, {at.x + size.x, at.y + size.y}, hovered ? kMapHovered : kMapButtonGround, 0.25f * unit);
  const ImVec2 extent = text_extent(label);
  text_at(list, at.x + (width - extent.x) / 2, at.y + (size.y - extent.y) / 2,
          possible ? kInterfaceText : IM_COL32(110, 114, 122, 255), label);
  return clicked;
}

MapsChoice draw_map_cards(const MakeMapPicture& make, MapsPanel* panel, float most_height) {
  const float unit = font_height(), gap = kMapCardGap * unit;
  MapsChoice choice;
  const float room = ImGui::GetContentRegionAvail().x - ImGui::GetStyle().ScrollbarSize;
  const auto columns =
      static_cast<std::size_t>(std::max(2.0f, std::floor((room + gap) / (kMapCardWidth * unit + gap))));
  const float width = (room + gap) / static_cast<float>(columns) - gap;
  panel->set_columns(columns);
  // Two rows at most; the others are scrolled to.
  const float row = 0.75f * width + 2.7f * unit + ImGui::GetStyle().ItemSpacing.y;
  const float rows = panel->cards().size() > columns ? 2.0f : 1.0f;
  ImGui::BeginChild("maps", {0, std::min(rows * row + 0.1f * unit, most_height)}, false, ImGuiWindowFlags_NoNav);
  const bool scroll = panel->take_scroll();
  std::optional<std::size_t> clicked;
  for (std::size_t i = 0; i < panel->cards().size(); ++i) {
    if (i % columns != 0) ImGui::SameLine(0, gap);
    const MapCard& card = panel->cards()[i];
    void* picture = card.picture.empty() ? nullptr : make(static_cast<int>(i), card.picture);
    if (draw_map_card(card, i, picture, i == panel->selected(), width)) clicked = i;
    if (scroll && i == panel->selected()) ImGui::SetScrollHereY(0.5f);
  }
  if (clicked) choice = panel->click_card(*clicked);
  ImGui::EndChild();
  return choice;
}

}  // namespace

MapsChoice draw_maps_panel(const MakeMapPicture& picture, const std::string& note, MapsPanel* panel) {
  if (!panel->is_open()) return {};
  const ImVec2 display = ImGui::GetIO().DisplaySize;
  const float unit = font_height();
  ImGui::SetNextWindowPos({display.x / 2, display.y / 2}, ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::SetNextWindowSize({std::min(kMapsWidth * unit, display.x - 0.5f * unit), 0}, ImGuiCond_Always);
  ImGui::SetNextWindowSizeConstraints({0, 0}, {display.x, display.y});
  ImGui::SetNextWindowBgAlpha(0.94f);
  ImGui::Begin("##maps", nullptr,
               ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove |
                   ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoNav |
                   ImGuiWindowFlags_NoScrollbar);
  ImGui::SetWindowFontScale(1.35f);
  ImGui::TextUnformatted("Maps");
  ImGui::SetWindowFontScale(1);
  MapsChoice choice;
  if (panel->cards().empty()) {
    quiet_line(note.empty() ? "No map is kept yet: after some seconds of tracking the first one is." : note);
  } else {
    if (!note.empty()) quiet_line(note);
    choice = draw_map_cards(picture, panel, display.y - 10 * unit);
  }
  ImGui::Spacing();
  const bool locked = !panel->cards().empty() && panel->cards()[panel->selected()].map.locked;
  const std::pair<MapsKey, std::string> buttons[] = {
      {MapsKey::go, "Go to"},      {MapsKey::rename, "Rename"},    {MapsKey::lock, locked ? "Unlock" : "Lock"},
      {MapsKey::remove, "Delete"}, {MapsKey::undo, "Undo delete"}, {MapsKey::separate, "Undo merge"},
      {MapsKey::close, "Close"}};
  const float gap = kMapCardGap * unit, room = ImGui::GetContentRegionAvail().x;
  const float each = std::min(8 * unit, (room + gap) / static_cast<float>(std::size(buttons)) - gap);
  for (const auto& [key, label] : buttons) {
    if (key != MapsKey::go) ImGui::SameLine(0, gap);
    if (draw_map_button(label, panel->is_possible(key), each)) choice = panel->press(key);
  }
  quiet_line("Enter: go to   N: name   K: lock   Delete, U: delete, undo   S: undo merge   Esc: close");
  ImGui::End();
  return choice;
}

}  // namespace parallax
