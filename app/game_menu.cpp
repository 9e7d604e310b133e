#include "app/game_menu.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "app/game_session.h"
#include "core/check.h"

namespace parallax {
namespace {

std::string line_of(const GameInfo& info) {
  if (info.name == "swarm") return "A horde climbs in over the edges of your table: aim with the camera.";
  if (info.name == "burning_glass") return "A lens at your camera, a sun you move: burn pictures into the table.";
  if (info.name == "marbles") return "Tilt the table and roll among the real things on it.";
  return info.explanation.empty() ? "" : info.explanation.front();
}

}  // namespace

std::vector<MenuGame> menu_games() {
  std::vector<MenuGame> out;
  for (const std::string& name : game_names()) {
    const std::unique_ptr<Game> game = make_game(name);
    out.push_back({game->info(), line_of(game->info())});
  }
  return out;
}

std::vector<MenuButton> GameMenu::buttons() const {
  switch (page_) {
    case MenuPage::closed:
      break;
    case MenuPage::cards: {
      std::vector<MenuButton> out{MenuButton::play, MenuButton::explain, MenuButton::settings};
      if (playing_) out.push_back(MenuButton::leave);
      out.push_back(MenuButton::back);
      return out;
    }
    case MenuPage::explanation:
      return {MenuButton::play, MenuButton::settings, MenuButton::back};
    case MenuPage::settings:
      return {MenuButton::back};
  }
  return {};
}

void GameMenu::open(std::optional<std::size_t> playing) {
  PARALLAX_CHECK(!games_.empty(), "a menu needs games");
  playing_ = playing;
  selected_ = playing ? (*playing + 1) % games_.size() : 0;
  before_.clear();
  page_ = MenuPage::cards;
  marked_.reset();
}

void GameMenu::explain(std::size_t playing) {
  open(playing);
  selected_ = playing;
  page_ = MenuPage::explanation;
  marked_ = 0;
}

void GameMenu::show(MenuPage page) {
  before_.push_back(page_);
  page_ = page;
  marked_ = 0;
}

MenuChoice GameMenu::back() {
  if (before_.empty()) {
    page_ = MenuPage::closed;
    return {MenuChoice::Kind::close, 0};
  }
  page_ = before_.back();
  before_.pop_back();
  marked_.reset();
  if (page_ != MenuPage::cards) marked_ = 0;
  return {};
}

MenuChoice GameMenu::push(MenuButton button, GameStore* store) {
  switch (button) {
    case MenuButton::play: {
      const std::string& name = games_[selected_].info.name;
      const bool known = page_ == MenuPage::explanation || store->explained.contains(name);
      if (!known) {
        show(MenuPage::explanation);
        return {};
      }
      store->explained.insert(name);
      page_ = MenuPage::closed;
      return {MenuChoice::Kind::play, selected_};
    }
    case MenuButton::explain:
      show(MenuPage::explanation);
      return {};
    case MenuButton::settings:
      show(MenuPage::settings);
      return {};
    case MenuButton::leave:
      page_ = MenuPage::closed;
      return {MenuChoice::Kind::leave, 0};
    case MenuButton::back:
      return back();
  }
  return {};
}

void GameMenu::press_in_settings(MenuKey key, GameStore* store) {
  const GameInfo& info = games_[selected_].info;
  const std::vector<GameSettingRow> rows = game_setting_rows(*store, info);
  const std::size_t row = std::min(marked_.value_or(0), rows.size() - 1);
  if (key == MenuKey::up) marked_ = row == 0 ? rows.size() - 1 : row - 1;
  if (key == MenuKey::down) marked_ = (row + 1) % rows.size();
  if (key == MenuKey::left) step_game_setting(rows[row], info, -1, store);
  if (key == MenuKey::right) step_game_setting(rows[row], info, 1, store);
  if (key == MenuKey::accept && !rows[row].share) step_game_setting(rows[row], info, 1, store);
}

MenuChoice GameMenu::press(MenuKey key, GameStore* store) {
  if (!is_open()) return {};
  if (key == MenuKey::back) return back();
  if (page_ == MenuPage::settings) {
    press_in_settings(key, store);
    return {};
  }
  if (page_ == MenuPage::explanation) {
    if (key == MenuKey::help) return back();
    if (key == MenuKey::next) {
      open(playing_);
      return {};
    }
  }
  const std::size_t count = games_.size(), buttons_count = buttons().size();
  if (page_ == MenuPage::cards) {
    if (key == MenuKey::help) return push(MenuButton::explain, store);
    const bool on_cards = !marked_;
    if (key == MenuKey::next || (on_cards && key == MenuKey::right)) {
      selected_ = (selected_ + 1) % count;
      marked_.reset();
      return {};
    }
    if (on_cards && key == MenuKey::left) selected_ = (selected_ + count - 1) % count;
    if (key == MenuKey::up || key == MenuKey::down) {
      if (on_cards) {
        marked_ = 0;
      } else {
        marked_.reset();
      }
      return {};
    }
    if (on_cards) return key == MenuKey::accept ? push(MenuButton::play, store) : MenuChoice{};
  }
  const std::size_t mark = std::min(marked_.value_or(0), buttons_count - 1);
  if (key == MenuKey::left) marked_ = (mark + buttons_count - 1) % buttons_count;
  if (key == MenuKey::right) marked_ = (mark + 1) % buttons_count;
  return key == MenuKey::accept ? push(buttons()[mark], store) : MenuChoice{};
}

MenuChoice GameMenu::click_card(std::size_t game, GameStore* store) {
  if (page_ != MenuPage::cards || game >= games_.size()) return {};
  const bool again = game == selected_ && !marked_;
  selected_ = game;
  marked_.reset();
  return again ? push(MenuButton::play, store) : MenuChoice{};
}

MenuChoice GameMenu::click_button(MenuButton button, GameStore* store) {
  const std::vector<MenuButton> there = buttons();
  if (std::find(there.begin(), there.end(), button) == there.end()) return {};
  return push(button, store);
}

}  // namespace parallax
