// What the trails know of the motion of the image as a whole: a rough affine flow from frame to frame that tells where
// to start each patch, and the local linear motion around each trail since the first frame.
//
// Level-0 pixels throughout. Plain functions; safe from any thread.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/image.h"
#include "tracker/trail_tracker.h"

namespace parallax {

// A pixel of the last frame appears at linear * p + offset in the next.
struct ImageFlow {
  Eigen::Matrix2d linear = Eigen::Matrix2d::Identity();
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();
  Eigen::Vector2d operator()(const Eigen::Vector2d& p) const { return linear * p + offset; }
};

// Searches a sample of the trails exhaustively at the level `coarse`, within `radius_px` of the predicted shift, and
// fits an affine flow robustly; a shift alone, or the prediction itself, when too few of them agree.
ImageFlow estimate_flow(const ImagePyramid& last, const ImagePyramid& next, const std::vector<Trail>& trails,
                        int coarse, const Eigen::Vector2d& predicted_shift, double radius_px);

// For each trail the linear part of current_from_first, by robust least squares over its neighbours in the first frame.
std::vector<Eigen::Matrix2d> local_linear_motion(const std::vector<Trail>& trails);

}  // namespace parallax
