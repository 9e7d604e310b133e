#include "camera/pixel_format.h"

#include <turbojpeg.h>

#include <array>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "camera/image_file.h"

namespace parallax {
namespace {

struct KnownFormat {
  PixelFormat format;
  std::uint32_t code;
};

constexpr std::array<KnownFormat, 7> kFormats{{{PixelFormat::yuyv, fourcc('Y', 'U', 'Y', 'V')},
                                               {PixelFormat::uyvy, fourcc('U', 'Y', 'V', 'Y')},
                                               {PixelFormat::nv12, fourcc('N', 'V', '1', '2')},
                                               {PixelFormat::bgr24, fourcc('B', 'G', 'R', '3')},
                                               {PixelFormat::rgb24, fourcc('R', 'G', 'B', '3')},
                                               {PixelFormat::grey, fourcc('G', 'R', 'E', 'Y')},
                                               {PixelFormat::mjpeg, fourcc('M', 'J', 'P', 'G')}}};
constexpr std::uint32_t kJpeg = fourcc('J', 'P', 'E', 'G');

std::size_t bytes_per_row(PixelFormat format, int width) {
  const auto pixels = static_cast<std::size_t>(width);
  switch (format) {
    case PixelFormat::yuyv:
    case PixelFormat::uyvy:
      return 2 * pixels;
    case PixelFormat::bgr24:
    case PixelFormat::rgb24:
      return 3 * pixels;
    default:
      return pixels;
  }
}

// The last row may end with its last pixel.
std::size_t bytes_of_rows(std::size_t rows, std::size_t stride, std::size_t row) { return (rows - 1) * stride + row; }

std::string too_short(std::size_t found, std::size_t expected, const char* what = "") {
  return "holds " + std::to_string(found) + what + " bytes, expected " + std::to_string(expected);
}

// A header over rows in foreign memory; OpenCV has no const one, and what is made from it here is only read.
template <class Pixel>
cv::Mat_<Pixel> view_of(const std::uint8_t* bytes, int rows, int columns, std::size_t stride) {
  return cv::Mat_<Pixel>(rows, columns, reinterpret_cast<Pixel*>(const_cast<std::uint8_t*>(bytes)), stride);
}

std::string decode_packed_yuv(const RawPicture& picture, std::size_t stride, GreyImage* grey, cv::Mat3b* colour) {
  if (picture.width % 2 != 0) return "is " + std::to_string(picture.width) + " pixels wide, expected an even number";
  const auto pixels = view_of<cv::Vec2b>(picture.bytes.data(), picture.height, picture.width, stride);
  const bool yuyv = picture.format == PixelFormat::yuyv;
  GreyImage luma;
  cv::extractChannel(pixels, luma, yuyv ? 0 : 1);
  *grey = luma;
  if (colour != nullptr) cv::cvtColor(pixels, *colour, yuyv ? cv::COLOR_YUV2BGR_YUY2 : cv::COLOR_YUV2BGR_UYVY);
  return "";
}

std::string decode_nv12(const RawPicture& picture, std::size_t stride, GreyImage* grey, cv::Mat3b* colour) {
  if (picture.width % 2 != 0 || picture.height % 2 != 0) {
    return "is " + to_string(ImageSize{picture.width, picture.height}) + ", expected even numbers";
  }
  const std::size_t luma_bytes = stride * static_cast<std::size_t>(picture.height);
  const auto rows = static_cast<std::size_t>(picture.height / 2);
  const std::size_t chroma_bytes = bytes_of_rows(rows, stride, static_cast<std::size_t>(picture.width));
  const std::uint8_t* chroma = picture.chroma.data();
  if (!picture.chroma.empty()) {
    if (picture.chroma.size() < chroma_bytes) return too_short(picture.chroma.size(), chroma_bytes, " chroma");
  } else {
    if (picture.bytes.size() < luma_bytes + chroma_bytes) {
      return too_short(picture.bytes.size(), luma_bytes + chroma_bytes);
    }
    chroma = picture.bytes.data() + luma_bytes;
  }
  const auto luma = view_of<uchar>(picture.bytes.data(), picture.height, picture.width, stride);
  *grey = luma.clone();
  if (colour != nullptr) {
    const auto pairs = view_of<cv::Vec2b>(chroma, picture.height / 2, picture.width / 2, stride);
    cv::cvtColorTwoPlane(luma, pairs, *colour, cv::COLOR_YUV2BGR_NV12);
  }
  return "";
}

std::string decode_rgb(const RawPicture& picture, std::size_t stride, GreyImage* grey, cv::Mat3b* colour) {
  const auto pixels = view_of<cv::Vec3b>(picture.bytes.data(), picture.height, picture.width, stride);
  const bool bgr = picture.format == PixelFormat::bgr24;
  GreyImage weighted;
  cv::cvtColor(pixels, weighted, bgr ? cv::COLOR_BGR2GRAY : cv::COLOR_RGB2GRAY);
  *grey = weighted;
  if (colour == nullptr) return "";
  if (bgr) {
    *colour = pixels.clone();
  } else {
    cv::cvtColor(pixels, *colour, cv::COLOR_RGB2BGR);
  }
  return "";
}

using Decompressor = std::unique_ptr<void, decltype(&tjDestroy)>;

// What the decoder says about stray bytes before the end mark (0xd9): the picture is whole.
bool is_harmless(tjhandle handle) {
  const std::string text = tjGetErrorStr2(handle);
  return tjGetErrorCode(handle) == TJERR_WARNING && text.find("extraneous bytes before marker 0xd9") != text.npos;
}

std::string damaged(tjhandle handle) { return std::string("is a damaged JPEG: ") + tjGetErrorStr2(handle); }

// Planes as the JPEG holds them: decoded once, the first is the grey image, all three make the colour one.
std::string decode_jpeg(const RawPicture& picture, GreyImage* grey, cv::Mat3b* colour) {
  // A new one for every picture (about a microsecond): one that has met a damaged header refuses all that follow, and
  // tables of an earlier picture would be used for one that lacks its own.
  const Decompressor owner(tjInitDecompress(), &tjDestroy);
  tjhandle handle = owner.get();
  if (handle == nullptr) return "cannot be decoded: no JPEG decoder";
  int width = 0, height = 0, subsampling = 0, space = 0;
  const auto size = static_cast<unsigned long>(picture.bytes.size());
  if (tjDecompressHeader3(handle, picture.bytes.data(), size, &width, &height, &subsampling, &space) != 0) {
    return damaged(handle);
  }
  if (width != picture.width || height != picture.height) {
    return "is a JPEG of " + to_string(ImageSize{width, height}) + ", expected " +
           to_string(ImageSize{picture.width, picture.height});
  }
  if (subsampling < 0 || subsampling >= TJ_NUMSAMP || (space != TJCS_YCbCr && space != TJCS_GRAY)) {
    return "is a JPEG in colours other than YCbCr or grey";
  }
  const int planes = subsampling == TJSAMP_GRAY ? 1 : 3;
  std::array<cv::Mat1b, 3> plane;
  std::array<unsigned char*, 3> pointers{};
  std::array<int, 3> strides{};
  for (int i = 0; i < planes; ++i) {
    const auto at = static_cast<std::size_t>(i);
    plane[at].create(tjPlaneHeight(i, height, subsampling), tjPlaneWidth(i, width, subsampling));
    pointers[at] = plane[at].data;
    strides[at] = static_cast<int>(plane[at].step);
  }
  // TJFLAG_LIMITSCANS: a few bytes of a progressive JPEG could otherwise ask for minutes of work.
  if (tjDecompressToYUVPlanes(handle, picture.bytes.data(), size, pointers.data(), width, strides.data(), height,
                              TJFLAG_LIMITSCANS) != 0 &&
      !is_harmless(handle)) {
    return damaged(handle);
  }
  if (colour != nullptr && planes == 3) {
    colour->create(height, width);
    const std::array<const unsigned char*, 3> sources{pointers[0], pointers[1], pointers[2]};
    if (tjDecodeYUVPlanes(handle, const_cast<const unsigned char**>(sources.data()), strides.data(), subsampling,
                          colour->data, width, static_cast<int>(colour->step), height, TJPF_BGR, 0) != 0) {
      return damaged(handle);
    }
  }
  // Planes are padded to whole blocks of chroma; images are not.
  const bool padded = plane[0].cols != width || plane[0].rows != height;
  *grey = padded ? GreyImage(plane[0](cv::Rect(0, 0, width, height)).clone()) : GreyImage(plane[0]);
  return "";
}

}  // namespace

std::string fourcc_text(std::uint32_t code) {
  std::string text;
  for (int shift = 0; shift < 32; shift += 8) {
    const auto character = static_cast<char>(code >> shift & 0x7f);
    text += character >= ' ' && character <= '~' ? character : '?';
  }
  while (text.size() > 1 && text.back() == ' ') text.pop_back();
  return text;
}

std::uint32_t fourcc_of(PixelFormat format) {
  for (const auto& known : kFormats) {
    if (known.format == format) return known.code;
  }
  return 0;
}

std::optional<PixelFormat> pixel_format_of(std::uint32_t fourcc_code) {
  if (fourcc_code == kJpeg) return PixelFormat::mjpeg;
  for (const auto& known : kFormats) {
    if (known.code == fourcc_code) return known.format;
  }
  return std::nullopt;
}

std::string known_pixel_formats() {
  std::string text;
  for (const auto& known : kFormats) text += (text.empty() ? "" : ", ") + fourcc_text(known.code);
  return text;
}

std::string decode_picture(const RawPicture& picture, GreyImage* grey, cv::Mat3b* colour) {
  if (colour != nullptr) *colour = cv::Mat3b();
  // Smaller pictures than the program works with are decoded all the same: that limit is not about memory.
  if (picture.width <= 0 || picture.height <= 0 || picture.width > kMaxImageWidth || picture.height > kMaxImageHeight) {
    return "is " + to_string(ImageSize{picture.width, picture.height}) + ", expected at most " +
           to_string(ImageSize{kMaxImageWidth, kMaxImageHeight});
  }
  if (picture.format == PixelFormat::mjpeg) return decode_jpeg(picture, grey, colour);

  const std::size_t row = bytes_per_row(picture.format, picture.width);
  const std::size_t stride = picture.stride == 0 ? row : picture.stride;
  constexpr std::size_t kMaxStride = 1 << 20;  // bytes; far above any real one, far below an overflow
  if (stride < row || stride > kMaxStride) {
    return "has rows of " + std::to_string(stride) + " bytes, expected " + std::to_string(row) + " or a little more";
  }
  const std::size_t expected = bytes_of_rows(static_cast<std::size_t>(picture.height), stride, row);
  if (picture.bytes.size() < expected) return too_short(picture.bytes.size(), expected);
  switch (picture.format) {
    case PixelFormat::yuyv:
    case PixelFormat::uyvy:
      return decode_packed_yuv(picture, stride, grey, colour);
    case PixelFormat::nv12:
      return decode_nv12(picture, stride, grey, colour);
    case PixelFormat::bgr24:
    case PixelFormat::rgb24:
      return decode_rgb(picture, stride, grey, colour);
    default:
      *grey = view_of<uchar>(picture.bytes.data(), picture.height, picture.width, stride).clone();
      return "";
  }
}

}  // namespace parallax
