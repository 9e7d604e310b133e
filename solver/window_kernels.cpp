// The window's kernels for any processor, and the choice among them.
#include "solver/window_kernels.h"

#include <cmath>
#include <cstdint>

#include "core/cpu_dispatch.h"

#define PARALLAX_LANES 2

namespace parallax::solver {

namespace window_baseline {
// clang-format off
#include "solver/simd_lanes.inl"
#include "solver/window_kernels.inl"
// clang-format on
}  // namespace window_baseline

#if PARALLAX_X86
namespace window_avx2 {
extern const WindowKernels kernels;
}
#endif

const WindowKernels& window_kernels() {
#if PARALLAX_X86
  if (simd_level() >= SimdLevel::kAvx2) return window_avx2::kernels;
#endif
  return window_baseline::kernels;
}

}  // namespace parallax::solver
