// The similarity transform between two maps from pairs of points: its reprojection errors in the views of both sides,
// and its refinement by iteratively re-weighted least squares (Tukey's biweight, median-based scale).
//
// Plain functions, safe from any thread.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "core/se3.h"
#include "mapper/place_view.h"

namespace parallax {

// Rows of the points of two views.
using RowPair = std::pair<int, int>;

// How far the pair is off in either view, in standard deviations: b's point seen where a's was measured, and the other
// way round; infinite behind a camera.
struct PairError {
  double in_a = 0, in_b = 0;
  double worse() const { return in_a > in_b ? in_a : in_b; }
};
PairError pair_error(const PlaceView& a, const PlaceView& b, const RowPair& pair, const SimilarityTransform& a_from_b,
                     const SimilarityTransform& b_from_a);

// Refines in place; `fixed_scale`: the scale stays as it is. Returns the robust standard deviation of the normalised
// errors, 0 when there is too little to refine from (unchanged then).
double refine_similarity(const PlaceView& a, const PlaceView& b, std::span<const RowPair> pairs, bool fixed_scale,
                         SimilarityTransform* a_from_b);

}  // namespace parallax
