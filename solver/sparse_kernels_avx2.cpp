// Sparse elimination's kernels for AVX2.
#include <cmath>
#include <cstdint>

#include "core/cpu_dispatch.h"
#include "solver/sparse_kernels.h"

#if PARALLAX_X86
// clang-format off
#include "solver/begin_avx2.inl"
namespace parallax::solver::sparse_avx2 {
#include "solver/simd_lanes.inl"
#include "solver/sparse_kernels.inl"
}  // namespace parallax::solver::sparse_avx2
#include "solver/end_simd.inl"
// clang-format on
#endif  // PARALLAX_X86
