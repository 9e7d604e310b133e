// An inverted index of the places seen so far: for every word the images that have it, so that a query touches only
// images that share something with it.
//
// Not thread-safe.
#pragma once

#include <unordered_map>
#include <vector>

#include "place/vocabulary.h"

namespace parallax {

struct PlaceMatch {
  int entry = -1;
  double score = 0;  // similarity(), 0..1
};

class PlaceIndex {
 public:
  // Entries are numbered by the caller, each once.
  void add(int entry, const WordBag& bag);
  void erase(int entry);
  int size() const { return static_cast<int>(slot_of_.size()); }
  const WordBag* find(int entry) const;

  // The entries that share a word with the bag, most alike first (of equal ones the earlier), at most so many. Those
  // for which `skip` is true are left out.
  template <class Skip>
  std::vector<PlaceMatch> query(const WordBag& bag, int at_most, const Skip& skip) const {
    std::vector<PlaceMatch> out;
    for (const PlaceMatch& match : score_all(bag))
      if (!skip(match.entry)) out.push_back(match);
    keep_best(at_most, &out);
    return out;
  }
  std::vector<PlaceMatch> query(const WordBag& bag, int at_most) const {
    return query(bag, at_most, [](int) { return false; });
  }

 private:
  std::vector<PlaceMatch> score_all(const WordBag& bag) const;
  static void keep_best(int at_most, std::vector<PlaceMatch>* matches);

  // Entries have slots, so that a query adds up in an array.
  struct Slot {
    int entry = -1;  // -1: free
    WordBag bag;
  };
  std::unordered_map<std::int32_t, std::vector<std::pair<std::int32_t, float>>> images_with_;  // by word: slots
  std::vector<Slot> slots_;
  std::vector<std::int32_t> free_;
  std::unordered_map<int, std::int32_t> slot_of_;
};

}  // namespace parallax
