// What cameras deliver, turned into the images the program works with. Pure functions on bytes in memory: no device, no
// state. The bytes come from outside and are trusted in nothing but their address and count.
//
// Grey is the luma as the camera sends it: for the YUV formats and for Motion JPEG it is copied out of the picture
// without a way through RGB, and is the same whether colour is wanted or not. RGB is weighted as in BT.601. Colour out
// of YUV is BT.601 with the video range, as USB cameras send it (UVC 1.5, section 3.9.2.6); out of JPEG the full range
// (JFIF).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/image.h"

namespace parallax {

// In the order of preference: what costs least to turn into grey and colour first.
enum class PixelFormat { yuyv, uyvy, nv12, bgr24, rgb24, grey, mjpeg };

// The four characters by which V4L2 names a format, as a number (first character in the lowest byte) and as text.
constexpr std::uint32_t fourcc(char a, char b, char c, char d) {
  const auto byte = [](char character) { return static_cast<std::uint32_t>(static_cast<unsigned char>(character)); };
  return byte(a) | byte(b) << 8 | byte(c) << 16 | byte(d) << 24;
}
// Characters that cannot be printed become '?', spaces at the end are dropped.
std::string fourcc_text(std::uint32_t code);

std::uint32_t fourcc_of(PixelFormat format);
// Nothing for a format that is not decoded here. JPEG is taken as Motion JPEG.
std::optional<PixelFormat> pixel_format_of(std::uint32_t fourcc_code);
// All of them, "YUYV, UYVY, ...", for messages.
std::string known_pixel_formats();

// One picture as the driver left it in memory. Nothing is owned.
struct RawPicture {
  PixelFormat format = PixelFormat::yuyv;
  int width = 0, height = 0;
  std::size_t stride = 0;  // bytes from one row to the next; 0: rows follow each other; not for mjpeg
  std::span<const std::uint8_t> bytes;
  // NV12 only: the chroma rows when they do not follow the luma rows (at stride * height) in `bytes`.
  std::span<const std::uint8_t> chroma;
};

// Writes new images (never into memory that others may still refer to). `colour` may be null when it is not wanted; it
// stays empty for grey cameras. Returns why the picture cannot be used ("holds 100 bytes, expected 614400"), or an
// empty text. A JPEG that is cut short or damaged is refused; bytes between the end of its data and its end mark, which
// some cameras send, are not damage.
std::string decode_picture(const RawPicture& picture, GreyImage* grey, cv::Mat3b* colour);

}  // namespace parallax
