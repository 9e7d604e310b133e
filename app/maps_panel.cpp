#include "app/maps_panel.h"

#include <algorithm>

namespace parallax {
namespace {

std::string count_text(int count, const std::string& what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

}  // namespace

std::string card_text(const MapCard& card) {
  const LibraryMap& map = card.map;
  if (!map.problem.empty()) return map.problem;
  std::string text = count_text(map.info.keyframes, "view");
  if (map.info.content > 0) text += ", " + count_text(map.info.content, "thing") + " on it";
  if (map.info.games > 0) text += ", " + count_text(map.info.games, "game");
  if (map.info.merged_from.size() > 1) text += ", merged from " + std::to_string(map.info.merged_from.size());
  if (map.locked) text += ", locked";
  if (!card.fits) text += ", another lens";
  if (map.in_use && !card.current) text += ", in use elsewhere";
  return text;
}

void MapsPanel::set_cards(std::vector<MapCard> cards) {
  const std::string path = selected_ < cards_.size() ? cards_[selected_].map.path : "";
  cards_ = std::move(cards);
  const auto same = std::find_if(cards_.begin(), cards_.end(), [&](const MapCard& c) { return c.map.path == path; });
  if (same != cards_.end())
    selected_ = static_cast<std::size_t>(same - cards_.begin());
  else
    selected_ = cards_.empty() ? 0 : std::min(selected_, cards_.size() - 1);
}

bool MapsPanel::is_possible(MapsKey key) const {
  if (key == MapsKey::close) return true;
  if (key == MapsKey::undo) return undos_ > 0;
  if (cards_.empty()) return false;
  const MapCard& card = cards_[selected_];
  switch (key) {
    case MapsKey::go:
      return card.can_go();
    case MapsKey::rename:
    case MapsKey::remove:
      return card.can_change() && !card.map.locked;
    case MapsKey::lock:
      return card.can_change();
    case MapsKey::separate:
      return card.can_change() && card.merged && !card.map.locked;
    default:
      return true;
  }
}

MapsChoice MapsPanel::press(MapsKey key) {
  if (!open_ || !is_possible(key)) return {};
  const std::size_t count = cards_.size();
  switch (key) {
    case MapsKey::left:
      if (selected_ > 0) --selected_;
      break;
    case MapsKey::right:
      if (selected_ + 1 < count) ++selected_;
      break;
    case MapsKey::up:
      if (selected_ >= columns_) selected_ -= columns_;
      break;
    case MapsKey::down:
      if (selected_ + columns_ < count)
        selected_ += columns_;
      else if (selected_ / columns_ < (count - 1) / columns_)
        selected_ = count - 1;
      break;
    case MapsKey::go:
      return {MapsChoice::Kind::go, selected_};
    case MapsKey::rename:
      return {MapsChoice::Kind::rename, selected_};
    case MapsKey::lock:
      return {cards_[selected_].map.locked ? MapsChoice::Kind::unlock : MapsChoice::Kind::lock, selected_};
    case MapsKey::remove:
      return {MapsChoice::Kind::remove, selected_};
    case MapsKey::separate:
      return {MapsChoice::Kind::separate, selected_};
    case MapsKey::undo:
      return {MapsChoice::Kind::undo, 0};
    case MapsKey::close:
      open_ = false;
      return {MapsChoice::Kind::close, 0};
  }
  scroll_ = true;
  return {};
}

MapsChoice MapsPanel::click_card(std::size_t card) {
  if (!open_ || card >= cards_.size()) return {};
  const bool again = card == selected_;
  selected_ = card;
  return again ? press(MapsKey::go) : MapsChoice{};
}

}  // namespace parallax
