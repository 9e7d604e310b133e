#include "core/cpu_dispatch.h"

#include <algorithm>
#include <cstdlib>
#include <string_view>

namespace parallax {
namespace detail {

constinit std::atomic<int> simd_level_in_use{-1};

SimdLevel find_simd_level() {
  SimdLevel level = supported_simd_level();
  if (const char* wanted = std::getenv("PARALLAX_SIMD")) {
    for (SimdLevel candidate : {SimdLevel::kScalar, SimdLevel::kSse2, SimdLevel::kAvx2, SimdLevel::kAvx512}) {
      if (std::string_view(wanted) == simd_level_name(candidate)) level = std::min(level, candidate);
    }
  }
  simd_level_in_use.store(static_cast<int>(level), std::memory_order_relaxed);
  return level;
}

}  // namespace detail

SimdLevel supported_simd_level() {
#if PARALLAX_X86
  static const SimdLevel level = [] {
    __builtin_cpu_init();
    const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi") &&
                      __builtin_cpu_supports("bmi2") && __builtin_cpu_supports("popcnt");
    const bool avx512 = avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                        __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq");
    return avx512 ? SimdLevel::kAvx512 : avx2 ? SimdLevel::kAvx2 : SimdLevel::kSse2;
  }();
  return level;
#else
  return SimdLevel::kScalar;
#endif
}

SimdLevel set_simd_level(SimdLevel level) {
  level = std::clamp(level, SimdLevel::kScalar, supported_simd_level());
  detail::simd_level_in_use.store(static_cast<int>(level), std::memory_order_relaxed);
  return level;
}

const char* simd_level_name(SimdLevel level) {
  switch (level) {
    case SimdLevel::kScalar:
      return "scalar";
    case SimdLevel::kSse2:
      return "sse2";
    case SimdLevel::kAvx2:
      return "avx2";
    case SimdLevel::kAvx512:
      return "avx512";
  }
  return "unknown";
}

}  // namespace parallax
