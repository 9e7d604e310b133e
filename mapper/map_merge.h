// Merging two maps of one place that were made apart: the place is found in both (mapper/common_place), the other map
// is moved to the base's world by a similarity transform, points that are one are fused, points of either are looked
// for in the keyframes of the other, and everything is adjusted together.
//
// A pure function of two documents: neither is changed, so that whoever keeps them can undo it. Safe from any thread.
// What is no common place, or does not hold together, is refused with one line for the user, never merged wrongly.
#pragma once

#include <memory>
#include <string>

#include "core/interruption.h"
#include "map/map_document.h"
#include "mapper/common_place.h"
#include "mapper/mapper_options.h"

namespace parallax {

struct MapMergeOptions {
  CommonPlaceOptions place;
  MapperOptions mapper;          // how points are measured, the map adjusted, and the bound of its keyframes
  double max_scale_error = 0.1;  // where both scales are known, they agree to this part
  int min_common_points = 40;    // measured from keyframes of both, after the adjustment
  double min_found_part = 0.2;   // of the points of either looked for in keyframes of the other
  double min_kept_part = 0.5;    // of the other map's measurements, after the adjustment
  std::uint64_t seed = 1;

  // Throws InputError when a value is out of range.
  void validate() const;
};

struct MapMergeResult {
  bool merged = false;
  std::string reason;  // why not, for the user: one line
  // Base's world, metres of it; when only the other's scale is known, base's world re-scaled to that. Identifiers of
  // base's keyframes, points and content are kept.
  MapDocument document;
  SimilarityTransform base_from_other;      // where the other's world lies in base's, as adjusted
  SimilarityTransform document_from_base;   // the identity unless the other's scale was taken
  SimilarityTransform document_from_other;  // document_from_base * base_from_other
  int alignments = 0;                       // of places that agreed
  int points_fused = 0;                     // points of the other map that base has
  int measurements_added = 0;               // of points of the one in keyframes of the other
  int common_points = 0;                    // measured from keyframes of both
  int keyframes_removed = 0;                // redundant ones
  double found_part = 0;                    // of the points looked for in the other's keyframes
};

// Both made with this camera (the caller compares calibrations; images of another size are refused). The vocabulary is
// not empty. Content of both is kept, what is in both once; of games' states, base's, else the other's.
MapMergeResult merge_maps(const MapDocument& base, const MapDocument& other, const CameraModel& camera,
                          std::shared_ptr<const Vocabulary> vocabulary, const MapMergeOptions& options,
                          const Interruption& stop = {});

}  // namespace parallax
