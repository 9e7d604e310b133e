// Lossless compression of images (recordings, map files): each pixel is foretold from its neighbours to the left and
// above, and zstd packs what is left. Colour is foretold from grey first, of which it is mostly made.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <span>
#include <string>

#include "core/image.h"

namespace parallax {

// Not thread-safe: keeps its tables and scratch between images.
class ImageCodec {
 public:
  ImageCodec();
  ~ImageCodec();
  ImageCodec(const ImageCodec&) = delete;
  ImageCodec& operator=(const ImageCodec&) = delete;

  // Appends the packed image. Colour may be empty (nothing is appended then), else it is of grey's size.
  void pack_grey(const GreyImage& grey, std::string* bytes);
  void pack_colour(const cv::Mat3b& colour, const GreyImage& grey, std::string* bytes);

  // Unpacks an image of the given size from exactly these bytes; false when they are damaged.
  bool unpack_grey(std::span<const std::uint8_t> bytes, cv::Size size, GreyImage* grey);
  bool unpack_colour(std::span<const std::uint8_t> bytes, const GreyImage& grey, cv::Mat3b* colour);

 private:
  struct Contexts;
  void pack(std::string* bytes);
  bool unpack(std::span<const std::uint8_t> bytes, std::size_t expected);

  std::unique_ptr<Contexts> contexts_;
  std::string residuals_;
};

}  // namespace parallax
