// Pictures as the bytes of a PNG file.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace parallax {

// Grey or colour (blue, green, red), 8 or 16 bit. `name` is what an error speaks of. Throws RunError.
std::vector<std::uint8_t> png_bytes(const cv::Mat& image, const std::string& name);

}  // namespace parallax
