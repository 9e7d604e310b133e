#include "core/small_blurry_image.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "core/check.h"

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_THREAD__)
#define PARALLAX_SMALL_IMAGE_CLONES __attribute__((target_clones("default", "avx2")))
#else
#define PARALLAX_SMALL_IMAGE_CLONES
#endif

namespace parallax {
namespace {

constexpr int kLanes = 8;                   // floats summed side by side: fixed, so every CPU adds in the same order
constexpr double kTargetWidth = 40;         // pixels, PTAM §5.6
constexpr int kCoarseWidth = 24;            // the start of the alignment is searched at most this wide
constexpr double kSearchPart = 0.3;         // reach of that search, part of the image size
constexpr int kStarts = 3;                  // minima of the search that are followed
constexpr double kGoodStart = 0.93;         // correlation at which the other minima are not tried
constexpr int kCoarseIterations = 6;        // at the coarse level
constexpr double kStepConverged_px = 0.02;  // small pixels
constexpr double kStepAcceptable_px = 0.1;  // small pixels, when the iterations run out
constexpr double kMinOverlap = 0.4;         // part of the image
constexpr double kMinCorrelation = 0.75;    // of the aligned images, mean removed
constexpr double kMinVariance = 4.0;        // grey levels squared; less is a blank image

int padded(int n) { return (n + kLanes - 1) / kLanes * kLanes; }

// A float image with rows padded to whole vectors; the padding is zero.
struct Plane {
  int width = 0, height = 0, stride = 0;
  std::vector<float> px;
  void resize(int w, int h) {
    width = w;
    height = h;
    stride = padded(w + 1);  // at least one empty column: whole vectors may run past the row
    px.assign(static_cast<std::size_t>(stride) * static_cast<std::size_t>(h), 0.0F);
  }
  float* row(int y) { return px.data() + static_cast<std::ptrdiff_t>(y) * stride; }
  const float* row(int y) const { return px.data() + static_cast<std::ptrdiff_t>(y) * stride; }
};

void copy_plane(const cv::Mat1f& m, Plane* out) {
  out->resize(m.cols, m.rows);
  for (int y = 0; y < m.rows; ++y) std::copy_n(m[y], m.cols, out->row(y));
}

void halve_plane(const Plane& in, Plane* out) {
  out->resize(in.width / 2, in.height / 2);
  for (int y = 0; y < out->height; ++y) {
    const float* a = in.row(2 * y);
    const float* b = in.row(2 * y + 1);
    float* o = out->row(y);
    for (int x = 0; x < out->width; ++x) o[x] = 0.25F * (a[2 * x] + a[2 * x + 1] + b[2 * x] + b[2 * x + 1]);
  }
}

// The two images at one size, with the work space of an alignment.
struct Level {
  Plane from, to;
  Plane warped, inside;  // `to` seen from `from`; 1 where it was inside the image
};

struct Motion {
  double angle = 0;
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();  // pixels of the level at hand
};

// The x in [0, n) with 0 <= u + x du <= u_limit and 0 <= v + x dv <= v_limit: [begin, end).
std::pair<int, int> inside_range(float u, float du, float u_limit, float v, float dv, float v_limit, int n) {
  float low = 0, high = static_cast<float>(n - 1);
  const auto cut = [&](float at, float step, float limit) {
    if (std::abs(step) < 1e-6F) {
      if (at < 0 || at > limit) high = -1;
      return;
    }
    const float a = -at / step, b = (limit - at) / step;
    low = std::max(low, std::min(a, b));
    high = std::min(high, std::max(a, b));
  };
  cut(u, du, u_limit);
  cut(v, dv, v_limit);
  if (!(high >= low)) return {0, 0};
  return {static_cast<int>(std::ceil(low - 1e-4F)), static_cast<int>(std::floor(high + 1e-4F)) + 1};
}

void warp_level(const Motion& m, Level* level) {
  const Plane& to = level->to;
  const int w = to.width, h = to.height;
  const auto c = static_cast<float>(std::cos(m.angle)), s = static_cast<float>(std::sin(m.angle));
  const float cx = 0.5F * static_cast<float>(w - 1), cy = 0.5F * static_cast<float>(h - 1);
  const auto limit_x = static_cast<float>(w - 1), limit_y = static_cast<float>(h - 1);
  for (int y = 0; y < h; ++y) {
    float* out = level->warped.row(y);
    float* in = level->inside.row(y);
    const float ry = static_cast<float>(y) - cy;
    const float u0 = -s * ry + cx + static_cast<float>(m.shift.x());
    const float v0 = c * ry + cy + static_cast<float>(m.shift.y());
    std::fill_n(out, w, 0.0F);
    std::fill_n(in, w, 0.0F);
    const auto [begin, end] = inside_range(u0 - c * cx, c, limit_x, v0 - s * cx, s, limit_y, w);
    for (int x = begin; x < end; ++x) {
      const float rx = static_cast<float>(x) - cx;
      const float u = std::max(0.0F, u0 + c * rx), v = std::max(0.0F, v0 + s * rx);
      const int iu = std::min(static_cast<int>(u), w - 2), iv = std::min(static_cast<int>(v), h - 2);
      const float fu = u - static_cast<float>(iu), fv = v - static_cast<float>(iv);
      const float* p = to.row(iv) + iu;
      const float* q = p + to.stride;
      const float top = p[0] + fu * (p[1] - p[0]), bottom = q[0] + fu * (q[1] - q[0]);
      out[x] = top + fv * (bottom - top);
      in[x] = 1.0F;
    }
  }
}

// Sums of one row of the normal equations: 4 columns of J (angle, x, y, mean) and the residual, upper triangle.
constexpr int kSums = 15;  // 10 of J'J, 4 of J'r, 1 of r'r
struct RowSums {
  float v[kSums][kLanes];
};

PARALLAX_SMALL_IMAGE_CLONES
void accumulate_row(const float* __restrict f, const float* __restrict f_up, const float* __restrict f_down,
                    const float* __restrict w, const float* __restrict w_up, const float* __restrict w_down,
                    const float* __restrict in, const float* __restrict in_up, const float* __restrict in_down,
                    int begin, int end, float cx, float ry, float mean, RowSums* sums) {
  for (int x0 = begin; x0 < end; x0 += kLanes) {
    float a[kLanes], b[kLanes], g[kLanes], r[kLanes], m[kLanes];
    for (int k = 0; k < kLanes; ++k) {
      const int x = x0 + k;
      const float weight = in[x] * in[x - 1] * in[x + 1] * in_up[x] * in_down[x];
      b[k] = weight * 0.25F * (f[x + 1] - f[x - 1] + w[x + 1] - w[x - 1]);
      g[k] = weight * 0.25F * (f_down[x] - f_up[x] + w_down[x] - w_up[x]);
      a[k] = g[k] * (static_cast<float>(x) - cx) - b[k] * ry;
      r[k] = weight * (w[x] - f[x] - mean);
      m[k] = -weight;
    }
    for (int k = 0; k < kLanes; ++k) {
      sums->v[0][k] += a[k] * a[k];
      sums->v[1][k] += a[k] * b[k];
      sums->v[2][k] += a[k] * g[k];
      sums->v[3][k] += a[k] * m[k];
      sums->v[4][k] += b[k] * b[k];
      sums->v[5][k] += b[k] * g[k];
      sums->v[6][k] += b[k] * m[k];
      sums->v[7][k] += g[k] * g[k];
      sums->v[8][k] += g[k] * m[k];
      sums->v[9][k] += m[k] * m[k];
      sums->v[10][k] += a[k] * r[k];
      sums->v[11][k] += b[k] * r[k];
      sums->v[12][k] += g[k] * r[k];
      sums->v[13][k] += m[k] * r[k];
      sums->v[14][k] += r[k] * r[k];
    }
  }
}

// One step of efficient second-order minimisation (Benhimane and Malis 2004): the Jacobian is the mean of the gradients
// of both images, the increment acts on the side of `from`. Returns the size of the step in pixels, negative when the
// images give no step.
double esm_step(Level* level, Motion* motion, double* mean) {
  warp_level(*motion, level);
  const int w = level->from.width, h = level->from.height;
  const float cx = 0.5F * static_cast<float>(w - 1), cy = 0.5F * static_cast<float>(h - 1);
  RowSums sums{};
  const Plane &f = level->from, &t = level->warped, &in = level->inside;
  for (int y = 1; y < h - 1; ++y) {
    accumulate_row(f.row(y), f.row(y - 1), f.row(y + 1), t.row(y), t.row(y - 1), t.row(y + 1), in.row(y), in.row(y - 1),
                   in.row(y + 1), 1, w - 1, cx, static_cast<float>(y) - cy, static_cast<float>(*mean), &sums);
  }
  std::array<double, kSums> s{};
  for (int i = 0; i < kSums; ++i) {
    for (int k = 0; k < kLanes; ++k) s[static_cast<std::size_t>(i)] += static_cast<double>(sums.v[i][k]);
  }
  if (s[9] < 16) return -1;  // too few pixels in common
  Eigen::Matrix4d A;
  A << s[0], s[1], s[2], s[3], s[1], s[4], s[5], s[6], s[2], s[5], s[7], s[8], s[3], s[6], s[8], s[9];
  const Eigen::Vector4d b(s[10], s[11], s[12], s[13]);
  const double ridge = 1e-6 * s[9];  // keeps a blank image from dividing by zero
  A.diagonal().array() += ridge;
  const Eigen::Vector4d d = A.ldlt().solve(-b);
  if (!d.allFinite()) return -1;
  const Eigen::Rotation2Dd R(motion->angle);
  motion->shift += R * Eigen::Vector2d(d[1], d[2]);
  motion->angle += d[0];
  *mean += d[3];
  return std::max(std::hypot(d[1], d[2]), std::abs(d[0]) * 0.5 * w);
}

// What is left after alignment, over the pixels both images show.
struct Comparison {
  double variance_difference = 0, variance_from = 0, variance_to = 0, correlation = 0, overlap = 0;
};

Comparison compare(const Motion& motion, Level* level) {
  warp_level(motion, level);
  const int w = level->from.width, h = level->from.height;
  double n = 0, sf = 0, st = 0, sff = 0, stt = 0, sft = 0;
  for (int y = 0; y < h; ++y) {
    const float* f = level->from.row(y);
    const float* t = level->warped.row(y);
    const float* in = level->inside.row(y);
    float row[6] = {};
    for (int x = 0; x < w; ++x) {
      const float a = f[x] * in[x], b = t[x];
      row[0] += in[x];
      row[1] += a;
      row[2] += b;
      row[3] += a * a;
      row[4] += b * b;
      row[5] += a * b;
    }
    n += static_cast<double>(row[0]);
    sf += static_cast<double>(row[1]);
    st += static_cast<double>(row[2]);
    sff += static_cast<double>(row[3]);
    stt += static_cast<double>(row[4]);
    sft += static_cast<double>(row[5]);
  }
  Comparison c;
  c.overlap = n / (static_cast<double>(w) * h);
  if (n < 4) return c;
  c.variance_from = std::max(0.0, sff / n - (sf / n) * (sf / n));
  c.variance_to = std::max(0.0, stt / n - (st / n) * (st / n));
  const double covariance = sft / n - (sf / n) * (st / n);
  c.variance_difference = std::max(0.0, c.variance_from + c.variance_to - 2 * covariance);
  const double product = c.variance_from * c.variance_to;
  c.correlation = product > 1e-12 ? covariance / std::sqrt(product) : 0;
  return c;
}

PARALLAX_SMALL_IMAGE_CLONES
void difference_row(const float* __restrict a, const float* __restrict b, const float* __restrict mask, int n,
                    float* __restrict sum, float* __restrict sum_squares) {
  for (int x0 = 0; x0 < n; x0 += kLanes) {
    for (int k = 0; k < kLanes; ++k) {
      const float d = (b[x0 + k] - a[x0 + k]) * mask[x0 + k];
      sum[k] += d;
      sum_squares[k] += d * d;
    }
  }
}

// Every whole-pixel shift within reach: the best minima of the variance of the difference, best first.
std::vector<Eigen::Vector2d> search_shifts(const Level& level) {
  const Plane &from = level.from, &to = level.to;
  const int w = from.width, h = from.height, n = from.stride;
  const int reach_x = static_cast<int>(std::lround(kSearchPart * w));
  const int reach_y = static_cast<int>(std::lround(kSearchPart * h));
  // `to` with room on both sides, so that shifted reads stay inside
  const int room = reach_x + kLanes;
  const int wide = n + 2 * room;
  std::vector<float> spread(static_cast<std::size_t>(wide) * static_cast<std::size_t>(h), 0.0F);
  for (int y = 0; y < h; ++y) {
    std::copy_n(to.row(y), w, spread.data() + static_cast<std::ptrdiff_t>(y) * wide + room);
  }
  const int nx = 2 * reach_x + 1, ny = 2 * reach_y + 1;
  std::vector<double> score(static_cast<std::size_t>(nx * ny));
  std::vector<float> mask(static_cast<std::size_t>(n));
  for (int dx = -reach_x; dx <= reach_x; ++dx) {
    const int x_begin = std::max(0, -dx), x_end = std::min(w, w - dx);
    for (int x = 0; x < n; ++x) mask[static_cast<std::size_t>(x)] = x >= x_begin && x < x_end ? 1.0F : 0.0F;
    for (int dy = -reach_y; dy <= reach_y; ++dy) {
      float sum[kLanes] = {}, sum_squares[kLanes] = {};
      const int y_begin = std::max(0, -dy), y_end = std::min(h, h - dy);
      for (int y = y_begin; y < y_end; ++y) {
        difference_row(from.row(y), spread.data() + static_cast<std::ptrdiff_t>(y + dy) * wide + room + dx, mask.data(),
                       n, sum, sum_squares);
      }
      double s = 0, ss = 0;
      for (int k = 0; k < kLanes; ++k) {
        s += static_cast<double>(sum[k]);
        ss += static_cast<double>(sum_squares[k]);
      }
      const double count = std::max(1, (x_end - x_begin) * (y_end - y_begin));
      score[static_cast<std::size_t>((dy + reach_y) * nx + dx + reach_x)] = ss / count - (s / count) * (s / count);
    }
  }
  std::vector<std::pair<double, int>> minima;
  for (int y = 0; y < ny; ++y) {
    for (int x = 0; x < nx; ++x) {
      const int here = y * nx + x;
      bool smallest = true;
      for (int j = std::max(0, y - 1); j <= std::min(ny - 1, y + 1) && smallest; ++j) {
        for (int i = std::max(0, x - 1); i <= std::min(nx - 1, x + 1); ++i) {
          const int other = j * nx + i;
          const double a = score[static_cast<std::size_t>(other)], b = score[static_cast<std::size_t>(here)];
          if (a < b || (a == b && other < here)) {
            smallest = false;
            break;
          }
        }
      }
      if (smallest) minima.emplace_back(score[static_cast<std::size_t>(here)], here);
    }
  }
  std::sort(minima.begin(), minima.end());
  std::vector<Eigen::Vector2d> out;
  for (std::size_t i = 0; i < minima.size() && i < static_cast<std::size_t>(kStarts); ++i) {
    out.emplace_back(minima[i].second % nx - reach_x, minima[i].second / nx - reach_y);
  }
  if (out.empty()) out.emplace_back(0, 0);
  return out;
}

void prepare_work_space(Level* level) {
  level->warped.resize(level->from.width, level->from.height);
  // one vector of room behind the last row: the row loop works in whole vectors and its lanes beyond the row weigh
  // nothing
  level->inside.resize(level->from.width, level->from.height);
  for (Plane* p : {&level->from, &level->to, &level->warped, &level->inside}) {
    p->px.resize(p->px.size() + 2 * kLanes, 0.0F);
  }
}

}  // namespace

SmallBlurryImage make_small_blurry_image(const ImagePyramid& pyramid, double blur_sigma_small_px) {
  SmallBlurryImage out;
  const int width = pyramid.width();
  if (width < 16 || pyramid.height() < 16) return out;
  // the power of two that comes nearest to the target width
  int halvings = std::max(0, static_cast<int>(std::lround(std::log2(width / kTargetWidth))));
  out.scale = std::ldexp(1.0, halvings);
  const int start = std::min(halvings, kPyramidLevels - 1);
  cv::Mat1f image;
  pyramid.level[static_cast<std::size_t>(start)].convertTo(image, CV_32F);
  for (int i = start; i < halvings; ++i) {
    cv::Mat1f half;
    cv::resize(image(cv::Rect(0, 0, image.cols / 2 * 2, image.rows / 2 * 2)), half,
               cv::Size(image.cols / 2, image.rows / 2), 0, 0, cv::INTER_AREA);
    image = half;
  }
  if (blur_sigma_small_px > 0) {
    cv::GaussianBlur(image, image, cv::Size(), blur_sigma_small_px, blur_sigma_small_px, cv::BORDER_REFLECT_101);
  }
  image -= cv::mean(image)[0];
  out.image = image;
  const int w = image.cols, h = image.rows;
  out.dx.create(h, w);
  out.dy.create(h, w);
  for (int y = 0; y < h; ++y) {
    const float* row = image[y];
    const float* up = image[std::max(0, y - 1)];
    const float* down = image[std::min(h - 1, y + 1)];
    float* gx = out.dx[y];
    float* gy = out.dy[y];
    const float step = y > 0 && y < h - 1 ? 0.5F : 1.0F;
    for (int x = 1; x < w - 1; ++x) gx[x] = 0.5F * (row[x + 1] - row[x - 1]);
    gx[0] = row[1] - row[0];
    gx[w - 1] = row[w - 1] - row[w - 2];
    for (int x = 0; x < w; ++x) gy[x] = step * (down[x] - up[x]);
  }
  return out;
}

double small_image_difference(const SmallBlurryImage& a, const SmallBlurryImage& b) {
  PARALLAX_CHECK(!a.empty() && a.image.size() == b.image.size(), "small images must be of one size");
  double total = 0;
  for (int y = 0; y < a.image.rows; ++y) {
    const float* p = a.image[y];
    const float* q = b.image[y];
    float lanes[kLanes] = {};
    int x = 0;
    for (; x + kLanes <= a.image.cols; x += kLanes) {
      for (int k = 0; k < kLanes; ++k) lanes[k] += (p[x + k] - q[x + k]) * (p[x + k] - q[x + k]);
    }
    for (; x < a.image.cols; ++x) lanes[0] += (p[x] - q[x]) * (p[x] - q[x]);
    for (const float lane : lanes) total += static_cast<double>(lane);
  }
  return total / static_cast<double>(a.image.total());
}

SmallImageAlignment align_small_images(const SmallBlurryImage& from, const SmallBlurryImage& to, int max_iterations) {
  PARALLAX_CHECK(!from.empty() && from.image.size() == to.image.size(), "small images must be of one size");
  std::array<Level, 3> levels;
  copy_plane(from.image, &levels[0].from);
  copy_plane(to.image, &levels[0].to);
  std::size_t coarse = 0;
  while (coarse + 1 < levels.size() && levels[coarse].from.width > kCoarseWidth && levels[coarse].from.height >= 16) {
    halve_plane(levels[coarse].from, &levels[coarse + 1].from);
    halve_plane(levels[coarse].to, &levels[coarse + 1].to);
    ++coarse;
  }
  const std::vector<Eigen::Vector2d> starts = search_shifts(levels[coarse]);
  for (std::size_t i = 0; i <= coarse; ++i) prepare_work_space(&levels[i]);

  Motion best;
  double best_correlation = -2;
  for (const Eigen::Vector2d& start : starts) {
    Motion motion;
    motion.shift = start;
    double mean = 0;
    for (int i = 0; i < kCoarseIterations; ++i) {
      const double step = esm_step(&levels[coarse], &motion, &mean);
      if (step < 0) break;
      if (step < 3 * kStepConverged_px) break;
    }
    const Comparison c = compare(motion, &levels[coarse]);
    if (c.overlap >= kMinOverlap && c.correlation > best_correlation) {
      best_correlation = c.correlation;
      best = motion;
    }
    if (best_correlation > kGoodStart) break;
  }
  double last_step = -1;
  for (std::size_t l = coarse + 1; l-- > 0;) {
    if (l != coarse) best.shift *= 2;
    double mean = 0;
    const int iterations = l == 0 ? max_iterations : (l == coarse ? 0 : kCoarseIterations);
    for (int i = 0; i < iterations; ++i) {
      last_step = esm_step(&levels[l], &best, &mean);
      if (last_step < kStepConverged_px) break;
    }
  }
  const Comparison c = compare(best, &levels[0]);
  SmallImageAlignment out;
  out.angle = std::remainder(best.angle, 2 * M_PI);
  out.shift = best.shift * from.scale;
  out.mean_squared_difference = c.variance_difference;
  out.overlap = c.overlap;
  out.converged = last_step >= 0 && last_step < kStepAcceptable_px && c.overlap >= kMinOverlap &&
                  c.correlation >= kMinCorrelation && c.variance_from >= kMinVariance &&
                  c.variance_to >= kMinVariance && best_correlation > -2;
  return out;
}

Eigen::Matrix3d rotation_from_alignment(const CameraModel& camera, const SmallImageAlignment& alignment) {
  constexpr int kGrid = 8;  // points a side
  const Eigen::Vector2d centre(0.5 * (camera.width() - 1), 0.5 * (camera.height() - 1));
  const Eigen::Rotation2Dd R(alignment.angle);
  Eigen::Matrix3d correlation = Eigen::Matrix3d::Zero();
  int used = 0;
  for (int j = 0; j < kGrid; ++j) {
    for (int i = 0; i < kGrid; ++i) {
      const Eigen::Vector2d p((i + 0.5) * camera.width() / kGrid - 0.5, (j + 0.5) * camera.height() / kGrid - 0.5);
      const Eigen::Vector2d q = R * (p - centre) + centre + alignment.shift;
      if (!camera.in_image(q)) continue;
      Eigen::Vector3d a, b;
      if (!camera.unproject(p, &a) || !camera.unproject(q, &b)) continue;
      correlation += b.normalized() * a.normalized().transpose();
      ++used;
    }
  }
  if (used < 2) return Eigen::Matrix3d::Identity();
  // the rotation that takes the rays of `from` to those of `to` (Wahba's problem, by singular value decomposition)
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(correlation, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d d(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant());
  return svd.matrixU() * d.asDiagonal() * svd.matrixV().transpose();
}

}  // namespace parallax
