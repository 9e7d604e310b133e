// The detectors of the single targets, and what they share. Internal to calib/target_detection.
#pragma once

#include <algorithm>
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

// The radius to use below, with the nearest other corner so far away.
inline double crossing_radius(double nearest_px) { return std::clamp(0.4 * nearest_px, 2.5, 5.0); }

// The same for a corner where four squares meet, once it is known to within a pixel: the saddle of the quadratic that
// fits the grey values best, those near the corner counting most (Lucchese and Mitra 2002). Errs about half as much
// as refine_corner(). Stays where it is when there is no saddle within a pixel.
void refine_crossing(const GreyImage& image, double radius_px, cv::Point2f* corner);

}  // namespace parallax
