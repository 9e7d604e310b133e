// Images for the kernel tests: buffers that end exactly at the last pixel (so that AddressSanitizer sees any read
// beyond it), with or without space between rows, and a smooth texture whose value is known at every real position.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <random>
#include <vector>

#include "core/cpu_dispatch.h"
#include "core/image.h"

namespace parallax {

class ExactImage {
 public:
  ExactImage(int width, int height, int gap = 0)
      : bytes_(new std::uint8_t[size(width, height, gap)]()),
        image(height, width, bytes_.get(), static_cast<std::size_t>(width + gap)) {}

  void fill(const std::function<double(int x, int y)>& value) {
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        image(y, x) = static_cast<std::uint8_t>(std::clamp(std::lround(value(x, y)), 0L, 255L));
      }
    }
  }

 private:
  static std::size_t size(int width, int height, int gap) {
    return static_cast<std::size_t>((width + gap) * (height - 1) + width);
  }
  std::unique_ptr<std::uint8_t[]> bytes_;

 public:
  GreyImage image;
};

// Kinds of content: uniform noise; black and white blotches; soft blotches with noise; flat with dots.
inline constexpr int kImageKinds = 4;
inline void fill_random(ExactImage* out, int kind, std::mt19937* random) {
  std::uniform_int_distribution<int> byte(0, 255);
  const int block = 3 + kind;
  std::vector<int> blotch(static_cast<std::size_t>((out->image.cols / block + 1) * (out->image.rows / block + 1)));
  for (int& b : blotch) b = byte(*random);
  out->fill([&](int x, int y) -> double {
    const int b = blotch[static_cast<std::size_t>(y / block * (out->image.cols / block + 1) + x / block)];
    switch (kind) {
      case 0:
        return byte(*random);
      case 1:
        return b < 128 ? 0 : 255;
      case 2:
        return b + byte(*random) / 16 - 8;
      default:
        return b < 40 && x % block < 2 && y % block < 2 ? 100 + b : 100;
    }
  });
}

// Runs `body` at every instruction set this machine has, and puts the choice back.
inline void for_each_simd_level(const std::function<void()>& body) {
  const SimdLevel before = simd_level();
  for (int l = 0; l <= static_cast<int>(supported_simd_level()); ++l) {
    const SimdLevel level = set_simd_level(static_cast<SimdLevel>(l));
    SCOPED_TRACE(simd_level_name(level));
    body();
  }
  set_simd_level(before);
}

// A sum of plane waves of at least `shortest` pixels wavelength: band-limited, and exact at real positions.
class WaveTexture {
 public:
  WaveTexture(std::mt19937* random, double shortest, double longest = 40.0, int waves = 24, double contrast = 30.0) {
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    for (int k = 0; k < waves; ++k) {
      const double length = shortest * std::pow(longest / shortest, unit(*random)), angle = 2 * M_PI * unit(*random);
      waves_.push_back(
          {2 * M_PI / length * std::cos(angle), 2 * M_PI / length * std::sin(angle), 2 * M_PI * unit(*random)});
    }
    amplitude_ = contrast * std::sqrt(2.0 / waves);
  }
  double operator()(double x, double y) const {
    double sum = 128;
    for (const Wave& w : waves_) sum += amplitude_ * std::sin(w.x * x + w.y * y + w.phase);
    return sum;
  }

 private:
  struct Wave {
    double x, y, phase;
  };
  std::vector<Wave> waves_;
  double amplitude_ = 0;
};

}  // namespace parallax
