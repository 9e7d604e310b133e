// The window's kernels for AVX2 (FMA comes with every processor that has it); rows of eight gain nothing from more.
#include <cmath>
#include <cstdint>

#include "core/cpu_dispatch.h"
#include "solver/window_kernels.h"

#if PARALLAX_X86
#include <immintrin.h>

#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2,fma"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2,fma")
#endif

#define PARALLAX_LANES 4

namespace parallax::solver::window_avx2 {
// clang-format off
#include "solver/simd_lanes.inl"
#include "solver/window_kernels.inl"
// clang-format on
}  // namespace parallax::solver::window_avx2

#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif
#endif  // PARALLAX_X86
