#include "games/burning_glass_strokes.h"

#include <utility>

namespace parallax::burning {

void Strokes::note(bool burnt, const Char& now) {
  if (burnt) {
    open_ = true;
    quiet_ = 0;
  } else if (open_ && ++quiet_ >= kQuietTicks) {
    close(now);
  }
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
