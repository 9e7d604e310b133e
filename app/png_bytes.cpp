#include "app/png_bytes.h"

#include <opencv2/imgcodecs.hpp>

#include "core/error.h"

namespace parallax {

std::vector<std::uint8_t> png_bytes(const cv::Mat& image, const std::string& name) {
  std::vector<std::uint8_t> bytes;
  if (!cv::imencode(".png", image, bytes)) throw RunError(name + ": cannot be encoded as PNG");
  return bytes;
}

}  // namespace parallax
