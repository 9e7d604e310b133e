// The list of the stored maps, to go through with keys or mouse: which one is looked at, and what a press leads to.
// app/maps_panel_view draws it.
//
// A value of the window's thread; no window, no disk.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "app/map_library.h"

namespace parallax {

struct MapCard {
  LibraryMap map;
  bool current = false;  // the session is on it
  bool fits = false;     // made with the present lens
  bool merged = false;   // of two maps that are still there
  GreyImage picture;     // empty: none
  // What one can do with it.
  bool can_go() const { return map.problem.empty() && fits && !current && !map.in_use; }
  bool can_change() const { return map.problem.empty() && (current || !map.in_use); }
};
// "12 keyframes, 3 things on it, locked", or why it cannot be used.
std::string card_text(const MapCard& card);

enum class MapsKey { left, right, up, down, go, rename, lock, remove, undo, separate, close };

struct MapsChoice {
  enum class Kind { none, go, rename, lock, unlock, remove, undo, separate, close } kind = Kind::none;
  std::size_t card = 0;
};

class MapsPanel {
 public:
  bool is_open() const { return open_; }
  void open() { open_ = true; }
  void close() { open_ = false; }

  // The maps as they are now; what was looked at stays so where it is still there.
  void set_cards(std::vector<MapCard> cards);
  const std::vector<MapCard>& cards() const { return cards_; }
  std::size_t selected() const { return selected_; }
  // How many lie side by side: the view says so.
  void set_columns(std::size_t columns) { columns_ = columns > 0 ? columns : 1; }
  // How many deletions can be taken back.
  void set_undos(std::size_t undos) { undos_ = undos; }
  std::size_t undos() const { return undos_; }
  // Whether the press would do something now.
  bool is_possible(MapsKey key) const;

  MapsChoice press(MapsKey key);
  MapsChoice click_card(std::size_t card);  // a second click goes there
  // The selected card shall be seen: it was moved to by key. Once.
  bool take_scroll() { return std::exchange(scroll_, false); }

 private:
  bool open_ = false, scroll_ = false;
  std::vector<MapCard> cards_;
  std::size_t selected_ = 0, columns_ = 1, undos_ = 0;
};

}  // namespace parallax
