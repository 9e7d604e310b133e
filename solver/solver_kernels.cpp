#include "solver/solver_kernels.h"

#include "core/cpu_dispatch.h"

namespace parallax::solver {

namespace baseline {
extern const SolverKernels kernels[kLensCount];
}
#if PARALLAX_X86
namespace avx2 {
extern const SolverKernels kernels[kLensCount];
}
namespace avx512 {
extern const SolverKernels kernels[kLensCount];
}
#endif

const SolverKernels& solver_kernels(Lens lens) {
  const int i = static_cast<int>(lens);
#if PARALLAX_X86
  // FMA comes with every processor that has AVX2.
  if (simd_level() == SimdLevel::kAvx512) return avx512::kernels[i];
  if (simd_level() == SimdLevel::kAvx2) return avx2::kernels[i];
#endif
  return baseline::kernels[i];
}

}  // namespace parallax::solver
