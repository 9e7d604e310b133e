// Strokes of burning, and what the sheet was before each: a stroke begins with the first char that the light makes and
// ends when it made none for a while. What smoulders on after that belongs to the stroke before it. The last one is
// undone first. Bounded: the oldest strokes can no longer be undone when there
// are too many or they are too large.
//
// A value; one thread at a time.
#pragma once

#include <cstdint>
#include <deque>
#include <vector>

#include "games/burning_glass_codec.h"
#include "games/burning_glass_grid.h"

namespace parallax::burning {

inline constexpr int kQuietTicks = 60;  // half a second without new char by the light ends a stroke
inline constexpr std::size_t kMostStrokes = 64;
inline constexpr std::size_t kMostStrokeCells = 120'000;  // of all strokes together

class Strokes {
 public:
  using Cells = std::vector<CellValue>;
  using Char = std::vector<std::uint16_t>;

  Strokes() : base_(kSheetSize, 0) {}
  // Nothing to be undone on a sheet of this char.
  explicit Strokes(Char charred) : base_(std::move(charred)) {}

  // After every step: whether the light made char, where there is new char at all, and the sheet's char now.
  void note(bool by_light, const SheetBox& changed, const Char& now);
  // Takes the last stroke, going on or ended, off the char. False when there is none.
  bool undo(Char* charred);

  bool open() const { return open_; }
  std::size_t count() const { return closed_.size() + (open_ ? 1 : 0); }

  // The whole state, for saving: ended strokes, oldest first; the char without the one that goes on.
  const std::deque<Cells>& closed() const { return closed_; }
  const Char& base() const { return base_; }
  int quiet_ticks() const { return quiet_; }
  static Strokes from_parts(std::deque<Cells> closed, Char base, bool open, int quiet_ticks);

 private:
  void close(const Char& now);
  void take_afterglow(const SheetBox& changed, const Char& now);
  void forget_oldest();

  std::deque<Cells> closed_;  // each in the order of its cells
  std::size_t cells_ = 0;     // of all closed ones
  Char base_;                 // the char without the open stroke
  bool open_ = false;
  int quiet_ = 0;
};

}  // namespace parallax::burning
