// Sparse elimination's kernels for AVX512.
#include <cmath>
#include <cstdint>

#include "core/cpu_dispatch.h"
#include "solver/sparse_kernels.h"

#if PARALLAX_X86
#include <immintrin.h>

#if !defined(__clang__)
// GCC 12 warns of the undefined pass-through operands in its own intrinsics.
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC diagnostic ignored "-Wuninitialized"
#endif

#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2,fma,avx512f,avx512dq,avx512vl"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2,fma,avx512f,avx512dq,avx512vl")
#endif

#define PARALLAX_LANES 8

namespace parallax::solver::sparse_avx512 {
// clang-format off
#include "solver/simd_lanes.inl"
#include "solver/sparse_kernels.inl"
// clang-format on
}  // namespace parallax::solver::sparse_avx512

#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif
#endif  // PARALLAX_X86
