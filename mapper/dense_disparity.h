// The dense disparity map of a rectified pair (MS §3.1), which the textured map is made of: OpenCV's semi-global
// matching (Hirschmueller, Stereo processing by semiglobal matching and mutual information, PAMI 2008) with its
// left-right check, then every disparity is set between the pixels by a parabola over the differences of its
// neighbourhood, and what does not fit is dropped.
//
// On one thread, and the same to the last bit every time. Not thread-safe: keeps its scratch.
#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>

#include "core/image.h"
#include "core/stereo_camera.h"

namespace parallax {

struct DisparityOptions {
  // What is nearer is not found. Sets the range that is searched, at most a quarter of the image's width.
  double nearest_m = 0.6;
  int block_px = 5;             // odd, side of the block that is compared
  double left_right_px = 1;     // most the two directions may differ
  int uniqueness_percent = 10;  // by which the best cost beats the second
  int least_speckle_px = 80;    // smaller patches of one disparity are dropped
  double least_contrast = 1.5;  // grey levels: standard deviation of a block along the row, less cannot be refined

  void validate() const;  // throws InputError naming the field
};

class DenseDisparity {
 public:
  explicit DenseDisparity(const StereoCamera& camera, const DisparityOptions& options = {});
  ~DenseDisparity();
  DenseDisparity(const DenseDisparity&) = delete;
  DenseDisparity& operator=(const DenseDisparity&) = delete;

  // Of the left image, in pixels; 0 where it is not known. Images of the camera's size (CHECK).
  cv::Mat1f compute(const GreyImage& left, const GreyImage& right);

  int most_disparity_px() const { return range_; }

 private:
  struct Matcher;

  StereoCamera camera_;
  DisparityOptions options_;
  int range_ = 0;
  std::unique_ptr<Matcher> matcher_;
};

}  // namespace parallax
