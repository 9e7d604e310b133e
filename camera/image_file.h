// Image files into memory: grey always, colour when asked for, whole or refused.
//
// Grey is decoded by itself (for a JPEG its luminance, which is also the fastest way), never derived from the colour
// image, so that the tracker's input has the same bits whether colour is wanted or not. The camera's own pixels are
// wanted: a rotation noted in the file is ignored. Functions are safe from any thread.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/frame.h"

namespace parallax {

// The sizes this program works with.
inline constexpr int kMinImageWidth = 160, kMinImageHeight = 120;
inline constexpr int kMaxImageWidth = 1920, kMaxImageHeight = 1080;

struct DecodedImage {
  GreyImage grey;
  cv::Mat3b colour;  // empty for grey files and when not asked for
};

// How images deeper than 8 bits become 8: the value is divided by 2^(bits - 8), what is beyond is saturated. `bits` is
// the smallest of 10, 12, 14 and 16 that holds the brightest pixel of the recording's first image (cameras store 10 or
// 12 bits in 16-bit files), and it stays for the whole recording, so that brightness does not jump.
struct ImageDecoding {
  bool colour = false;
  int deep_bits = 16;
};

// What an image file is, from its first bytes: nothing when it is no JPEG, PNG, BMP, PNM, TIFF or WebP image.
const char* image_kind(std::string_view bytes);
// By its name: .jpg .jpeg .png .bmp .pgm .ppm .pnm .tif .tiff .webp in any case.
bool has_image_name(std::string_view name);

// Why the bytes of a JPEG or PNG are not a whole file (no end-of-image marker, a chunk cut short or with a wrong sum),
// or an empty text. Other kinds are left to the decoder.
std::string image_damage(std::string_view bytes);

// Width and height from the header of a JPEG or PNG, without decoding.
struct ImageSize {
  int width = 0, height = 0;
  bool operator==(const ImageSize&) const = default;
};
std::optional<ImageSize> image_size_from_header(std::string_view bytes);
std::string to_string(ImageSize size);  // "640x480"

// Empty when the size is one this program works with, else what was found and expected.
std::string image_size_problem(ImageSize size);

// Decodes; returns why not, or an empty text. The size limits hold.
std::string decode_image(std::string_view bytes, const ImageDecoding& decoding, DecodedImage* image);
// The same from a file. The reason does not name the file.
std::string load_image(const std::string& path, const ImageDecoding& decoding, DecodedImage* image);

// The first image of a recording: its size, and the bits to use for the rest (16 for 8-bit images).
struct ImageProbe {
  ImageSize size;
  int deep_bits = 16;
};
std::string probe_image(const std::string& path, ImageProbe* probe);

// OpenCV and FFmpeg print to stderr by themselves; this stops them. Called before either is used; cheap after the
// first.
void silence_image_libraries();

}  // namespace parallax
