// How bright and of which colour the light in the scene is, from the camera's image, so that virtual things do not glow
// in a dark room.
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace parallax {

// A running estimate, smoothed over about half a second. Not thread-safe.
class LightEstimate {
 public:
  // One frame: CV_8UC1 or CV_8UC3 (BGR). Cheap: it looks at a small part of the pixels. Returns the estimate: linear
  // RGB, 1 is a well-lit scene (mean image level of a grey world exposed as usual).
  Eigen::Vector3f update(const cv::Mat& image);

 private:
  Eigen::Vector3f light_ = Eigen::Vector3f::Constant(1);
  bool started_ = false;
};

}  // namespace parallax
