// FAST-10 corners (Rosten and Drummond 2006; PTAM §5.1) without non-maximum suppression, in row order with a row
// look-up table (PTAM §6.5), thresholds that adapt, and the salience measures that pick new map points (PTAM §6.2).
//
// Vectorised (SSE2, AVX2, AVX-512 chosen at run time); fast_corners_scalar() is the reference, and gives the same
// corners.
#pragma once

#include <cstdint>
#include <vector>

#include "core/image.h"

namespace parallax {

struct Corner {
  std::int16_t x = 0, y = 0;  // pixel at the corner's own level
  bool operator==(const Corner&) const = default;
};

// The corners of one level, sorted by row, then column; rows[y] is the index of the first corner in row y or below,
// with rows.size() == height + 1, so row y holds corners [rows[y], rows[y + 1]).
struct CornerList {
  std::vector<Corner> corners;
  std::vector<int> rows;
};

// FAST-10: a pixel is a corner when 10 contiguous pixels of the 16 on the radius-3 circle are all brighter than
// centre + threshold or all darker than centre - threshold. Corners within 3 px of the border are not found.
void fast_corners(const GreyImage& image, int threshold, CornerList* out);
void fast_corners_scalar(const GreyImage& image, int threshold, CornerList* out);

// The largest threshold at which the pixel is still a FAST-10 corner (0 when it is none at 0 or above): the score for
// non-maximum suppression.
int fast_score(const GreyImage& image, int x, int y);

// Corners that are maximal in their 3x3 neighbourhood by fast_score, in row order (PTAM §6.1, "maximal FAST corners").
std::vector<Corner> maximal_corners(const GreyImage& image, const CornerList& corners);

// Shi-Tomasi score: the smaller eigenvalue of the gradient matrix over a (2 half + 1)^2 window, divided by its number
// of pixels (units: grey levels squared). 0 too near the border.
float shi_tomasi_score(const GreyImage& image, int x, int y, int half = 3);

// Keeps the number of corners of a level useful: call after each frame with what was found; raises or lowers the
// threshold (a small step a frame, within [min, max]) towards the target count.
struct AdaptiveThreshold {
  int threshold = 10;
  int min_threshold = 5, max_threshold = 40;
  int target = 1000;  // corners at this level
  void update(int found);

  // The last move, so that a target between two thresholds does not make it swing: grey levels, and the |log(found /
  // target)| that called for it.
  int last_step = 0;
  double last_error = 0;
};

}  // namespace parallax
