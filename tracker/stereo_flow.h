// Where a patch of one image went in the next: pyramidal KLT (Lucas and Kanade 1981; Bouguet 2000) with 8x8 windows by
// inverse composition, which takes up a change of brightness, tracked forward and back again (MS §3.1).
//
// Level-0 pixels. Safe from any thread.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "core/image.h"

namespace parallax {

struct FlowOptions {
  int coarsest_level = 3;  // begins there; the capture range is about 2 px of that level about the guess
  double max_round_trip_px = 0.7;
};

// The place in `next` of what is at `from` in `last`, looked for about `guess`; nothing when it has left the image,
// does not look alike or does not come back.
std::optional<Eigen::Vector2d> track_forward_backward(const ImagePyramid& last, const ImagePyramid& next,
                                                      const Eigen::Vector2d& from, const Eigen::Vector2d& guess,
                                                      const FlowOptions& options);

}  // namespace parallax
