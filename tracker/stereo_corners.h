// Shi-Tomasi corners where there are no tracks yet (MS §3.1): spread over the image by a minimum distance and by
// looking first where tracks are fewest.
//
// Level-0 pixels. A plain function; safe from any thread.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/image.h"

namespace parallax {

struct CornerSearch {
  int wanted = 250;  // tracks in all, those that are there among them
  double min_distance_px = 15;
  double min_score = 3;  // smaller eigenvalue of the mean gradient matrix over 7x7 pixels, grey levels squared
  int border_px = 12;
  GreyImage mask;  // 0: no corner there; empty: anywhere
};

// At most `wanted` less those taken, the best of each part of the image first.
std::vector<Eigen::Vector2d> find_stereo_corners(const GreyImage& image, const std::vector<Eigen::Vector2d>& taken,
                                                 const CornerSearch& search);

}  // namespace parallax
