// The camera's sensor: turns the light of a rendered picture into 8-bit values with gain, vignetting, a covering hand
// and noise. Pure function of its arguments.
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>

namespace parallax {

struct SensorSettings {
  double gain = 1;
  double vignetting = 0;  // loss of light in the corner of the image, 0..1
  double cover = 0;       // 0: free lens, 1: covered; between: an edge comes in from the right
  double noise = 0;       // standard deviation, grey levels
  std::uint64_t seed = 0;
};

// light: values 0..255. `colour` may be empty.
void expose(const cv::Mat1f& grey, const cv::Mat3f& colour, const SensorSettings& settings, cv::Mat1b* out_grey,
            cv::Mat3b* out_colour);

}  // namespace parallax
