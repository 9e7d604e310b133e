// Bilinear sampling of an affine grid around a centre, in 16.16 fixed-point coordinates: all instruction sets visit
// exactly the same places and give the same bits. Internal to core/patch_warp.cpp.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "core/image.h"

namespace parallax::detail {

// Grid sample (i, j), i and j from `first` to `last`, lies at (x + i * xi + j * xj, y + i * yi + j * yj) / 65536.
struct AffineGrid {
  std::int32_t x = 0, y = 0;
  std::int32_t xi = 0, xj = 0, yi = 0, yj = 0;
  bool inside = false;    // every sample lies in [0, width - 1] x [0, height - 1]
  bool interior = false;  // ... and has four neighbours, and 4 bytes may be read at each sample and the one below
};

AffineGrid make_grid(const GreyImage& source, const Eigen::Vector2d& centre,
                     const Eigen::Matrix2d& source_from_template, int first, int last);

// One sample of a grid that is inside.
inline float sample_grid(const GreyImage& source, const AffineGrid& g, int i, int j) {
  const std::int32_t u = g.x + i * g.xi + j * g.xj, v = g.y + i * g.yi + j * g.yj;
  const int x = u >> 16, y = v >> 16;
  const int x1 = x + 1 < source.cols ? x + 1 : x, y1 = y + 1 < source.rows ? y + 1 : y;
  const float fx = static_cast<float>(u & 0xffff) * (1.0f / 65536.0f);
  const float fy = static_cast<float>(v & 0xffff) * (1.0f / 65536.0f);
  const std::uint8_t *top = source.ptr(y), *bottom = source.ptr(y1);
  const float a = top[x], b = top[x1], c = bottom[x], d = bottom[x1];
  const float h0 = a + fx * (b - a), h1 = c + fx * (d - c);
  return h0 + fy * (h1 - h0);
}

}  // namespace parallax::detail
