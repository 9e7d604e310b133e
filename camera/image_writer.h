// Writes an image file, whole or not at all. Keeps the codecs out of everybody else's headers.
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

namespace parallax {

// PNG, whatever the name. Throws RunError when it cannot be written.
void write_png(const std::string& path, const cv::Mat& image);

}  // namespace parallax
