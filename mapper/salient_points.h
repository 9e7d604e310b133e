// Candidates for new map points in a keyframe (PTAM §6.2): maximal FAST corners with a Shi-Tomasi score, away from what
// is already measured, spread over the image.
#pragma once

#include <vector>

#include "map/entities.h"
#include "mapper/mapper_options.h"

namespace parallax {

struct SalientPoint {
  int level = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // pixels of `level`
  double score = 0;                                 // Shi-Tomasi, grey levels squared
};

// Best first within each level, at most max_new_points a level; levels in ascending order.
std::vector<SalientPoint> find_salient_points(const FrameImages& images, const std::vector<Measurement>& measured,
                                              const MapperOptions& options);

}  // namespace parallax
