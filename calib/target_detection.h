// Finds a calibration target in an image and its points to sub-pixel accuracy.
//
// Pixels: level 0, the centre of the top-left pixel is (0, 0). Pure functions, safe from any thread. Detection of
// candidates is OpenCV's (chessboard, markers, blobs); squares, ordering, refinement and the checks are ours.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/target.h"
#include "core/image.h"

namespace parallax {

struct TargetCorner {
  int id = 0;  // of target_points()
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
};

struct TargetDetection {
  std::vector<TargetCorner> corners;  // by id, each at most once
  double spacing_px = 0;              // median distance of neighbours
  double edge_px = 0;                 // width of a black-to-white edge: about 2 when sharp, more when blurred
};

struct DetectionOptions {
  // Also the slow ways, which find boards that are small, dark or strongly bent: for images on disk. Live frames do
  // without.
  bool thorough = true;
  // Fewest points a detection has (ChArUco boards may be seen in part; others are seen whole).
  int min_corners = 8;
};

// Nothing when the target is not seen (whole, except ChArUco). Symmetric targets may come turned (target_symmetries).
std::optional<TargetDetection> detect_target(const GreyImage& image, const CalibrationTarget& target,
                                             const DetectionOptions& options = {});

}  // namespace parallax
