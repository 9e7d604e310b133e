// The detectors of the single targets, and what they share. Internal to calib/target_detection.
#pragma once

#include <opencv2/core/types.hpp>
#include <vector>

#include "calib/target_detection.h"

namespace parallax {

// Each returns the points by id, refined; empty when the target is not there.
std::vector<TargetCorner> detect_chessboard(const GreyImage& image, const CalibrationTarget& target,
                                            const DetectionOptions& options);
std::vector<TargetCorner> detect_charuco(const GreyImage& image, const CalibrationTarget& target,
                                         const DetectionOptions& options);
std::vector<TargetCorner> detect_circles(const GreyImage& image, const CalibrationTarget& target,
                                         const DetectionOptions& options);
std::vector<TargetCorner> detect_squares(const GreyImage& image, const CalibrationTarget& target,
                                         const DetectionOptions& options);

// Moves a corner where black and white meet to where the gradients around it say it is (the point that all edges point
// to), within a window of the given radius. False when it leaves the window or the image.
bool refine_corner(const GreyImage& image, int radius_px, cv::Point2f* corner);

}  // namespace parallax
