#include "games/burning_glass_strokes.h"

#include <algorithm>
#include <utility>

namespace parallax::burning {

void Strokes::note(bool by_light, const SheetBox& changed, const Char& now) {
  if (by_light) {
    open_ = true;
    quiet_ = 0;
  } else if (open_) {
    if (++quiet_ >= kQuietTicks) close(now);
  } else {
    take_afterglow(changed, now);
  }
}

// The last stroke smoulders on: what it was before is kept of the cells that it reaches now.
void Strokes::take_afterglow(const SheetBox& changed, const Char& now) {
  if (changed.empty()) return;
  for (int row = changed.bottom; row < changed.top; ++row) {
    for (int column = changed.left; column < changed.right; ++column) {
      const std::size_t i = SheetGrid::index(column, row);
      if (now[i] == base_[i]) continue;
      if (!closed_.empty()) {
        Cells& stroke = closed_.back();
        const auto cell = static_cast<std::uint32_t>(i);
        const auto place =
            std::lower_bound(stroke.begin(), stroke.end(), cell,
                             [](const CellValue& kept, std::uint32_t wanted) { return kept.cell < wanted; });
        if (place == stroke.end() || place->cell != cell) {
          stroke.insert(place, {cell, base_[i]});
          ++cells_;
        }
      }
      base_[i] = now[i];
    }
  }
  forget_oldest();
}

void Strokes::close(const Char& now) {
  Cells cells;
  for (std::size_t i = 0; i < now.size(); ++i) {
    if (now[i] != base_[i]) cells.push_back({static_cast<std::uint32_t>(i), base_[i]});
  }
  cells_ += cells.size();
  closed_.push_back(std::move(cells));
  base_ = now;
  open_ = false;
  quiet_ = 0;
  forget_oldest();
}

void Strokes::forget_oldest() {
  while (closed_.size() > kMostStrokes || (closed_.size() > 1 && cells_ > kMostStrokeCells)) {
    cells_ -= closed_.front().size();
    closed_.pop_front();
  }
}

bool Strokes::undo(Char* charred) {
  if (open_) {
    open_ = false;
    quiet_ = 0;
    *charred = base_;
    return true;
  }
  if (closed_.empty()) return false;
  for (const CellValue& cell : closed_.back()) base_[cell.cell] = cell.value;
  cells_ -= closed_.back().size();
  closed_.pop_back();
  *charred = base_;
  return true;
}

Strokes Strokes::from_parts(std::deque<Cells> closed, Char base, bool open, int quiet_ticks) {
  Strokes out(std::move(base));
  out.closed_ = std::move(closed);
  for (const Cells& cells : out.closed_) out.cells_ += cells.size();
  out.open_ = open;
  out.quiet_ = quiet_ticks;
  out.forget_oldest();
  return out;
}

}  // namespace parallax::burning
