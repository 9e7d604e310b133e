// The menu of the games: cards with pictures, what a game is about and how it is played, and the settings; gone through
// with keys, gamepad or mouse alike. What is where, and what a press leads to; app/game_menu_view draws it.
//
// A value of the window's thread; no window, no clock.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "app/game_settings.h"
#include "app/game_store.h"
#include "games/game.h"

namespace parallax {

enum class MenuPage { closed, cards, explanation, settings };

enum class MenuKey {
  left,
  right,
  up,
  down,
  accept,
  back,
  next,  // the key that opens the menu: the next card
  help   // the key that explains the game
};

// The buttons below a page; on settings there is only `back`.
enum class MenuButton { play, explain, settings, leave, back };

struct MenuGame {
  GameInfo info;
  std::string line;  // what it is about, in one line
};
// The games in their order, with their lines.
std::vector<MenuGame> menu_games();

// What the program is to do.
struct MenuChoice {
  enum class Kind { none, play, leave, close } kind = Kind::none;
  std::size_t game = 0;  // to play
};

class GameMenu {
 public:
  explicit GameMenu(std::vector<MenuGame> games) : games_(std::move(games)) {}

  const std::vector<MenuGame>& games() const { return games_; }
  bool is_open() const { return page_ != MenuPage::closed; }
  MenuPage page() const { return page_; }
  // The card that is looked at, also on the other pages.
  std::size_t selected() const { return selected_; }
  // Where the mark is: a button's index, a row of the settings; nothing: on the cards.
  std::optional<std::size_t> marked() const { return marked_; }
  std::vector<MenuButton> buttons() const;
  // The game that is on, if any.
  const std::optional<std::size_t>& playing() const { return playing_; }

  // Opens at the cards: at the game after the one that is on, else at the first.
  void open(std::optional<std::size_t> playing);
  // Opens at the explanation of the game that is on.
  void explain(std::size_t playing);
  void close() { page_ = MenuPage::closed; }

  // A press; changes settings in the store, and notes there which games were explained.
  MenuChoice press(MenuKey key, GameStore* store);
  // The same with the mouse.
  MenuChoice click_card(std::size_t game, GameStore* store);  // a second click plays
  MenuChoice click_button(MenuButton button, GameStore* store);
  void mark_row(std::size_t row) { marked_ = row; }

 private:
  MenuChoice push(MenuButton button, GameStore* store);
  MenuChoice back();
  void press_in_settings(MenuKey key, GameStore* store);
  void show(MenuPage page);

  std::vector<MenuGame> games_;
  MenuPage page_ = MenuPage::closed;
  std::vector<MenuPage> before_;  // where one came from
  std::size_t selected_ = 0;
  std::optional<std::size_t> marked_, playing_;
};

}  // namespace parallax
