// Whether two maps show one place, and where it lies: the keyframes of one that look like keyframes of the other are
// aligned (mapper/keyframe_matching), and alignments that agree with each other are believed.
//
// Plain functions, safe from any thread while nobody writes the maps. Deterministic.
#pragma once

#include <memory>
#include <random>
#include <string>
#include <vector>

#include "core/interruption.h"
#include "mapper/keyframe_matching.h"
#include "place/vocabulary.h"

namespace parallax {

struct CommonPlaceOptions {
  PlaceAlignmentOptions alignment;
  int candidates_per_keyframe = 3;  // keyframes of the one map that are looked at for one of the other
  int max_tries = 80;               // alignments tried, the likeliest first
  int enough_alignments = 8;        // found: no more are looked for
  int agreeing_keyframes = 2;       // of the other map that must lead to the same transform...
  int strong_inliers = 90;          // ...or one with so many pairs
  double max_disagreement = 0.05;   // two alignments of one place: of the distance it is seen from, and of the scale
  double max_contradiction = 0.4;   // pairs of alignments that say otherwise, as part of those that agree

  // Throws InputError when a value is out of range.
  void validate() const;
};

struct CommonPlace {
  bool found = false;
  std::string reason;             // why not, for the user
  SimilarityTransform a_from_b;   // of the alignment that most agree with
  std::vector<PointPair> pairs;   // of all that agree; a point of b once
  int alignments = 0, tries = 0;  // that agree; that were tried
};

// The vocabulary is not empty.
CommonPlace find_common_place(const Map& a, const Map& b, const CameraModel& camera,
                              std::shared_ptr<const Vocabulary> vocabulary, const CommonPlaceOptions& options,
                              std::mt19937_64* rng, const Interruption& stop = {});

}  // namespace parallax
