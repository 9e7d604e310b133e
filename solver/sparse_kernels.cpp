// The kernels for any processor, and the choice among them.
#include "solver/sparse_kernels.h"

#include <cmath>
#include <cstdint>

#include "core/cpu_dispatch.h"

#define PARALLAX_LANES 2

namespace parallax::solver {

namespace sparse_baseline {
// clang-format off
#include "solver/simd_lanes.inl"
#include "solver/sparse_kernels.inl"
// clang-format on
}  // namespace sparse_baseline

#if PARALLAX_X86
namespace sparse_avx2 {
extern const SparseKernels kernels;
}
namespace sparse_avx512 {
extern const SparseKernels kernels;
}
#endif

const SparseKernels& sparse_kernels() {
#if PARALLAX_X86
  if (simd_level() >= SimdLevel::kAvx512) return sparse_avx512::kernels;
  if (simd_level() >= SimdLevel::kAvx2) return sparse_avx2::kernels;
#endif
  return sparse_baseline::kernels;
}

}  // namespace parallax::solver
