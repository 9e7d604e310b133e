// FAST-10 over one image row, one function an instruction set. Internal to core/fast.cpp.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/fast.h"

namespace parallax::detail {

// How many corners beyond a row's width a FastRow may write as scratch.
inline constexpr std::size_t kFastRowSlack = 64;

// The radius-3 circle, clockwise from the top.
struct CircleOffset {
  int x, y;
};
inline constexpr CircleOffset kFastCircle[16] = {{0, -3}, {1, -3},  {2, -2},  {3, -1}, {3, 0},  {3, 1},
                                                 {2, 2},  {1, 3},   {0, 3},   {-1, 3}, {-2, 2}, {-3, 1},
                                                 {-3, 0}, {-3, -1}, {-2, -2}, {-1, -3}};

// Writes the corners of row y (3 <= y < height - 3, width >= 7) in column order at `out` and returns the end. `row` is
// the row's first pixel, `stride` the bytes from row to row, 0 <= threshold <= 255.
using FastRow = Corner* (*)(const std::uint8_t* row, std::size_t stride, int width, int y, int threshold, Corner* out);

Corner* fast_row_scalar(const std::uint8_t* row, std::size_t stride, int width, int y, int threshold, Corner* out);

// The row function of the SIMD level in use.
FastRow fast_row();

}  // namespace parallax::detail
