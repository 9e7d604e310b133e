#include "place/place_index.h"

#include <algorithm>

#include "core/check.h"

namespace parallax {

void PlaceIndex::add(int entry, const WordBag& bag) {
  auto slot = static_cast<std::int32_t>(slots_.size());
  if (!free_.empty()) slot = free_.back();
  PARALLAX_CHECK(slot_of_.emplace(entry, slot).second, "an entry that the index has");
  if (free_.empty()) {
    slots_.emplace_back();
  } else {
    free_.pop_back();
  }
  slots_[static_cast<std::size_t>(slot)] = {entry, bag};
  for (const auto& [word, weight] : bag) images_with_[word].emplace_back(slot, weight);
}

void PlaceIndex::erase(int entry) {
  const auto it = slot_of_.find(entry);
  if (it == slot_of_.end()) return;
  const std::int32_t slot = it->second;
  for (const auto& [word, weight] : slots_[static_cast<std::size_t>(slot)].bag) {
    auto& list = images_with_[word];
    std::erase_if(list, [slot](const auto& image) { return image.first == slot; });
    if (list.empty()) images_with_.erase(word);
  }
  slots_[static_cast<std::size_t>(slot)] = {};
  free_.push_back(slot);
  slot_of_.erase(it);
}

const WordBag* PlaceIndex::find(int entry) const {
  const auto it = slot_of_.find(entry);
  return it == slot_of_.end() ? nullptr : &slots_[static_cast<std::size_t>(it->second)].bag;
}

std::vector<PlaceMatch> PlaceIndex::score_all(const WordBag& bag) const {
  std::vector<double> scores(slots_.size(), -1);  // -1: shares no word
  for (const auto& [word, weight] : bag) {
    const auto it = images_with_.find(word);
    if (it == images_with_.end()) continue;
    for (const auto& [slot, other] : it->second) {
      double& score = scores[static_cast<std::size_t>(slot)];
      score = std::max(score, 0.0) + static_cast<double>(std::min(weight, other));
    }
  }
  std::vector<PlaceMatch> out;
  for (std::size_t slot = 0; slot < scores.size(); ++slot)
    if (scores[slot] >= 0) out.push_back({slots_[slot].entry, scores[slot]});
  return out;
}

void PlaceIndex::keep_best(int at_most, std::vector<PlaceMatch>* matches) {
  const auto better = [](const PlaceMatch& a, const PlaceMatch& b) {
    return a.score != b.score ? a.score > b.score : a.entry < b.entry;
  };
  const auto kept = std::min(matches->size(), static_cast<std::size_t>(std::max(0, at_most)));
  std::partial_sort(matches->begin(), matches->begin() + static_cast<std::ptrdiff_t>(kept), matches->end(), better);
  matches->resize(kept);
}

}  // namespace parallax
