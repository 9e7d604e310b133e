#include "camera/image_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "core/file_io.h"

namespace parallax {
namespace {

std::uint8_t byte_at(std::string_view bytes, std::size_t i) { return static_cast<std::uint8_t>(bytes[i]); }

std::uint32_t big_endian_16(std::string_view bytes, std::size_t i) {
  return static_cast<std::uint32_t>(byte_at(bytes, i) << 8 | byte_at(bytes, i + 1));
}
std::uint32_t big_endian_32(std::string_view bytes, std::size_t i) {
  return big_endian_16(bytes, i) << 16 | big_endian_16(bytes, i + 2);
}

// Tables for eight bytes at a time of the CRC that PNG uses (ISO 3309, polynomial 0xEDB88320).
using CrcTables = std::array<std::array<std::uint32_t, 256>, 8>;
constexpr CrcTables make_crc_tables() {
  CrcTables t{};
  for (std::uint32_t n = 0; n < 256; ++n) {
    std::uint32_t c = n;
    for (int k = 0; k < 8; ++k) c = (c & 1) != 0 ? 0xEDB88320u ^ (c >> 1) : c >> 1;
    t[0][n] = c;
  }
  for (std::uint32_t n = 0; n < 256; ++n) {
    for (std::size_t k = 1; k < 8; ++k) t[k][n] = (t[k - 1][n] >> 8) ^ t[0][t[k - 1][n] & 0xff];
  }
  return t;
}

std::uint32_t crc32(std::string_view bytes) {
  static constexpr CrcTables t = make_crc_tables();
  std::uint32_t c = 0xffffffffu;
  std::size_t i = 0;
  for (; i + 8 <= bytes.size(); i += 8) {
    const auto at = [&](std::size_t k) { return static_cast<std::uint32_t>(byte_at(bytes, i + k)); };
    const std::uint32_t low = c ^ (at(0) | at(1) << 8 | at(2) << 16 | at(3) << 24);
    c = t[7][low & 0xff] ^ t[6][(low >> 8) & 0xff] ^ t[5][(low >> 16) & 0xff] ^ t[4][low >> 24] ^ t[3][at(4)] ^
        t[2][at(5)] ^ t[1][at(6)] ^ t[0][at(7)];
  }
  for (; i < bytes.size(); ++i) c = t[0][(c ^ byte_at(bytes, i)) & 0xff] ^ (c >> 8);
  return c ^ 0xffffffffu;
}

constexpr std::string_view kPngSignature("\x89PNG\r\n\x1a\n", 8);

bool is_jpeg(std::string_view bytes) { return bytes.starts_with("\xff\xd8\xff"); }
bool is_png(std::string_view bytes) { return bytes.starts_with(kPngSignature); }

// Walks the segments of a JPEG (ITU T.81, annex B). Calls `frame_header` with the offset of the size fields.
template <typename FrameHeader>
std::string walk_jpeg(std::string_view bytes, bool whole, FrameHeader&& frame_header) {
  std::size_t at = 2;
  for (;;) {
    // To the next marker: 0xff and something that is neither a stuffed zero, a restart nor filling.
    const std::size_t ff = bytes.find('\xff', at);
    if (ff == std::string_view::npos || ff + 1 >= bytes.size()) return "it is cut short (no end-of-image marker)";
    const std::uint8_t marker = byte_at(bytes, ff + 1);
    at = ff + (marker == 0xff ? 1 : 2);
    if (marker == 0 || marker == 0xff || marker == 0x01 || (marker >= 0xd0 && marker <= 0xd8)) continue;
    if (marker == 0xd9) return "";
    if (at + 2 > bytes.size()) return "it is cut short (in a segment header)";
    const std::size_t length = big_endian_16(bytes, at);
    if (length < 2 || at + length > bytes.size()) return "it is cut short (in a segment)";
    const bool is_frame = marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
    if (is_frame && length >= 7) {
      frame_header(at + 3);
      if (!whole) return "";
    }
    at += length;
  }
}

std::string png_damage(std::string_view bytes) {
  std::size_t at = kPngSignature.size();
  while (at + 12 <= bytes.size()) {
    const std::size_t length = big_endian_32(bytes, at);
    if (length > bytes.size() - at - 12) break;
    const std::string_view chunk = bytes.substr(at + 4, 4 + length);
    if (crc32(chunk) != big_endian_32(bytes, at + 8 + length)) {
      return "it is damaged (a PNG chunk has a wrong check sum)";
    }
    if (chunk.starts_with("IEND")) return "";
    at += 12 + length;
  }
  return "it is cut short (no end of the PNG)";
}

cv::Mat to_8_bit(const cv::Mat& image, int deep_bits) {
  if (image.depth() != CV_16U) return image;
  cv::Mat out(image.size(), CV_8UC(image.channels()));
  const int shift = deep_bits - 8;
  for (int y = 0; y < image.rows; ++y) {
    const auto* from = image.ptr<std::uint16_t>(y);
    auto* to = out.ptr<std::uint8_t>(y);
    for (int x = 0; x < image.cols * image.channels(); ++x) {
      const int value = from[x] >> shift;
      to[x] = static_cast<std::uint8_t>(std::min(value, 255));
    }
  }
  return out;
}

// One decoding by OpenCV; an empty text, or why not.
std::string decode_with(std::string_view bytes, int flags, cv::Mat* image) {
  silence_image_libraries();
  const cv::_InputArray data(reinterpret_cast<const std::uint8_t*>(bytes.data()), static_cast<int>(bytes.size()));
  try {
    *image = cv::imdecode(data, flags | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
    return "it cannot be decoded";
  }
  if (image->empty()) return "it cannot be decoded";
  if (image->depth() != CV_8U && image->depth() != CV_16U) return "its pixels are not whole numbers of 8 or 16 bits";
  return "";
}

// Everything that can be told before decoding.
std::string check_before_decoding(std::string_view bytes) {
  if (bytes.empty()) return "it is empty";
  if (bytes.size() > (1u << 30)) return "it is larger than 1 GiB";
  if (image_kind(bytes) == nullptr) return "it is not an image (JPEG, PNG, BMP, PNM, TIFF or WebP expected)";
  if (std::string damage = image_damage(bytes); !damage.empty()) return damage;
  if (const auto size = image_size_from_header(bytes)) return image_size_problem(*size);
  return "";
}

std::string read_bytes(const std::string& path, std::string* bytes) {
  try {
    *bytes = read_text_file(path);
  } catch (const InputError& error) {
    const std::string_view what = error.what();
    return std::string(what.starts_with(path + ": ") ? what.substr(path.size() + 2) : what);
  }
  return "";
}

}  // namespace

const char* image_kind(std::string_view bytes) {
  if (is_jpeg(bytes)) return "JPEG";
  if (is_png(bytes)) return "PNG";
  if (bytes.starts_with("BM")) return "BMP";
  if (bytes.size() > 2 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6' &&
      std::isspace(static_cast<unsigned char>(bytes[2])) != 0) {
    return "PNM";
  }
  if (bytes.starts_with(std::string_view("II*\0", 4)) || bytes.starts_with(std::string_view("MM\0*", 4))) return "TIFF";
  if (bytes.starts_with("RIFF") && bytes.size() >= 12 && bytes.substr(8, 4) == "WEBP") return "WebP";
  return nullptr;
}

bool has_image_name(std::string_view name) {
  const std::size_t dot = name.rfind('.');
  if (dot == std::string_view::npos) return false;
  std::string extension(name.substr(dot + 1));
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  constexpr std::array<const char*, 10> kExtensions{"jpg", "jpeg", "png", "bmp",  "pgm",
                                                    "ppm", "pnm",  "tif", "tiff", "webp"};
  return std::any_of(kExtensions.begin(), kExtensions.end(), [&](const char* known) { return extension == known; });
}

std::string image_damage(std::string_view bytes) {
  if (is_jpeg(bytes)) return walk_jpeg(bytes, true, [](std::size_t) {});
  if (is_png(bytes)) return png_damage(bytes);
  return "";
}

std::optional<ImageSize> image_size_from_header(std::string_view bytes) {
  std::optional<ImageSize> size;
  if (is_png(bytes) && bytes.size() >= 24 && bytes.substr(12, 4) == "IHDR") {
    size = ImageSize{static_cast<int>(std::min(big_endian_32(bytes, 16), 0x7fffffffu)),
                     static_cast<int>(std::min(big_endian_32(bytes, 20), 0x7fffffffu))};
  } else if (is_jpeg(bytes)) {
    walk_jpeg(bytes, false, [&](std::size_t at) {
      size = ImageSize{static_cast<int>(big_endian_16(bytes, at + 2)), static_cast<int>(big_endian_16(bytes, at))};
    });
  }
  return size;
}

std::string to_string(ImageSize size) { return std::to_string(size.width) + "x" + std::to_string(size.height); }

std::string image_size_problem(ImageSize size) {
  if (size.width >= kMinImageWidth && size.height >= kMinImageHeight && size.width <= kMaxImageWidth &&
      size.height <= kMaxImageHeight) {
    return "";
  }
  return "found size " + to_string(size) + ", expected " + to_string(ImageSize{kMinImageWidth, kMinImageHeight}) +
         " to " + to_string(ImageSize{kMaxImageWidth, kMaxImageHeight});
}

std::string decode_image(std::string_view bytes, const ImageDecoding& decoding, DecodedImage* image) {
  if (std::string problem = check_before_decoding(bytes); !problem.empty()) return problem;
  cv::Mat grey;
  if (std::string problem = decode_with(bytes, cv::IMREAD_GRAYSCALE, &grey); !problem.empty()) return problem;
  if (std::string problem = image_size_problem({grey.cols, grey.rows}); !problem.empty()) return problem;
  image->grey = to_8_bit(grey, decoding.deep_bits);
  image->colour.release();
  if (decoding.colour) {
    cv::Mat colour;
    const std::string problem = decode_with(bytes, cv::IMREAD_ANYCOLOR, &colour);
    if (!problem.empty()) return problem;
    if (colour.channels() == 3) image->colour = to_8_bit(colour, decoding.deep_bits);
  }
  return "";
}

std::string load_image(const std::string& path, const ImageDecoding& decoding, DecodedImage* image) {
  std::string bytes;
  if (std::string problem = read_bytes(path, &bytes); !problem.empty()) return problem;
  return decode_image(bytes, decoding, image);
}

std::string probe_image(const std::string& path, ImageProbe* probe) {
  std::string bytes;
  if (std::string problem = read_bytes(path, &bytes); !problem.empty()) return problem;
  if (std::string problem = check_before_decoding(bytes); !problem.empty()) return problem;
  cv::Mat grey;
  if (std::string problem = decode_with(bytes, cv::IMREAD_GRAYSCALE, &grey); !problem.empty()) return problem;
  probe->size = {grey.cols, grey.rows};
  if (std::string problem = image_size_problem(probe->size); !problem.empty()) return problem;
  probe->deep_bits = 16;
  if (grey.depth() == CV_16U) {
    std::uint16_t brightest = 0;
    for (int y = 0; y < grey.rows; ++y) {
      const auto* row = grey.ptr<std::uint16_t>(y);
      brightest = std::max(brightest, *std::max_element(row, row + grey.cols));
    }
    probe->deep_bits = 10;
    while (probe->deep_bits < 16 && brightest >> probe->deep_bits != 0) probe->deep_bits += 2;
  }
  return "";
}

void silence_image_libraries() {
  static std::once_flag once;
  std::call_once(once, [] {
    // Read by OpenCV when FFmpeg is first used; -8 is AV_LOG_QUIET.
    ::setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  });
}

}  // namespace parallax
