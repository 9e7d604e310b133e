// Images that can be asked for by what they look like: features, visual words and the inverted index in one.
//
// Not thread-safe; the vocabulary may be shared.
#pragma once

#include <memory>
#include <vector>

#include "place/place_features.h"
#include "place/place_index.h"

namespace parallax {

class PlaceMemory {
 public:
  // The vocabulary is not empty.
  explicit PlaceMemory(std::shared_ptr<const Vocabulary> vocabulary, const PlaceFeatureOptions& options = {});

  // What an image is remembered by; two milliseconds of 640x480. Safe from any thread.
  WordBag bag_of(const ImagePyramid& pyramid) const;

  // Entries are numbered by the caller, each once.
  void add(int entry, const WordBag& bag) { index_.add(entry, bag); }
  void erase(int entry) { index_.erase(entry); }
  bool contains(int entry) const { return index_.find(entry) != nullptr; }
  int size() const { return index_.size(); }

  // The entries most alike first, at most so many, without those that `skip(entry)` is true for.
  template <class Skip>
  std::vector<PlaceMatch> query(const WordBag& bag, int at_most, const Skip& skip) const {
    return index_.query(bag, at_most, skip);
  }
  // How alike an entry is; 0 for one that is not there.
  double similarity_to(int entry, const WordBag& bag) const;

 private:
  std::shared_ptr<const Vocabulary> vocabulary_;
  PlaceFeatureOptions options_;
  PlaceIndex index_;
};

}  // namespace parallax
