// Pixel formats against plain references: every pixel computed by itself, with odd strides; what is too short or
// damaged is refused.
#include "camera/pixel_format.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <string>
#include <vector>

namespace parallax {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes random_bytes(std::size_t size, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> level(0, 255);
  Bytes bytes(size);
  for (auto& byte : bytes) byte = static_cast<std::uint8_t>(level(random));
  return bytes;
}

int clamped(double value) { return static_cast<int>(std::lround(std::clamp(value, 0.0, 255.0))); }

// BT.601 with the video range; below 16 there is only black.
cv::Vec3b bgr_of(int y, int u, int v) {
  const double luma = 1.164383 * std::max(0, y - 16);
  return {static_cast<uchar>(clamped(luma + 2.017232 * (u - 128))),
          static_cast<uchar>(clamped(luma - 0.391762 * (u - 128) - 0.812968 * (v - 128))),
          static_cast<uchar>(clamped(luma + 1.596027 * (v - 128)))};
}

void expect_near(const cv::Vec3b& found, const cv::Vec3b& expected, int tolerance, int x, int y) {
  for (int c = 0; c < 3; ++c)
    ASSERT_NEAR(found[c], expected[c], tolerance) << "channel " << c << " at " << x << "," << y;
}

struct Case {
  int width, height;
  std::size_t padding;  // bytes at the end of a row
};
const std::vector<Case> kCases{{16, 8, 0}, {16, 8, 7}, {34, 10, 13}, {2, 2, 1}, {160, 120, 3}};

RawPicture picture_of(PixelFormat format, int width, int height, std::size_t stride, const Bytes& bytes) {
  RawPicture picture;
  picture.format = format;
  picture.width = width;
  picture.height = height;
  picture.stride = stride;
  picture.bytes = bytes;
  return picture;
}

class PackedYuv : public ::testing::TestWithParam<PixelFormat> {};

TEST_P(PackedYuv, IsWhatEveryPixelSays) {
  const bool yuyv = GetParam() == PixelFormat::yuyv;
  for (const auto& c : kCases) {
    const std::size_t stride = static_cast<std::size_t>(2 * c.width) + c.padding;
    // The last row ends with its last pixel.
    const Bytes bytes = random_bytes(stride * static_cast<std::size_t>(c.height) - c.padding, 1);
    GreyImage grey;
    cv::Mat3b colour;
    ASSERT_EQ(decode_picture(picture_of(GetParam(), c.width, c.height, stride, bytes), &grey, &colour), "");
    ASSERT_EQ(grey.size(), cv::Size(c.width, c.height));
    ASSERT_EQ(colour.size(), grey.size());
    for (int y = 0; y < c.height; ++y) {
      for (int x = 0; x < c.width; ++x) {
        const auto* pair = bytes.data() + static_cast<std::size_t>(y) * stride + static_cast<std::size_t>(x / 2 * 4);
        const int luma = pair[x % 2 * 2 + (yuyv ? 0 : 1)];
        ASSERT_EQ(grey(y, x), luma);
        expect_near(colour(y, x), bgr_of(luma, pair[yuyv ? 1 : 0], pair[yuyv ? 3 : 2]), 2, x, y);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Both, PackedYuv, ::testing::Values(PixelFormat::yuyv, PixelFormat::uyvy));

TEST(PixelFormat, Nv12IsWhatEveryPixelSays) {
  for (const bool apart : {false, true}) {
    for (const auto& c : kCases) {
      const std::size_t stride = static_cast<std::size_t>(c.width) + c.padding;
      const std::size_t luma_size = stride * static_cast<std::size_t>(c.height);
      const Bytes bytes = random_bytes(luma_size + stride * static_cast<std::size_t>(c.height / 2) - c.padding, 2);
      RawPicture picture = picture_of(PixelFormat::nv12, c.width, c.height, stride, bytes);
      const Bytes luma(bytes.begin(), bytes.begin() + static_cast<long>(luma_size));
      const Bytes chroma(bytes.begin() + static_cast<long>(luma_size), bytes.end());
      if (apart) {
        picture.bytes = luma;
        picture.chroma = chroma;
      }
      GreyImage grey;
      cv::Mat3b colour;
      ASSERT_EQ(decode_picture(picture, &grey, &colour), "");
      for (int y = 0; y < c.height; ++y) {
        for (int x = 0; x < c.width; ++x) {
          const int level = luma[static_cast<std::size_t>(y) * stride + static_cast<std::size_t>(x)];
          const auto* uv =
              chroma.data() + static_cast<std::size_t>(y / 2) * stride + static_cast<std::size_t>(x / 2 * 2);
          ASSERT_EQ(grey(y, x), level);
          expect_near(colour(y, x), bgr_of(level, uv[0], uv[1]), 2, x, y);
        }
      }
    }
  }
}

TEST(PixelFormat, RgbAndBgrAreWeighted) {
  for (const auto format : {PixelFormat::rgb24, PixelFormat::bgr24}) {
    for (const auto& c : kCases) {
      const std::size_t stride = static_cast<std::size_t>(3 * c.width) + c.padding;
      const Bytes bytes = random_bytes(stride * static_cast<std::size_t>(c.height) - c.padding, 3);
      GreyImage grey;
      cv::Mat3b colour;
      ASSERT_EQ(decode_picture(picture_of(format, c.width, c.height, stride, bytes), &grey, &colour), "");
      for (int y = 0; y < c.height; ++y) {
        for (int x = 0; x < c.width; ++x) {
          const auto* pixel = bytes.data() + static_cast<std::size_t>(y) * stride + static_cast<std::size_t>(3 * x);
          const bool rgb = format == PixelFormat::rgb24;
          const cv::Vec3b expected(pixel[rgb ? 2 : 0], pixel[1], pixel[rgb ? 0 : 2]);
          ASSERT_EQ(colour(y, x), expected);
          ASSERT_NEAR(grey(y, x), 0.299 * expected[2] + 0.587 * expected[1] + 0.114 * expected[0], 1.0);
        }
      }
    }
  }
}

TEST(PixelFormat, GreyIsCopied) {
  const Bytes bytes = random_bytes(19 * 10 - 3, 4);
  GreyImage grey;
  cv::Mat3b colour(3, 3);
  ASSERT_EQ(decode_picture(picture_of(PixelFormat::grey, 16, 10, 19, bytes), &grey, &colour), "");
  EXPECT_TRUE(colour.empty());
  for (int y = 0; y < 10; ++y) {
    for (int x = 0; x < 16; ++x) ASSERT_EQ(grey(y, x), bytes[static_cast<std::size_t>(19 * y + x)]);
  }
  // It is a copy: the driver's memory may change.
  EXPECT_TRUE(grey.data < bytes.data() || grey.data >= bytes.data() + bytes.size());
}

TEST(PixelFormat, RefusesWhatIsTooShort) {
  struct Short {
    PixelFormat format;
    std::size_t needed;
  };
  for (const auto& c : {Short{PixelFormat::yuyv, 16 * 8 * 2}, Short{PixelFormat::uyvy, 16 * 8 * 2},
                        Short{PixelFormat::nv12, 16 * 8 * 3 / 2}, Short{PixelFormat::rgb24, 16 * 8 * 3},
                        Short{PixelFormat::bgr24, 16 * 8 * 3}, Short{PixelFormat::grey, 16 * 8}}) {
    GreyImage grey;
    cv::Mat3b colour;
    const Bytes enough(c.needed), less(c.needed - 1);
    EXPECT_EQ(decode_picture(picture_of(c.format, 16, 8, 0, enough), &grey, &colour), "");
    const auto problem = decode_picture(picture_of(c.format, 16, 8, 0, less), &grey, &colour);
    EXPECT_NE(problem.find("bytes, expected " + std::to_string(c.needed)), std::string::npos) << problem;
    EXPECT_NE(decode_picture(picture_of(c.format, 16, 8, 0, {}), &grey, &colour), "");
  }
}

TEST(PixelFormat, RefusesImpossibleSizes) {
  const Bytes bytes(100000);
  GreyImage grey;
  for (const auto& [width, height] : {std::pair{0, 8}, {8, 0}, {-8, 8}, {8, -8}, {1 << 30, 1 << 30}, {1922, 2}}) {
    EXPECT_NE(decode_picture(picture_of(PixelFormat::grey, width, height, 0, bytes), &grey, nullptr), "");
    EXPECT_NE(decode_picture(picture_of(PixelFormat::mjpeg, width, height, 0, bytes), &grey, nullptr), "");
  }
  EXPECT_NE(decode_picture(picture_of(PixelFormat::yuyv, 15, 8, 0, bytes), &grey, nullptr), "");
  EXPECT_NE(decode_picture(picture_of(PixelFormat::nv12, 16, 7, 0, bytes), &grey, nullptr), "");
  EXPECT_NE(decode_picture(picture_of(PixelFormat::yuyv, 16, 8, 31, bytes), &grey, nullptr), "")
      << "stride below a row";
  EXPECT_NE(decode_picture(picture_of(PixelFormat::yuyv, 16, 8, ~std::size_t{0}, bytes), &grey, nullptr), "");
}

cv::Mat3b scene(int width, int height) {
  cv::Mat3b image(height, width);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      image(y, x) = cv::Vec3b(static_cast<uchar>(40 + x % 128), static_cast<uchar>(200 - y % 128),
                              static_cast<uchar>(60 + (x + y) % 100));
    }
  }
  return image;
}

Bytes jpeg_of(const cv::Mat& image, int quality = 95) {
  Bytes bytes;
  cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
  return bytes;
}

TEST(MotionJpeg, IsWhatAnotherDecoderMakesOfIt) {
  for (const auto& size : {cv::Size(320, 240), cv::Size(161, 123)}) {
    const Bytes jpeg = jpeg_of(scene(size.width, size.height));
    GreyImage grey, grey_alone;
    cv::Mat3b colour;
    const auto picture = picture_of(PixelFormat::mjpeg, size.width, size.height, 0, jpeg);
    ASSERT_EQ(decode_picture(picture, &grey, &colour), "");
    ASSERT_EQ(decode_picture(picture, &grey_alone, nullptr), "");
    ASSERT_EQ(grey.size(), size);
    EXPECT_EQ(cv::norm(grey, grey_alone, cv::NORM_INF), 0) << "grey depends on whether colour is wanted";
    const cv::Mat3b reference = cv::imdecode(jpeg, cv::IMREAD_COLOR);
    cv::Mat1b reference_grey;
    cv::cvtColor(reference, reference_grey, cv::COLOR_BGR2GRAY);
    EXPECT_LE(cv::norm(colour, reference, cv::NORM_L1) / (3.0 * size.area()), 1.5);
    EXPECT_LE(cv::norm(grey, reference_grey, cv::NORM_L1) / size.area(), 1.0);
  }
}

TEST(MotionJpeg, GreyOnesHaveNoColour) {
  cv::Mat1b image(48, 64);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) image(y, x) = static_cast<uchar>(2 * x + y);
  }
  GreyImage grey;
  cv::Mat3b colour;
  ASSERT_EQ(decode_picture(picture_of(PixelFormat::mjpeg, 64, 48, 0, jpeg_of(image)), &grey, &colour), "");
  EXPECT_TRUE(colour.empty());
  EXPECT_LE(cv::norm(grey, image, cv::NORM_INF), 6);
}

// Cameras leave the customary Huffman tables out (marker ff c4).
TEST(MotionJpeg, MayLackItsTables) {
  const Bytes whole = jpeg_of(scene(64, 48));
  Bytes bare;
  for (std::size_t i = 0; i < whole.size();) {
    if (whole[i] == 0xff && i + 3 < whole.size() && whole[i + 1] == 0xc4) {
      i += 2 + static_cast<std::size_t>(whole[i + 2] << 8 | whole[i + 3]);
    } else {
      bare.push_back(whole[i++]);
    }
  }
  ASSERT_LT(bare.size(), whole.size());
  GreyImage grey, expected;
  ASSERT_EQ(decode_picture(picture_of(PixelFormat::mjpeg, 64, 48, 0, whole), &expected, nullptr), "");
  ASSERT_EQ(decode_picture(picture_of(PixelFormat::mjpeg, 64, 48, 0, bare), &grey, nullptr), "");
  EXPECT_EQ(cv::norm(grey, expected, cv::NORM_INF), 0);
}

TEST(MotionJpeg, DamageIsRefusedAndStrayBytesAreNot) {
  const Bytes whole = jpeg_of(scene(320, 240));
  GreyImage grey, expected;
  ASSERT_EQ(decode_picture(picture_of(PixelFormat::mjpeg, 320, 240, 0, whole), &expected, nullptr), "");
  for (const double part : {0.0, 0.01, 0.1, 0.5, 0.95}) {
    const Bytes cut(whole.begin(), whole.begin() + static_cast<long>(part * static_cast<double>(whole.size())));
    EXPECT_NE(decode_picture(picture_of(PixelFormat::mjpeg, 320, 240, 0, cut), &grey, nullptr), "") << part;
  }
  Bytes overwritten = whole;
  for (std::size_t i = whole.size() / 2; i < whole.size() / 2 + 200; ++i) overwritten[i] = 0xff;
  EXPECT_NE(decode_picture(picture_of(PixelFormat::mjpeg, 320, 240, 0, overwritten), &grey, nullptr), "");
  EXPECT_NE(decode_picture(picture_of(PixelFormat::mjpeg, 640, 480, 0, whole), &grey, nullptr), "") << "another size";
  // Some cameras pad the data before the end mark, or the buffer after it.
  Bytes padded(whole.begin(), whole.end() - 2);
  padded.insert(padded.end(), {0, 0, 0, 0, 0xff, 0xd9, 0, 0, 0});
  EXPECT_EQ(decode_picture(picture_of(PixelFormat::mjpeg, 320, 240, 0, padded), &grey, nullptr), "");
  EXPECT_EQ(cv::norm(grey, expected, cv::NORM_INF), 0);
}

// Every byte of the headers damaged in turn: the picture after it is whole, and is decoded as if it were the first.
TEST(MotionJpeg, DamageInOnePictureDoesNotReachTheNext) {
  const Bytes whole = jpeg_of(scene(64, 48));
  const auto decode = [](const Bytes& bytes, GreyImage* grey) {
    return decode_picture(picture_of(PixelFormat::mjpeg, 64, 48, 0, bytes), grey, nullptr);
  };
  GreyImage expected;
  ASSERT_EQ(decode(whole, &expected), "");
  int refused = 0;
  for (std::size_t i = 0; i < 620; ++i) {
    for (const std::uint8_t value : {0x00, 0x01, 0xc0, 0xd8, 0xd9, 0xff}) {
      Bytes damaged = whole;
      damaged[i] = value;
      GreyImage grey;
      const std::string problem = decode(damaged, &grey);
      refused += problem.empty() ? 0 : 1;
      EXPECT_EQ(decode(damaged, &grey), problem) << i;
      ASSERT_EQ(decode(whole, &grey), "") << "after " << problem << " at byte " << i;
      EXPECT_EQ(cv::norm(grey, expected, cv::NORM_INF), 0) << i;
    }
  }
  EXPECT_GT(refused, 300);
}

// Tables are of one picture: those of an earlier one are not used for a picture that lacks its own (marker ff db).
TEST(MotionJpeg, QuantisationIsNotTakenFromThePictureBefore) {
  const Bytes whole = jpeg_of(scene(64, 48));
  Bytes bare;
  for (std::size_t i = 0; i < whole.size();) {
    if (whole[i] == 0xff && i + 3 < whole.size() && whole[i + 1] == 0xdb) {
      i += 2 + static_cast<std::size_t>(whole[i + 2] << 8 | whole[i + 3]);
    } else {
      bare.push_back(whole[i++]);
    }
  }
  ASSERT_LT(bare.size(), whole.size());
  GreyImage grey;
  ASSERT_EQ(decode_picture(picture_of(PixelFormat::mjpeg, 64, 48, 0, whole), &grey, nullptr), "");
  EXPECT_NE(decode_picture(picture_of(PixelFormat::mjpeg, 64, 48, 0, bare), &grey, nullptr), "");
}

TEST(PixelFormat, HasItsFourCharacters) {
  EXPECT_EQ(fourcc_text(fourcc('Y', 'U', 'Y', 'V')), "YUYV");
  EXPECT_EQ(fourcc_text(fourcc('Y', '8', ' ', ' ')), "Y8");
  EXPECT_EQ(fourcc_text(1), "????");
  for (const auto format : {PixelFormat::yuyv, PixelFormat::uyvy, PixelFormat::nv12, PixelFormat::bgr24,
                            PixelFormat::rgb24, PixelFormat::grey, PixelFormat::mjpeg}) {
    EXPECT_EQ(pixel_format_of(fourcc_of(format)), format);
  }
  EXPECT_EQ(pixel_format_of(fourcc('J', 'P', 'E', 'G')), PixelFormat::mjpeg);
  EXPECT_EQ(pixel_format_of(fourcc('H', '2', '6', '4')), std::nullopt);
}

}  // namespace
}  // namespace parallax
