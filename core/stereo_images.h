// A rectified pair of images: what the stereo odometry and the textured map get. Level 0 of a StereoCamera
// (core/stereo_camera.h): equal sizes, rows aligned.
#pragma once

#include <opencv2/core/mat.hpp>

#include "core/image.h"
#include "core/time.h"

namespace parallax {

// The pixels are shared as cv::Mat shares them; nobody writes to them once the pair has been handed on.
struct StereoImages {
  int index = 0;      // of the frame in its source
  Timestamp time{0};  // of the left image
  GreyImage left, right;
  cv::Mat3b colour;  // of the left camera, BGR; empty when the source is grey or colour was not asked for
};

}  // namespace parallax
