#include "tracker/affine_alignment.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_THREAD__)
#define PARALLAX_WINDOW_CLONES __attribute__((target_clones("default", "avx2")))
#else
#define PARALLAX_WINDOW_CLONES
#endif

namespace parallax {
namespace {

constexpr double kSmoothing_px = 0.8;    // standard deviation
constexpr double kWeightSigma_px = 5.0;  // of the window's Gaussian weight
constexpr double kMinVariance = 4.0;     // of the window, grey levels squared
constexpr double kMinInformation = 1.0;  // weaker eigenvalue of the translation information, a pixel
constexpr double kStepConverged_px = 0.005;
constexpr double kStepAcceptable_px = 0.02;
constexpr int kLanes = 8;

using Window = std::array<float, kWindowFloats>;

// Gaussian weights that sum to 1; the empty column has none.
const Window& window_weights() {
  static const Window weights = [] {
    Window w{};
    double total = 0;
    for (int pass = 0; pass < 2; ++pass) {
      for (int j = 0; j < kWindowRows; ++j) {
        for (int i = 0; i < kWindowRows; ++i) {
          const double x = i - kWindowHalf, y = j - kWindowHalf;
          const double value = std::exp(-0.5 * (x * x + y * y) / (kWeightSigma_px * kWeightSigma_px));
          if (pass == 0) total += value;
          if (pass == 1) w[static_cast<std::size_t>(j * kWindowStride + i)] = static_cast<float>(value / total);
        }
      }
    }
    return w;
  }();
  return weights;
}

// Samples centre + linear * (i, j) for i, j in -half..half; false when a sample leaves the image.
bool sample_window(const cv::Mat1f& image, const Eigen::Vector2d& centre, const Eigen::Matrix2d& linear, int half,
                   int stride, float* out) {
  const double reach_x = half * (std::abs(linear(0, 0)) + std::abs(linear(0, 1)));
  const double reach_y = half * (std::abs(linear(1, 0)) + std::abs(linear(1, 1)));
  if (!(centre.x() - reach_x >= 0 && centre.y() - reach_y >= 0 && centre.x() + reach_x < image.cols - 1.001 &&
        centre.y() + reach_y < image.rows - 1.001)) {
    return false;
  }
  const auto a = static_cast<float>(linear(0, 0)), c = static_cast<float>(linear(1, 0));
  const auto step = static_cast<std::ptrdiff_t>(image.step1());
  // coordinates relative to a whole pixel keep their precision in float
  const int ox = static_cast<int>(centre.x() - reach_x), oy = static_cast<int>(centre.y() - reach_y);
  const float* origin = image[oy] + ox;
  for (int j = -half; j <= half; ++j) {
    const auto u0 = static_cast<float>(centre.x() - ox + linear(0, 1) * j - linear(0, 0) * half);
    const auto v0 = static_cast<float>(centre.y() - oy + linear(1, 1) * j - linear(1, 0) * half);
    float* row = out + static_cast<std::ptrdiff_t>(j + half) * stride;
    for (int i = 0; i <= 2 * half; ++i) {
      const float u = std::max(0.0F, u0 + a * static_cast<float>(i)),
                  v = std::max(0.0F, v0 + c * static_cast<float>(i));
      const int iu = static_cast<int>(u), iv = static_cast<int>(v);
      const float fu = u - static_cast<float>(iu), fv = v - static_cast<float>(iv);
      const float* p = origin + iv * step + iu;
      const float* q = p + step;
      const float top = p[0] + fu * (p[1] - p[0]), bottom = q[0] + fu * (q[1] - q[0]);
      row[i] = top + fv * (bottom - top);
    }
  }
  return true;
}

// The same with each place drawn together by 1 / (1 + perspective . (i, j)).
bool sample_perspective(const cv::Mat1f& image, const Eigen::Vector2d& centre, const Eigen::Matrix2d& linear,
                        const Eigen::Vector2d& perspective, float* out) {
  const double widest = 1 - kWindowHalf * perspective.lpNorm<1>();
  if (!(widest > 0.5)) return false;
  const double reach_x = kWindowHalf * (std::abs(linear(0, 0)) + std::abs(linear(0, 1))) / widest;
  const double reach_y = kWindowHalf * (std::abs(linear(1, 0)) + std::abs(linear(1, 1))) / widest;
  if (!(centre.x() - reach_x >= 0 && centre.y() - reach_y >= 0 && centre.x() + reach_x < image.cols - 1.001 &&
        centre.y() + reach_y < image.rows - 1.001)) {
    return false;
  }
  const Eigen::Matrix2f a = linear.cast<float>();
  const Eigen::Vector2f h = perspective.cast<float>();
  const auto step = static_cast<std::ptrdiff_t>(image.step1());
  const int ox = static_cast<int>(centre.x() - reach_x), oy = static_cast<int>(centre.y() - reach_y);
  const float* origin = image[oy] + ox;
  const auto u0 = static_cast<float>(centre.x() - ox), v0 = static_cast<float>(centre.y() - oy);
  for (int j = -kWindowHalf; j <= kWindowHalf; ++j) {
    float* row = out + static_cast<std::ptrdiff_t>(j + kWindowHalf) * kWindowStride;
    const auto y = static_cast<float>(j);
    for (int i = -kWindowHalf; i <= kWindowHalf; ++i) {
      const auto x = static_cast<float>(i);
      const float scale = 1 / (1 + h[0] * x + h[1] * y);
      const float u = std::max(0.0F, u0 + (a(0, 0) * x + a(0, 1) * y) * scale);
      const float v = std::max(0.0F, v0 + (a(1, 0) * x + a(1, 1) * y) * scale);
      const int iu = static_cast<int>(u), iv = static_cast<int>(v);
      const float fu = u - static_cast<float>(iu), fv = v - static_cast<float>(iv);
      const float* p = origin + iv * step + iu;
      const float* q = p + step;
      const float top = p[0] + fu * (p[1] - p[0]), bottom = q[0] + fu * (q[1] - q[0]);
      row[i + kWindowHalf] = top + fv * (bottom - top);
    }
  }
  return true;
}

// Sums over windows, lane by lane so that the order never changes.
PARALLAX_WINDOW_CLONES double sum_of_products(const Window& a, const Window& b) {
  float lanes[kLanes] = {};
  for (std::size_t i = 0; i < kWindowFloats; i += kLanes) {
    for (std::size_t k = 0; k < kLanes; ++k) lanes[k] += a[i + k] * b[i + k];
  }
  double total = 0;
  for (const float lane : lanes) total += static_cast<double>(lane);
  return total;
}

}  // namespace

cv::Mat1f smooth_for_alignment(const cv::Mat1b& image) {
  cv::Mat1f out;
  image.convertTo(out, CV_32F);
  cv::GaussianBlur(out, out, cv::Size(5, 5), kSmoothing_px, kSmoothing_px, cv::BORDER_REPLICATE);
  return out;
}

bool AffineTemplate::prepare(const cv::Mat1f& image, const Eigen::Vector2d& centre) {
  constexpr int kWide = kWindowRows + 2;
  std::array<float, kWide * kWide> wide;
  if (!sample_window(image, centre, Eigen::Matrix2d::Identity(), kWindowHalf + 1, kWide, wide.data())) return false;
  const Window& weights = window_weights();
  Window gx{}, gy{};
  for (int j = 0; j < kWindowRows; ++j) {
    for (int i = 0; i < kWindowRows; ++i) {
      const float* p = wide.data() + (j + 1) * kWide + i + 1;
      const auto k = static_cast<std::size_t>(j * kWindowStride + i);
      intensity_[k] = p[0];
      gx[k] = 0.5F * (p[1] - p[-1]);
      gy[k] = 0.5F * (p[kWide] - p[-kWide]);
    }
  }
  const auto mean = static_cast<float>(sum_of_products(intensity_, weights));
  Window weighted{};
  for (std::size_t k = 0; k < kWindowFloats; ++k) {
    intensity_[k] -= mean;
    weighted[k] = weights[k] * intensity_[k];
  }
  variance_sum_ = sum_of_products(weighted, intensity_);
  if (variance_sum_ < kMinVariance) return false;

  // Columns: x, y, and the four of the linear part about the centre; minus what offset and gain explain.
  for (int j = 0; j < kWindowRows; ++j) {
    for (int i = 0; i < kWindowStride; ++i) {
      const auto k = static_cast<std::size_t>(j * kWindowStride + i);
      const auto x = static_cast<float>(i - kWindowHalf), y = static_cast<float>(j - kWindowHalf);
      steepest_[0][k] = gx[k];
      steepest_[1][k] = gy[k];
      steepest_[2][k] = gx[k] * x;
      steepest_[3][k] = gx[k] * y;
      steepest_[4][k] = gy[k] * x;
      steepest_[5][k] = gy[k] * y;
    }
  }
  for (Window& s : steepest_) {
    const auto offset = static_cast<float>(sum_of_products(s, weights));
    const auto gain = static_cast<float>(sum_of_products(s, weighted) / variance_sum_);
    for (std::size_t k = 0; k < kWindowFloats; ++k) s[k] -= offset + gain * intensity_[k];
  }
  std::array<Window, 6> plain = steepest_;
  for (Window& s : steepest_) {
    for (std::size_t k = 0; k < kWindowFloats; ++k) s[k] *= weights[k];
  }
  for (int r = 0; r < 6; ++r) {
    for (int c = r; c < 6; ++c) {
      information_(r, c) = information_(c, r) =
          sum_of_products(steepest_[static_cast<std::size_t>(r)], plain[static_cast<std::size_t>(c)]);
    }
  }
  const double a = information_(0, 0), b = information_(0, 1), c = information_(1, 1);
  return 0.5 * (a + c - std::sqrt((a - c) * (a - c) + 4 * b * b)) >= kMinInformation;
}

AffineTemplate::Result AffineTemplate::align(const cv::Mat1f& image, const Eigen::Vector2d& start,
                                             const Eigen::Matrix2d& linear, bool affine, int max_iterations,
                                             const Eigen::Vector2d& perspective) const {
  Result result;
  result.position = start;
  result.linear = linear;
  const int n = affine ? 6 : 2;
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Identity();
  normal.topLeftCorner(n, n) = information_.topLeftCorner(n, n);
  if (affine) normal.diagonal().tail<4>() *= 1.0 + 1e-4;  // changes the path, not where it ends
  const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> solver(normal);
  if (solver.info() != Eigen::Success) return result;

  const Window& weights = window_weights();
  const bool flat = perspective.isZero(0);
  alignas(64) Window seen{};
  double step_px = 1e9;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const bool sampled =
        flat ? sample_window(image, result.position, result.linear, kWindowHalf, kWindowStride, seen.data())
             : sample_perspective(image, result.position, result.linear, perspective, seen.data());
    if (!sampled) return result;
    const auto mean = static_cast<float>(sum_of_products(seen, weights));
    Window weighted;
    for (std::size_t k = 0; k < kWindowFloats; ++k) {
      seen[k] -= mean;
      weighted[k] = weights[k] * seen[k];
    }
    const double covariance = sum_of_products(weighted, intensity_);
    const double variance = sum_of_products(weighted, seen);
    const double gain = covariance / variance_sum_;
    if (!(gain > 0.3 && gain < 3.0 && variance > 0)) return result;
    result.correlation = covariance / std::sqrt(variance * variance_sum_);
    // The template moved by d against the image: steepest * d = image / gain - template; offset and gain are projected
    // out of `steepest`, so the template and the mean need not be subtracted.
    Eigen::Matrix<double, 6, 1> d = Eigen::Matrix<double, 6, 1>::Zero();
    for (int i = 0; i < n; ++i) d[i] = sum_of_products(steepest_[static_cast<std::size_t>(i)], seen) / gain;
    d = solver.solve(d);
    if (!d.allFinite()) return result;
    Eigen::Matrix2d increment = Eigen::Matrix2d::Identity();
    if (affine) increment += (Eigen::Matrix2d() << d[2], d[3], d[4], d[5]).finished();
    if (!(std::abs(increment.determinant()) > 0.2)) return result;
    // W <- W o increment^-1
    const Eigen::Matrix2d inverse = increment.inverse();
    result.position -= result.linear * (inverse * d.head<2>());
    result.linear = result.linear * inverse;
    step_px = d.head<2>().norm();
    if (affine) step_px = std::max(step_px, 0.2 * kWindowHalf * d.tail<4>().norm());
    if (!((result.position - start).squaredNorm() < 64)) return result;
    if (step_px < kStepConverged_px) break;
  }
  result.converged = step_px < kStepAcceptable_px;
  return result;
}

}  // namespace parallax
