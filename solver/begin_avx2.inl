// What follows is compiled for AVX2 (FMA comes with every processor that has it), up to solver/end_simd.inl. Only where
// PARALLAX_X86, and outside of any namespace.
#include <immintrin.h>

#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2,fma"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2,fma")
#endif

#define PARALLAX_LANES 4
