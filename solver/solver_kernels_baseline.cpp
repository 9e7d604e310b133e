// The solver's kernels for any processor.
#include <cmath>
#include <cstdint>

#include "core/cpu_dispatch.h"
#include "solver/solver_kernels.h"

#define PARALLAX_LANES 2

namespace parallax::solver::baseline {
#include "solver/all_kernels.inl"
}  // namespace parallax::solver::baseline
