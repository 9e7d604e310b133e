#include "place/place_index.h"

#include <algorithm>

#include "core/check.h"

namespace parallax {

void PlaceIndex::add(int entry, const WordBag& bag) {
  PARALLAX_CHECK(bags_.emplace(entry, bag).second, "an entry that the index has");
  for (const auto& [word, weight] : bag) images_with_[word].emplace_back(entry, weight);
}

void PlaceIndex::erase(int entry) {
  const auto it = bags_.find(entry);
  if (it == bags_.end()) return;
  for (const auto& [word, weight] : it->second) {
    auto& list = images_with_[word];
    std::erase_if(list, [entry](const auto& image) { return image.first == entry; });
    if (list.empty()) images_with_.erase(word);
  }
  bags_.erase(it);
}

const WordBag* PlaceIndex::find(int entry) const {
  const auto it = bags_.find(entry);
  return it == bags_.end() ? nullptr : &it->second;
}

std::vector<PlaceMatch> PlaceIndex::score_all(const WordBag& bag) const {
  std::unordered_map<int, double> scores;
  for (const auto& [word, weight] : bag) {
    const auto it = images_with_.find(word);
    if (it == images_with_.end()) continue;
    for (const auto& [entry, other] : it->second) scores[entry] += std::min(weight, other);
  }
  std::vector<PlaceMatch> out;
  out.reserve(scores.size());
  for (const auto& [entry, score] : scores) out.push_back({entry, score});
  // The table's own order is nobody's business.
  std::sort(out.begin(), out.end(), [](const PlaceMatch& a, const PlaceMatch& b) { return a.entry < b.entry; });
  return out;
}

void PlaceIndex::keep_best(int at_most, std::vector<PlaceMatch>* matches) {
  std::stable_sort(matches->begin(), matches->end(),
                   [](const PlaceMatch& a, const PlaceMatch& b) { return a.score > b.score; });
  if (static_cast<int>(matches->size()) > at_most) matches->resize(static_cast<std::size_t>(at_most));
}

}  // namespace parallax
