// Vectors of doubles for the instruction set this is compiled for. Included inside the namespace of that set, after
// PARALLAX_LANES (1: no vectors beyond the compiler's baseline pairs, 4: AVX2, 8: AVX-512) is defined.

#if PARALLAX_LANES == 8
inline constexpr int kLanes = 8;
#elif PARALLAX_LANES == 4
inline constexpr int kLanes = 4;
#else
inline constexpr int kLanes = 2;
#endif

#define PARALLAX_INLINE inline __attribute__((always_inline))

typedef double Vec __attribute__((vector_size(8 * kLanes), may_alias));
typedef double VecUnaligned __attribute__((vector_size(8 * kLanes), aligned(8), may_alias));
typedef long long Mask __attribute__((vector_size(8 * kLanes), may_alias));

PARALLAX_INLINE Vec load(const double* p) { return *reinterpret_cast<const VecUnaligned*>(p); }
PARALLAX_INLINE void store(double* p, Vec v) { *reinterpret_cast<VecUnaligned*>(p) = v; }
PARALLAX_INLINE Vec splat(double x) { return x - Vec{}; }
PARALLAX_INLINE Vec select(Mask m, Vec a, Vec b) { return m ? a : b; }
PARALLAX_INLINE Vec maximum(Vec a, Vec b) { return a > b ? a : b; }
PARALLAX_INLINE Vec minimum(Vec a, Vec b) { return a < b ? a : b; }

#if PARALLAX_LANES == 8
PARALLAX_INLINE Vec square_root(Vec v) { return Vec(_mm512_sqrt_pd(__m512d(v))); }
PARALLAX_INLINE Vec fma(Vec a, Vec b, Vec c) { return Vec(_mm512_fmadd_pd(__m512d(a), __m512d(b), __m512d(c))); }
PARALLAX_INLINE Vec fnma(Vec a, Vec b, Vec c) { return Vec(_mm512_fnmadd_pd(__m512d(a), __m512d(b), __m512d(c))); }
PARALLAX_INLINE Vec gather(const double* base, const std::int32_t* index) {
  return Vec(_mm512_i32gather_pd(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(index)), base, 8));
}
#elif PARALLAX_LANES == 4
PARALLAX_INLINE Vec square_root(Vec v) { return Vec(_mm256_sqrt_pd(__m256d(v))); }
PARALLAX_INLINE Vec fma(Vec a, Vec b, Vec c) { return Vec(_mm256_fmadd_pd(__m256d(a), __m256d(b), __m256d(c))); }
PARALLAX_INLINE Vec fnma(Vec a, Vec b, Vec c) { return Vec(_mm256_fnmadd_pd(__m256d(a), __m256d(b), __m256d(c))); }
PARALLAX_INLINE Vec gather(const double* base, const std::int32_t* index) {
  return Vec{base[index[0]], base[index[1]], base[index[2]], base[index[3]]};
}
#else
PARALLAX_INLINE Vec square_root(Vec v) { return Vec{std::sqrt(v[0]), std::sqrt(v[1])}; }
PARALLAX_INLINE Vec fma(Vec a, Vec b, Vec c) { return a * b + c; }
PARALLAX_INLINE Vec fnma(Vec a, Vec b, Vec c) { return c - a * b; }
PARALLAX_INLINE Vec gather(const double* base, const std::int32_t* index) {
  return Vec{base[index[0]], base[index[1]]};
}
#endif

// Rows of a camera block: 6 = 4 + 2, 9 = 4 + 4 + 1.
typedef double Vec4 __attribute__((vector_size(32), may_alias));
typedef double Vec4Unaligned __attribute__((vector_size(32), aligned(8), may_alias));
typedef double Vec2 __attribute__((vector_size(16), may_alias));
typedef double Vec2Unaligned __attribute__((vector_size(16), aligned(8), may_alias));

#if PARALLAX_LANES >= 4
PARALLAX_INLINE void add_product(Vec4& s, double a, const Vec4& b) {
  s = Vec4(_mm256_fmadd_pd(_mm256_set1_pd(a), __m256d(b), __m256d(s)));
}
PARALLAX_INLINE void add_product(Vec2& s, double a, const Vec2& b) {
  s = Vec2(_mm_fmadd_pd(_mm_set1_pd(a), __m128d(b), __m128d(s)));
}
PARALLAX_INLINE void subtract_product(Vec4& s, double a, const Vec4& b) {
  s = Vec4(_mm256_fnmadd_pd(_mm256_set1_pd(a), __m256d(b), __m256d(s)));
}
PARALLAX_INLINE void subtract_product(Vec2& s, double a, const Vec2& b) {
  s = Vec2(_mm_fnmadd_pd(_mm_set1_pd(a), __m128d(b), __m128d(s)));
}
#else
PARALLAX_INLINE void add_product(Vec4& s, double a, const Vec4& b) { s += a * b; }
PARALLAX_INLINE void add_product(Vec2& s, double a, const Vec2& b) { s += a * b; }
PARALLAX_INLINE void subtract_product(Vec4& s, double a, const Vec4& b) { s -= a * b; }
PARALLAX_INLINE void subtract_product(Vec2& s, double a, const Vec2& b) { s -= a * b; }
#endif

template <int D>
struct Row;

template <>
struct Row<6> {
  Vec4 a;
  Vec2 b;
  PARALLAX_INLINE static Row load(const double* p) {
    return {*reinterpret_cast<const Vec4Unaligned*>(p), *reinterpret_cast<const Vec2Unaligned*>(p + 4)};
  }
  PARALLAX_INLINE static Row zero() { return {Vec4{}, Vec2{}}; }
  PARALLAX_INLINE void store(double* p) const {
    *reinterpret_cast<Vec4Unaligned*>(p) = a;
    *reinterpret_cast<Vec2Unaligned*>(p + 4) = b;
  }
  PARALLAX_INLINE void add(double s, const Row& r) {
    add_product(a, s, r.a);
    add_product(b, s, r.b);
  }
  PARALLAX_INLINE void subtract(double s, const Row& r) {
    subtract_product(a, s, r.a);
    subtract_product(b, s, r.b);
  }
  PARALLAX_INLINE void add_square(const Row& r) {
    a += r.a * r.a;
    b += r.b * r.b;
  }
};

template <>
struct Row<9> {
  Vec4 a, b;
  double c;
  PARALLAX_INLINE static Row load(const double* p) {
    return {*reinterpret_cast<const Vec4Unaligned*>(p), *reinterpret_cast<const Vec4Unaligned*>(p + 4), p[8]};
  }
  PARALLAX_INLINE static Row zero() { return {Vec4{}, Vec4{}, 0.0}; }
  PARALLAX_INLINE void store(double* p) const {
    *reinterpret_cast<Vec4Unaligned*>(p) = a;
    *reinterpret_cast<Vec4Unaligned*>(p + 4) = b;
    p[8] = c;
  }
  PARALLAX_INLINE void add(double s, const Row& r) {
    add_product(a, s, r.a);
    add_product(b, s, r.b);
    c += s * r.c;
  }
  PARALLAX_INLINE void subtract(double s, const Row& r) {
    subtract_product(a, s, r.a);
    subtract_product(b, s, r.b);
    c -= s * r.c;
  }
  PARALLAX_INLINE void add_square(const Row& r) {
    a += r.a * r.a;
    b += r.b * r.b;
    c += r.c * r.c;
  }
};
