// Run-time choice of instruction set for the image kernels.
//
// The level is found once from the processor, lowered by the environment variable PARALLAX_SIMD (scalar, sse2, avx2 or
// avx512) when it is set. Kernels give the same results at every level, so the choice changes speed only.
// Safe from any thread; set_simd_level() is meant for tests and benchmarks.
#pragma once

#include <atomic>

#if defined(__x86_64__) && defined(__GNUC__)
#define PARALLAX_X86 1
#define PARALLAX_TARGET_AVX2 __attribute__((target("avx2,bmi,bmi2,popcnt")))
#define PARALLAX_TARGET_AVX512 __attribute__((target("avx2,bmi,bmi2,popcnt,avx512f,avx512bw,avx512vl,avx512dq")))
#else
#define PARALLAX_X86 0
#endif

namespace parallax {

enum class SimdLevel : int { kScalar = 0, kSse2 = 1, kAvx2 = 2, kAvx512 = 3 };

// The highest level this processor runs.
SimdLevel supported_simd_level();

// Uses `level`, or the highest supported one below it; returns what is now used.
SimdLevel set_simd_level(SimdLevel level);

// "scalar", "sse2", "avx2", "avx512".
const char* simd_level_name(SimdLevel level);

namespace detail {
extern std::atomic<int> simd_level_in_use;  // -1: not yet found
SimdLevel find_simd_level();
}  // namespace detail

inline SimdLevel simd_level() {
  const int level = detail::simd_level_in_use.load(std::memory_order_relaxed);
  return level >= 0 ? static_cast<SimdLevel>(level) : detail::find_simd_level();
}

}  // namespace parallax
