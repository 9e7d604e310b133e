// The same point in the right image (MS §3.1): a search along the row for a corner that is new, and sub-pixel alignment
// of its window.
//
// Level-0 pixels of a rectified pair. Safe from any thread.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "core/image.h"
#include "tracker/affine_alignment.h"

namespace parallax {

struct RowSearch {
  double max_disparity_px = 128;
  double max_row_difference_px = 1;
  double min_correlation = 0.8;
  double max_round_trip_px = 0.7;
};

// Whole disparities, by zero-mean differences of 8x8 blocks. Nothing when none is clearly the best.
std::optional<double> search_row(const GreyImage& left, const GreyImage& right, const Eigen::Vector2d& corner,
                                 const RowSearch& search);

struct RightMatch {
  double x = 0;                                          // u_right
  Eigen::Matrix2d linear = Eigen::Matrix2d::Identity();  // right_from_window
};

// The window (taken at a left image) about `guess` in the right image. `linear` is where its shape begins; with
// `affine` that is found too. Nothing when it does not look alike or lies in another row than `row`.
std::optional<RightMatch> align_right(const AffineTemplate& window, const cv::Mat1f& right_smooth, double guess_x,
                                      double row, const Eigen::Matrix2d& linear, const RowSearch& search,
                                      const Eigen::Vector2d& perspective = Eigen::Vector2d::Zero());

}  // namespace parallax
