// Affine-warped templates (PTAM §5.3, Eq. 7).
#include <algorithm>
#include <cmath>

#include "core/cpu_dispatch.h"
#include "core/intrinsics.h"
#include "core/patch.h"
#include "core/patch_normal.h"
#include "core/patch_sample.h"

namespace parallax {
namespace detail {

AffineGrid make_grid(const GreyImage& source, const Eigen::Vector2d& centre, const Eigen::Matrix2d& m, int first,
                     int last) {
  AffineGrid g;
  constexpr double kOne = 65536.0, kMaxPixels = 32767.0, kMaxScale = 1024.0;
  const double largest = std::max({std::abs(m(0, 0)), std::abs(m(0, 1)), std::abs(m(1, 0)), std::abs(m(1, 1))});
  // Written so that NaN fails too.
  if (!(centre.x() >= 0 && centre.x() < kMaxPixels && centre.y() >= 0 && centre.y() < kMaxPixels)) return g;
  if (!(largest <= kMaxScale && m.sum() == m.sum())) return g;
  if (source.cols < 2 || source.rows < 2 || source.cols > kMaxPixels || source.rows > kMaxPixels) return g;
  const auto fixed = [](double v) { return static_cast<std::int32_t>(std::lrint(v * kOne)); };
  g.x = fixed(centre.x());
  g.y = fixed(centre.y());
  g.xi = fixed(m(0, 0));
  g.xj = fixed(m(0, 1));
  g.yi = fixed(m(1, 0));
  g.yj = fixed(m(1, 1));
  const auto range = [&](std::int64_t at, std::int64_t di, std::int64_t dj, std::int64_t* low, std::int64_t* high) {
    *low = at + std::min(first * di, last * di) + std::min(first * dj, last * dj);
    *high = at + std::max(first * di, last * di) + std::max(first * dj, last * dj);
  };
  std::int64_t x_low, x_high, y_low, y_high;
  range(g.x, g.xi, g.xj, &x_low, &x_high);
  range(g.y, g.yi, g.yj, &y_low, &y_high);
  const std::int64_t x_end = static_cast<std::int64_t>(source.cols - 1) << 16,
                     y_end = static_cast<std::int64_t>(source.rows - 1) << 16;
  g.inside = x_low >= 0 && y_low >= 0 && x_high <= x_end && y_high <= y_end;
  // Reading 4 bytes may run past a row's end only where another row follows.
  g.interior = g.inside && x_high < x_end && y_high < y_end &&
               ((x_high >> 16) + 3 < source.cols || (y_high >> 16) + 2 < source.rows);
  return g;
}

}  // namespace detail

namespace {

using detail::AffineGrid;

constexpr int kWideSize = kPatchSize + 2;  // with a rim of one sample for central differences

constexpr int kWidePixels = kWideSize * kWideSize;
constexpr int kVectorSlack = 16;  // floats that vector code may write behind the samples

inline std::uint8_t to_grey(float v) { return static_cast<std::uint8_t>(static_cast<int>(v + 0.5f)); }

void finish_alignment(const float* wide, AlignmentTemplate* out) {
  for (int j = 0; j < kPatchSize; ++j) {
    for (int i = 0; i < kPatchSize; ++i) {
      const float* p = wide + (j + 1) * kWideSize + i + 1;
      const auto k = static_cast<std::size_t>(j * kPatchSize + i);
      out->intensity[k] = p[0];
      out->dx[k] = 0.5f * (p[1] - p[-1]);
      out->dy[k] = 0.5f * (p[kWideSize] - p[-kWideSize]);
    }
  }
  detail::finish_normal_matrix(out);
}

// Samples the size x size grid whose first sample is (first, first), row by row.
void sample_all_scalar(const GreyImage& source, const AffineGrid& g, int first, int size, float* out) {
  for (int j = 0; j < size; ++j) {
    for (int i = 0; i < size; ++i) *out++ = detail::sample_grid(source, g, first + i, first + j);
  }
}

#if PARALLAX_X86

// For interior grids without rotation or scale: one pair of fractions for all samples.
bool is_shift(const AffineGrid& g) { return g.xi == 65536 && g.yj == 65536 && g.xj == 0 && g.yi == 0; }

// Grid coordinates of the samples in the order of the output, padded for whole vectors.
template <int kSize>
struct GridIndex {
  static constexpr int kCount = (kSize * kSize + 15) / 16 * 16;
  alignas(64) std::int32_t i[kCount] = {};
  alignas(64) std::int32_t j[kCount] = {};
  constexpr GridIndex() {
    for (int k = 0; k < kCount; ++k) {
      const int clipped = k < kSize * kSize ? k : kSize * kSize - 1;
      i[k] = clipped % kSize - kSize / 2;
      j[k] = clipped / kSize - kSize / 2;
    }
  }
};
template <int kSize>
inline constexpr GridIndex<kSize> kGridIndex{};

// Interior grids only.
template <int kSize>
PARALLAX_TARGET_AVX2 void sample_all_avx2(const GreyImage& source, const AffineGrid& g, float* out) {
  const __m256i x = _mm256_set1_epi32(g.x), y = _mm256_set1_epi32(g.y);
  const __m256i xi = _mm256_set1_epi32(g.xi), xj = _mm256_set1_epi32(g.xj);
  const __m256i yi = _mm256_set1_epi32(g.yi), yj = _mm256_set1_epi32(g.yj);
  const __m256i stride = _mm256_set1_epi32(static_cast<int>(source.step[0]));
  const __m256i low16 = _mm256_set1_epi32(0xffff), low8 = _mm256_set1_epi32(0xff);
  const __m256 scale = _mm256_set1_ps(1.0f / 65536.0f);
  const auto* top = reinterpret_cast<const int*>(source.data);
  const auto* bottom = reinterpret_cast<const int*>(source.data + source.step[0]);
  for (int k = 0; k < kSize * kSize; k += 8) {
    const __m256i i = _mm256_load_si256(reinterpret_cast<const __m256i*>(kGridIndex<kSize>.i + k));
    const __m256i j = _mm256_load_si256(reinterpret_cast<const __m256i*>(kGridIndex<kSize>.j + k));
    const __m256i u = _mm256_add_epi32(x, _mm256_add_epi32(_mm256_mullo_epi32(i, xi), _mm256_mullo_epi32(j, xj)));
    const __m256i v = _mm256_add_epi32(y, _mm256_add_epi32(_mm256_mullo_epi32(i, yi), _mm256_mullo_epi32(j, yj)));
    const __m256i at = _mm256_add_epi32(_mm256_mullo_epi32(_mm256_srai_epi32(v, 16), stride), _mm256_srai_epi32(u, 16));
    const __m256i ab = _mm256_i32gather_epi32(top, at, 1), cd = _mm256_i32gather_epi32(bottom, at, 1);
    const __m256 fx = _mm256_mul_ps(_mm256_cvtepi32_ps(_mm256_and_si256(u, low16)), scale);
    const __m256 fy = _mm256_mul_ps(_mm256_cvtepi32_ps(_mm256_and_si256(v, low16)), scale);
    const __m256 a = _mm256_cvtepi32_ps(_mm256_and_si256(ab, low8));
    const __m256 b = _mm256_cvtepi32_ps(_mm256_and_si256(_mm256_srli_epi32(ab, 8), low8));
    const __m256 c = _mm256_cvtepi32_ps(_mm256_and_si256(cd, low8));
    const __m256 d = _mm256_cvtepi32_ps(_mm256_and_si256(_mm256_srli_epi32(cd, 8), low8));
    const __m256 h0 = _mm256_add_ps(a, _mm256_mul_ps(fx, _mm256_sub_ps(b, a)));
    const __m256 h1 = _mm256_add_ps(c, _mm256_mul_ps(fx, _mm256_sub_ps(d, c)));
    _mm256_storeu_ps(out + k, _mm256_add_ps(h0, _mm256_mul_ps(fy, _mm256_sub_ps(h1, h0))));
  }
}

// Eight neighbouring pixels, each interpolated with its right neighbour.
PARALLAX_TARGET_AVX2 inline __m256 interpolate_row(const std::uint8_t* p, __m256 fx) {
  const auto load = [](const std::uint8_t* q) { return _mm_loadl_epi64(reinterpret_cast<const __m128i*>(q)); };
  const __m256 a = _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(load(p)));
  const __m256 b = _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(load(p + 1)));
  return _mm256_add_ps(a, _mm256_mul_ps(fx, _mm256_sub_ps(b, a)));
}

// Interior shifts only. Rows of 8, or of 10 as two vectors that overlap.
template <int kSize>
PARALLAX_TARGET_AVX2 void sample_shift_avx2(const GreyImage& source, const AffineGrid& g, float* out) {
  const int left = (g.x >> 16) - kSize / 2, top = (g.y >> 16) - kSize / 2;
  const __m256 fx = _mm256_set1_ps(static_cast<float>(g.x & 0xffff) * (1.0f / 65536.0f));
  const __m256 fy = _mm256_set1_ps(static_cast<float>(g.y & 0xffff) * (1.0f / 65536.0f));
  for (int from = 0; from <= kSize - 8; from += std::max(1, kSize - 8)) {
    const std::uint8_t* p = source.data + static_cast<std::ptrdiff_t>(source.step[0]) * top + left + from;
    __m256 h0 = interpolate_row(p, fx);
    for (int j = 0; j < kSize; ++j) {
      p += source.step[0];
      const __m256 h1 = interpolate_row(p, fx);
      _mm256_storeu_ps(out + j * kSize + from, _mm256_add_ps(h0, _mm256_mul_ps(fy, _mm256_sub_ps(h1, h0))));
      h0 = h1;
    }
  }
}

PARALLAX_TARGET_AVX2 void to_grey_avx2(const float* samples, std::uint8_t* out) {
  const __m256 half = _mm256_set1_ps(0.5f);
  const __m256i order = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
  for (int k = 0; k < kPatchPixels; k += 32) {
    __m256i v[4];
    for (int q = 0; q < 4; ++q) v[q] = _mm256_cvttps_epi32(_mm256_add_ps(_mm256_loadu_ps(samples + k + 8 * q), half));
    const __m256i bytes = _mm256_packus_epi16(_mm256_packs_epi32(v[0], v[1]), _mm256_packs_epi32(v[2], v[3]));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(out + k), _mm256_permutevar8x32_epi32(bytes, order));
  }
}

#endif  // PARALLAX_X86

// `out` holds kSize * kSize floats and kVectorSlack more.
template <int kSize>
void sample_all(const GreyImage& source, const AffineGrid& g, float* out) {
#if PARALLAX_X86
  if (g.interior && simd_level() >= SimdLevel::kAvx2) {
    return is_shift(g) ? sample_shift_avx2<kSize>(source, g, out) : sample_all_avx2<kSize>(source, g, out);
  }
#endif
  sample_all_scalar(source, g, -kSize / 2, kSize, out);
}

void round_to_grey(const float* samples, std::uint8_t* out) {
#if PARALLAX_X86
  if (simd_level() >= SimdLevel::kAvx2) return to_grey_avx2(samples, out);
#endif
  for (int k = 0; k < kPatchPixels; ++k) out[k] = to_grey(samples[k]);
}

}  // namespace

bool warp_patch_scalar(const GreyImage& source, const Eigen::Vector2d& centre,
                       const Eigen::Matrix2d& source_from_template, PatchTemplate* out) {
  const AffineGrid g = detail::make_grid(source, centre, source_from_template, -4, 3);
  if (!g.inside) return false;
  float samples[kPatchPixels];
  sample_all_scalar(source, g, -4, kPatchSize, samples);
  for (std::size_t k = 0; k < kPatchPixels; ++k) out->pixels[k] = to_grey(samples[k]);
  finish_template(out);
  return true;
}

bool warp_patch(const GreyImage& source, const Eigen::Vector2d& centre, const Eigen::Matrix2d& source_from_template,
                PatchTemplate* out) {
  const AffineGrid g = detail::make_grid(source, centre, source_from_template, -4, 3);
  if (!g.inside) return false;
  float samples[kPatchPixels + kVectorSlack];
  sample_all<kPatchSize>(source, g, samples);
  round_to_grey(samples, out->pixels.data());
  finish_template(out);
  return true;
}

bool warp_alignment_template_scalar(const GreyImage& source, const Eigen::Vector2d& centre,
                                    const Eigen::Matrix2d& source_from_template, AlignmentTemplate* out) {
  out->valid = false;
  const AffineGrid g = detail::make_grid(source, centre, source_from_template, -5, 4);
  if (!g.inside) return false;
  float wide[kWidePixels];
  sample_all_scalar(source, g, -5, kWideSize, wide);
  finish_alignment(wide, out);
  return true;
}

bool warp_alignment_template(const GreyImage& source, const Eigen::Vector2d& centre,
                             const Eigen::Matrix2d& source_from_template, AlignmentTemplate* out) {
  out->valid = false;
  const AffineGrid g = detail::make_grid(source, centre, source_from_template, -5, 4);
  if (!g.inside) return false;
  float wide[kWidePixels + kVectorSlack];
  sample_all<kWideSize>(source, g, wide);
  finish_alignment(wide, out);
  return true;
}

}  // namespace parallax
