#include "core/binary_descriptor.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

namespace parallax {
namespace {

constexpr int kTests = 256;
constexpr int kOrientationRadius = 7;
constexpr double kPatternSigma = 6.0;
constexpr int kPatternRadius = 13;

struct Test {
  std::int8_t ax, ay, bx, by;
};
using Pattern = std::array<Test, kTests>;

// Normal deviate from two uniform ones: the same on every platform.
double gaussian(std::mt19937* rng) {
  const double u = ((*rng)() + 1.0) / 4294967297.0, v = (*rng)() / 4294967296.0;
  return std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * M_PI * v);
}

std::array<Pattern, kDescriptorOrientations> make_patterns() {
  std::mt19937 rng(20070813);
  std::array<std::array<double, 4>, kTests> base;
  const auto inside = [&] {
    for (;;) {
      const double x = kPatternSigma * gaussian(&rng), y = kPatternSigma * gaussian(&rng);
      if (x * x + y * y <= kPatternRadius * kPatternRadius) return std::array<double, 2>{x, y};
    }
  };
  for (auto& t : base) {
    const auto a = inside(), b = inside();
    t = {a[0], a[1], b[0], b[1]};
  }
  std::array<Pattern, kDescriptorOrientations> out;
  for (int o = 0; o < kDescriptorOrientations; ++o) {
    const double angle = 2.0 * M_PI * o / kDescriptorOrientations, c = std::cos(angle), s = std::sin(angle);
    for (int i = 0; i < kTests; ++i) {
      const auto& t = base[i];
      const auto turn = [&](double x, double y, std::int8_t* tx, std::int8_t* ty) {
        *tx = static_cast<std::int8_t>(std::lround(c * x - s * y));
        *ty = static_cast<std::int8_t>(std::lround(s * x + c * y));
      };
      turn(t[0], t[1], &out[o][i].ax, &out[o][i].ay);
      turn(t[2], t[3], &out[o][i].bx, &out[o][i].by);
    }
  }
  return out;
}

int orientation_index(const GreyImage& image, int x, int y) {
  int mx = 0, my = 0;
  for (int dy = -kOrientationRadius; dy <= kOrientationRadius; ++dy) {
    const std::uint8_t* row = image.ptr<std::uint8_t>(y + dy) + x;
    const int half =
        static_cast<int>(std::sqrt(static_cast<double>(kOrientationRadius * kOrientationRadius - dy * dy)));
    int sum = 0;
    for (int dx = -half; dx <= half; ++dx) {
      mx += dx * row[dx];
      sum += row[dx];
    }
    my += dy * sum;
  }
  const double turn = std::atan2(static_cast<double>(my), static_cast<double>(mx)) / (2.0 * M_PI);
  return (static_cast<int>(std::lround(turn * kDescriptorOrientations)) + kDescriptorOrientations) %
         kDescriptorOrientations;
}

}  // namespace

GreyImage smooth_for_descriptors(const GreyImage& image) {
  GreyImage out;
  cv::blur(image, out, cv::Size(5, 5), cv::Point(-1, -1), cv::BORDER_REPLICATE);
  return out;
}

bool describe_corner(const GreyImage& image, const GreyImage& smooth, int x, int y, BinaryDescriptor* out,
                     std::uint8_t* orientation) {
  if (x < kDescriptorBorder || y < kDescriptorBorder || x >= image.cols - kDescriptorBorder ||
      y >= image.rows - kDescriptorBorder)
    return false;
  static const std::array<Pattern, kDescriptorOrientations> patterns = make_patterns();
  const int turned = orientation_index(image, x, y);
  if (orientation) *orientation = static_cast<std::uint8_t>(turned);
  const Pattern& pattern = patterns[static_cast<std::size_t>(turned)];
  const auto step = static_cast<std::ptrdiff_t>(smooth.step[0]);
  const std::uint8_t* centre = smooth.ptr<std::uint8_t>(y) + x;
  for (int word = 0; word < 4; ++word) {
    std::uint64_t bits = 0;
    for (int i = 0; i < 64; ++i) {
      const Test& t = pattern[static_cast<std::size_t>(64 * word + i)];
      bits |= static_cast<std::uint64_t>(centre[t.ay * step + t.ax] < centre[t.by * step + t.bx]) << i;
    }
    out->bits[static_cast<std::size_t>(word)] = bits;
  }
  return true;
}

}  // namespace parallax
