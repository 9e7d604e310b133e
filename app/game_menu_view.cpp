#include "app/game_menu_view.h"

#include <algorithm>
#include <cmath>

#include "app/game_controls.h"
#include "app/interface_drawing.h"
#include "core/check.h"

namespace parallax {
namespace {

// In heights of the font.
constexpr float kWidth = 40, kCardGap = 0.6f, kRow = 1.5f, kButton = 1.7f;
constexpr float kLabelShare = 0.56f;  // of a row of the settings
constexpr ImU32 kMarked = IM_COL32(52, 84, 120, 255), kHovered = IM_COL32(42, 50, 62, 255);
constexpr ImU32 kCard = IM_COL32(26, 30, 36, 255), kButtonGround = IM_COL32(44, 49, 58, 255);
constexpr ImU32 kQuiet = IM_COL32(185, 190, 198, 255), kFilled = IM_COL32(86, 180, 233, 255);

float unit() { return ImGui::GetFontSize(); }

ImVec2 corner(const ImVec2& at, const ImVec2& size) { return {at.x + size.x, at.y + size.y}; }

void quiet_text(const std::string& text) {
  ImGui::PushStyleColor(ImGuiCol_Text, kQuiet);
  ImGui::TextWrapped("%s", text.c_str());
  ImGui::PopStyleColor();
}

void large_text(const std::string& text) {
  ImGui::SetWindowFontScale(1.35f);
  ImGui::TextUnformatted(text.c_str());
  ImGui::SetWindowFontScale(1);
}

std::string label_of(MenuButton button, const GameMenu& menu) {
  switch (button) {
    case MenuButton::play:
      return menu.playing() == menu.selected() ? "Go on" : "Play";
    case MenuButton::explain:
      return "How to play";
    case MenuButton::settings:
      return "Settings";
    case MenuButton::leave:
      return "No game";
    case MenuButton::back:
      return menu.page() == MenuPage::cards ? "Close" : "Back";
  }
  return "";
}

// A button of the menu; true when it was clicked.
bool draw_button(const std::string& label, bool marked, float width) {
  const ImVec2 at = ImGui::GetCursorScreenPos(), size{width, kButton * unit()};
  const bool clicked = ImGui::InvisibleButton(label.c_str(), size);
  ImDrawList* list = ImGui::GetWindowDrawList();
  list->AddRectFilled(at, corner(at, size),
                      marked                   ? kMarked
                      : ImGui::IsItemHovered() ? kHovered
                                               : kButtonGround,
                      0.25f * unit());
  if (marked) list->AddRect(at, corner(at, size), kInterfaceAmber, 0.25f * unit(), 0, 2);
  const ImVec2 extent = text_extent(label);
  text_at(list, at.x + (width - extent.x) / 2, at.y + (size.y - extent.y) / 2, kInterfaceText, label);
  return clicked;
}

MenuChoice draw_buttons(GameMenu* menu, GameStore* store) {
  const std::vector<MenuButton> buttons = menu->buttons();
  const float gap = kCardGap * unit(), width = ImGui::GetContentRegionAvail().x;
  const float each = std::min(9 * unit(), (width + gap) / static_cast<float>(buttons.size()) - gap);
  std::optional<MenuButton> clicked;
  for (std::size_t i = 0; i < buttons.size(); ++i) {
    if (i > 0) ImGui::SameLine(0, gap);
    const bool marked = menu->page() != MenuPage::settings && menu->marked() == i;
    if (draw_button(label_of(buttons[i], *menu), marked, each)) clicked = buttons[i];
  }
  return clicked ? menu->click_button(*clicked, store) : MenuChoice{};
}

bool draw_card(const MenuGame& game, void* picture, bool selected, bool marked, float width) {
  const float height = 0.75f * width, below = 1.7f * unit();
  const ImVec2 at = ImGui::GetCursorScreenPos(), size{width, height + below};
  const bool clicked = ImGui::InvisibleButton(game.info.name.c_str(), size);
  ImDrawList* list = ImGui::GetWindowDrawList();
  list->AddRectFilled(at, corner(at, size),
                      selected                 ? kMarked
                      : ImGui::IsItemHovered() ? kHovered
                                               : kCard,
                      0.3f * unit());
  const float edge = 0.2f * unit();
  if (picture != nullptr)
    list->AddImage(picture, {at.x + edge, at.y + edge}, {at.x + width - edge, at.y + height - edge});
  if (selected) {
    list->AddRect(at, corner(at, size), marked ? kInterfaceAmber : kQuiet, 0.3f * unit(), 0, 3);
  } else if (ImGui::IsItemHovered()) {
    list->AddRect(at, corner(at, size), kQuiet, 0.3f * unit(), 0, 1);
  }
  const ImVec2 extent = text_extent(game.info.title);
  text_at(list, at.x + (width - extent.x) / 2, at.y + height + (below - extent.y) / 2 - edge / 2, kInterfaceText,
          game.info.title);
  return clicked;
}

std::string standing_of(const GameMenuView& view, const GameMenu& menu, const GameStore& store) {
  const std::string& name = menu.games()[menu.selected()].info.name;
  const auto& best = store.best(name, store.difficulty);
  std::string text = best.empty() ? "no score yet" : "best score " + std::to_string(best.front().score);
  text += std::string(" (") + difficulty_name(store.difficulty) + ")";
  if (menu.playing() == menu.selected()) return text + ", on now";
  if (view.left.contains(name)) text += ", goes on where it was left";
  return text;
}

MenuChoice draw_cards(const GameMenuView& view, GameMenu* menu, GameStore* store) {
  large_text("Games");
  const auto count = static_cast<float>(menu->games().size());
  const float gap = kCardGap * unit(), width = (ImGui::GetContentRegionAvail().x + gap) / count - gap;
  std::optional<std::size_t> clicked;
  for (std::size_t i = 0; i < menu->games().size(); ++i) {
    if (i > 0) ImGui::SameLine(0, gap);
    void* picture = i < view.pictures.size() ? view.pictures[i] : nullptr;
    if (draw_card(menu->games()[i], picture, i == menu->selected(), !menu->marked(), width)) clicked = i;
  }
  ImGui::Spacing();
  ImGui::TextWrapped("%s", menu->games()[menu->selected()].line.c_str());
  quiet_text(standing_of(view, *menu, *store));
  ImGui::Spacing();
  MenuChoice choice = draw_buttons(menu, store);
  quiet_text(view.gamepad
                 ? "Cross or stick: choose   A: play   B: close   Back: next game"
                 : "Arrows: choose   Enter: play   Escape: close   " + view.keys->chord_names(Action::next_game) +
                       ": next game   " + view.keys->chord_names(Action::help) + ": how to play");
  if (clicked) choice = menu->click_card(*clicked, store);
  return choice;
}

MenuChoice draw_explanation(const GameMenuView& view, GameMenu* menu, GameStore* store) {
  const GameInfo& info = menu->games()[menu->selected()].info;
  large_text(info.title);
  // The picture beside the lines, where there is room for it.
  const ImVec2 at = ImGui::GetCursorScreenPos();
  float width = 0;
  for (const std::string& line : info.explanation) {
    ImGui::TextUnformatted(line.c_str());
    width = std::max(width, text_extent(line).x);
  }
  void* picture = menu->selected() < view.pictures.size() ? view.pictures[menu->selected()] : nullptr;
  const float left = at.x + width + 1.5f * unit(), right = at.x + ImGui::GetContentRegionAvail().x;
  const float across = std::min(right - left, (ImGui::GetCursorScreenPos().y - at.y) / 0.75f);
  if (picture != nullptr && across > 6 * unit())
    ImGui::GetWindowDrawList()->AddImage(picture, {right - across, at.y}, {right, at.y + 0.75f * across});
  ImGui::Spacing();
  ImGui::Separator();
  if (ImGui::BeginTable("controls", 3, ImGuiTableFlags_SizingFixedFit)) {
    ImGui::TableSetupColumn("does", ImGuiTableColumnFlags_WidthFixed);
    ImGui::TableSetupColumn("keys", ImGuiTableColumnFlags_WidthStretch);
    ImGui::TableSetupColumn("pad", ImGuiTableColumnFlags_WidthFixed);
    for (const GameControlRow& row : game_control_rows(info, *view.keys)) {
      ImGui::TableNextRow();
      ImGui::TableNextColumn();
      ImGui::TextUnformatted(row.does.c_str());
      ImGui::TableNextColumn();
      ImGui::TextWrapped("%s", row.keys.c_str());
      ImGui::TableNextColumn();
      ImGui::PushStyleColor(ImGuiCol_Text, kQuiet);
      ImGui::TextUnformatted(row.gamepad.c_str());
      ImGui::PopStyleColor();
    }
    ImGui::EndTable();
  }
  ImGui::Spacing();
  return draw_buttons(menu, store);
}

// One row: its label marks it, its value is changed where it is clicked, and by the wheel.
void draw_setting(const GameSettingRow& row, std::size_t index, const GameInfo& info, GameMenu* menu,
                  GameStore* store) {
  ImGui::PushID(static_cast<int>(index));
  ImDrawList* list = ImGui::GetWindowDrawList();
  const bool marked = menu->marked() == index;
  const float width = ImGui::GetContentRegionAvail().x, height = kRow * unit(), label = kLabelShare * width;
  const ImVec2 at = ImGui::GetCursorScreenPos();
  if (ImGui::InvisibleButton("label", {label, height})) menu->mark_row(index);
  const bool hovered = ImGui::IsWindowHovered() && ImGui::IsMouseHoveringRect(at, {at.x + width, at.y + height});
  if (marked || hovered)
    list->AddRectFilled(at, {at.x + width, at.y + height}, marked ? kMarked : kHovered, 0.25f * unit());
  const float text_y = at.y + (height - unit()) / 2;
  text_at(list, at.x + 0.4f * unit(), text_y, kInterfaceText, row.label + (row.later ? " (next game)" : ""));
  ImGui::SameLine(0, 0);
  const float left = at.x + label, bar = row.share ? 0.5f * (width - label) : 0;
  ImGui::InvisibleButton("value", {width - label, height});
  if (ImGui::IsItemActivated()) menu->mark_row(index);
  // Where the panel is taller than the window the wheel is for going through it.
  const float wheel = ImGui::GetIO().MouseWheel;
  if (wheel != 0 && ImGui::IsItemHovered() && ImGui::GetScrollMaxY() <= 0) {
    menu->mark_row(index);
    step_game_setting(row, info, wheel > 0 ? 1 : -1, store);
  }
  const float mouse_x = ImGui::GetIO().MousePos.x;
  if (row.share) {
    filled_bar(list, {left, at.y + 0.35f * height}, {left + bar, at.y + 0.65f * height}, static_cast<float>(*row.share),
               kFilled, 0.2f * unit());
    text_at(list, left + bar + 0.6f * unit(), text_y, kInterfaceText, row.value);
    if (ImGui::IsItemActive())
      slide_game_setting(row, info, std::clamp((mouse_x - left) / std::max(bar, 1.0f), 0.0f, 1.0f), store);
  } else {
    text_at(list, left, text_y, kQuiet, "<");
    text_at(list, left + 1.1f * unit(), text_y, kInterfaceText, row.value);
    text_at(list, at.x + width - 0.9f * unit(), text_y, kQuiet, ">");
    if (ImGui::IsItemClicked()) step_game_setting(row, info, mouse_x < left + unit() ? -1 : 1, store);
  }
  ImGui::PopID();
}

MenuChoice draw_settings(const GameMenuView& view, GameMenu* menu, GameStore* store) {
  const GameInfo& info = menu->games()[menu->selected()].info;
  large_text("Settings");
  ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {0, 0});
  const std::vector<GameSettingRow> rows = game_setting_rows(*store, info);
  bool own = false;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (!own && rows[i].kind == GameSettingRow::Kind::own) {
      own = true;
      quiet_text(info.title);
    }
    draw_setting(rows[i], i, info, menu, store);
  }
  ImGui::PopStyleVar();
  ImGui::Spacing();
  const MenuChoice choice = draw_buttons(menu, store);
  ImGui::SameLine(0, unit());
  ImGui::SetCursorPosY(ImGui::GetCursorPosY() + 0.5f * (kButton - 1) * unit());
  quiet_text(view.gamepad ? "Cross: choose and change   B: back"
                          : "Up, down: choose   Left, right: change   Escape: back");
  return choice;
}

}  // namespace

MenuChoice draw_game_menu(const GameMenuView& view, GameMenu* menu, GameStore* store) {
  if (!menu->is_open()) return {};
  PARALLAX_CHECK(view.keys != nullptr, "the menu says which keys are bound");
  const ImVec2 display = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({display.x / 2, display.y / 2}, ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::SetNextWindowSize({std::min(kWidth * unit(), display.x - 0.5f * unit()), 0}, ImGuiCond_Always);
  ImGui::SetNextWindowSizeConstraints({0, 0}, {display.x, display.y});
  ImGui::SetNextWindowBgAlpha(0.94f);
  ImGui::Begin("##games", nullptr,
               ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove |
                   ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoNav);
  MenuChoice choice;
  switch (menu->page()) {
    case MenuPage::closed:
      break;
    case MenuPage::cards:
      choice = draw_cards(view, menu, store);
      break;
    case MenuPage::explanation:
      choice = draw_explanation(view, menu, store);
      break;
    case MenuPage::settings:
      choice = draw_settings(view, menu, store);
      break;
  }
  ImGui::End();
  return choice;
}

}  // namespace parallax
