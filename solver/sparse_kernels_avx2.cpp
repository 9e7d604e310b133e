// Sparse elimination's kernels for AVX2.
#include <cmath>
#include <cstdint>

#include "core/cpu_dispatch.h"
#include "solver/sparse_kernels.h"

#if PARALLAX_X86
#include <immintrin.h>

#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2,fma"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2,fma")
#endif

#define PARALLAX_LANES 4

namespace parallax::solver::sparse_avx2 {
// clang-format off
#include "solver/simd_lanes.inl"
#include "solver/sparse_kernels.inl"
// clang-format on
}  // namespace parallax::solver::sparse_avx2

#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif
#endif  // PARALLAX_X86
