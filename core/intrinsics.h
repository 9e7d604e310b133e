// x86 intrinsics, without the false "used uninitialized" warnings that GCC 12 gives for its own AVX-512 header.
#pragma once

#include "core/cpu_dispatch.h"

#if PARALLAX_X86
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wuninitialized"
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif
#include <immintrin.h>
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic pop
#endif
#endif
