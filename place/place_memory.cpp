#include "place/place_memory.h"

#include "core/check.h"

namespace parallax {

PlaceMemory::PlaceMemory(std::shared_ptr<const Vocabulary> vocabulary, const PlaceFeatureOptions& options)
    : vocabulary_(std::move(vocabulary)), options_(options) {
  PARALLAX_CHECK(vocabulary_ && !vocabulary_->empty(), "places are remembered by a vocabulary");
}

WordBag PlaceMemory::bag_of(const ImagePyramid& pyramid) const {
  return vocabulary_->bag_of(descriptors_of(extract_place_features(pyramid, options_)));
}

double PlaceMemory::similarity_to(int entry, const WordBag& bag) const {
  const WordBag* known = index_.find(entry);
  return known ? similarity(*known, bag) : 0;
}

}  // namespace parallax
