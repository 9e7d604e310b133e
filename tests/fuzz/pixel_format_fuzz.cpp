// libFuzzer target: what a camera may leave in memory, decoded as every format. The first bytes choose the format, the
// size and the stride.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>

#include "camera/pixel_format.h"

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::size_t header = 5;
  if (size < header) return 0;
  parallax::RawPicture picture;
  constexpr int formats = static_cast<int>(parallax::PixelFormat::mjpeg) + 1;
  picture.format = static_cast<parallax::PixelFormat>(data[0] % formats);
  picture.width = data[1];
  picture.height = data[2];
  picture.stride = static_cast<std::size_t>(data[3]) * 3;
  picture.bytes = std::span(data, size).subspan(header);
  if (data[4] & 1) picture.chroma = picture.bytes.subspan(picture.bytes.size() / 2);
  parallax::GreyImage grey, grey_alone;
  cv::Mat3b colour;
  const std::string problem = parallax::decode_picture(picture, &grey, &colour);
  require(problem.find('\n') == std::string::npos);
  require(problem == parallax::decode_picture(picture, &grey_alone, nullptr));
  if (!problem.empty()) return 0;
  require(grey.cols == picture.width && grey.rows == picture.height);
  require(colour.empty() || colour.size() == grey.size());
  for (int y = 0; y < grey.rows; ++y) {
    for (int x = 0; x < grey.cols; ++x) require(grey(y, x) == grey_alone(y, x));
  }
  return 0;
}
