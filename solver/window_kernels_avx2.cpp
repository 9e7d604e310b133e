// The window's kernels for AVX2; rows of eight gain nothing from more.
#include <cmath>
#include <cstdint>

#include "core/cpu_dispatch.h"
#include "solver/window_kernels.h"

#if PARALLAX_X86
// clang-format off
#include "solver/begin_avx2.inl"
namespace parallax::solver::window_avx2 {
#include "solver/simd_lanes.inl"
#include "solver/window_kernels.inl"
}  // namespace parallax::solver::window_avx2
#include "solver/end_simd.inl"
// clang-format on
#endif  // PARALLAX_X86
