#include "mapper/patch_slope.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "map/source_patch.h"

namespace parallax {
namespace {

constexpr double kWindowSigma_px =
    4.5;  // of the Gaussian weight: the rim, which may lie on something else, counts little
constexpr double kLeastContrast = 4.0;  // grey levels, standard deviation over the window
constexpr double kSensorNoise = 2.0;    // grey levels, standard deviation: residuals below it say nothing
constexpr double kModelError = 2.0;     // residuals are correlated: standard deviations grow by this factor
constexpr int kAlignSteps = 3, kRefineSteps = 5;
constexpr double kMaxDrift_px = 2.5;  // of a view's centre from the measured pixel
constexpr double kLost = 1.0;         // unexplained part of a view that cannot be used

// Bilinear, inside the image.
inline float bilinear(const GreyImage& image, float x, float y) {
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const float fx = x - static_cast<float>(ix), fy = y - static_cast<float>(iy);
  const std::uint8_t* top = image.data + static_cast<std::size_t>(iy) * image.step[0] + ix;
  const std::uint8_t* bottom = top + image.step[0];
  const float a = top[0] + fx * static_cast<float>(top[1] - top[0]);
  const float b = bottom[0] + fx * static_cast<float>(bottom[1] - bottom[0]);
  return a + fy * (b - a);
}

bool sampled_inside(const GreyImage& image, const Eigen::Vector2d& p) {
  return p.x() >= 0 && p.y() >= 0 && p.x() < image.cols - 1.01 && p.y() < image.rows - 1.01;
}

}  // namespace

Eigen::Vector2d slope_of_normal(const Eigen::Matrix3d& rays, const Eigen::Vector3d& normal) {
  const Eigen::Vector3d n = rays.transpose() * normal;
  return {n.y() / n.x() - 1.0, n.z() / n.x() - 1.0};
}

Eigen::Vector3d normal_of_slope(const Eigen::Matrix3d& rays, const Eigen::Vector2d& slope) {
  const Eigen::Matrix3d m = rays.transpose();
  return -(m.inverse() * Eigen::Vector3d(1.0, 1.0 + slope.x(), 1.0 + slope.y())).normalized();
}

PatchSlope::PatchSlope(const ImagePyramid& source, int source_level, const Eigen::Vector2d& source_pixel,
                       const Eigen::Matrix3d& rays, double depth)
    : rays_(rays), inverse_depth_(1.0 / depth) {
  const GreyImage& image = source.level[source_level];
  constexpr int kRim = kRadius + 1;
  if (!sampled_inside(image, source_pixel.array() - kRim) || !sampled_inside(image, source_pixel.array() + kRim))
    return;
  // One more on each side, for the derivatives.
  constexpr int kWide = kSize + 2;
  float wide[kWide * kWide];
  const float left = static_cast<float>(source_pixel.x()) - kRim, top = static_cast<float>(source_pixel.y()) - kRim;
  for (int j = 0; j < kWide; ++j)
    for (int i = 0; i < kWide; ++i)
      wide[j * kWide + i] = bilinear(image, left + static_cast<float>(i), top + static_cast<float>(j));

  weight_.setZero();
  warped_.setZero();
  for (Samples& b : weighted_) b.setZero();
  double sum = 0, total = 0;
  for (int j = 0; j < kSize; ++j) {
    for (int i = 0; i < kSize; ++i) {
      const int k = j * kRow + i;
      const float* p = wide + (j + 1) * kWide + i + 1;
      const float dx = static_cast<float>(i - kRadius), dy = static_cast<float>(j - kRadius);
      weight_[k] = std::exp(-(dx * dx + dy * dy) * static_cast<float>(0.5 / (kWindowSigma_px * kWindowSigma_px)));
      const float tx = 0.5f * (p[1] - p[-1]), ty = 0.5f * (p[kWide] - p[-kWide]);
      const float values[kBasis] = {tx, ty, tx * dx, tx * dy, ty * dx, ty * dy, *p, 1.0f};
      for (int b = 0; b < kBasis; ++b) weighted_[b][k] = values[b];
      sum += weight_[k] * *p;
      total += weight_[k];
    }
  }
  const auto mean = static_cast<float>(sum / total);
  for (int j = 0; j < kSize; ++j)
    for (int i = 0; i < kSize; ++i) weighted_[6][j * kRow + i] -= mean;
  for (int b = 0; b < kBasis; ++b)
    for (int c = b; c < kBasis; ++c) gram_(b, c) = gram_(c, b) = (weighted_[b] * weight_ * weighted_[c]).sum();
  for (Samples& b : weighted_) b *= weight_;
  ok_ = gram_(6, 6) > kLeastContrast * kLeastContrast * gram_(7, 7);
}

bool PatchSlope::add(const CameraModel& camera, const SlopeView& view, const Eigen::Vector2d& slope) {
  View v;
  const Eigen::Matrix3d& R = view.view_from_source.R;
  v.h.col(0) = R * rays_.col(0) + view.view_from_source.t * inverse_depth_;
  v.h.col(1) = R * (rays_.col(1) - rays_.col(0));
  v.h.col(2) = R * (rays_.col(2) - rays_.col(0));
  v.t = view.view_from_source.t * inverse_depth_;
  const Eigen::Vector3d q = v.h.col(0);
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> jacobian;
  if (!camera.project(q, &pixel, &jacobian)) return false;
  const Eigen::Matrix<double, 3, 2> axes = v.h.rightCols<2>() + v.t * slope.transpose();
  const int level = target_level((jacobian * axes).determinant());
  if (level < 0) return false;
  v.pixel_from_ray = jacobian.leftCols<2>() * (q.z() / level_scale(level));
  v.centre = level0_to_level(view.pixel, level);
  v.image = &view.pyramid->level[level];
  views_.push_back(v);
  return true;
}

bool PatchSlope::sample(const View& view, const Eigen::Vector2d& slope, Sampled* out) {
  const Eigen::Vector3d q0 = view.h.col(0);
  const Eigen::Vector3d qx = view.h.col(1) + view.t * slope.x(), qy = view.h.col(2) + view.t * slope.y();
  const Eigen::Vector2d at = q0.head<2>() / q0.z();
  // In pixels: place = base + (a + b x + c y) / (z0 + zx x + zy y).
  const auto to_pixels = [&](const Eigen::Vector3d& q) -> Eigen::Vector2d {
    return view.pixel_from_ray * (q.head<2>() - at * q.z());
  };
  const Eigen::Vector2d px = to_pixels(qx), py = to_pixels(qy);
  out->affine.col(0) = px / q0.z();
  out->affine.col(1) = py / q0.z();
  if (!(std::abs(out->affine.determinant()) > 0.05)) return false;
  out->epipolar = out->affine.inverse() * (to_pixels(view.t) / q0.z());
  const auto place = [&](double x, double y, double z) -> Eigen::Vector2d {
    return view.centre + (px * x + py * y) / z;
  };
  for (int corner = 0; corner < 4; ++corner) {
    const double x = corner & 1 ? kRadius : -kRadius, y = corner & 2 ? kRadius : -kRadius;
    const double z = q0.z() + qx.z() * x + qy.z() * y;
    if (!(z > 0.2 * q0.z()) || !sampled_inside(*view.image, place(x, y, z)) || place(x, y, z).minCoeff() < 0.01)
      return false;
  }
  const auto cx = static_cast<float>(view.centre.x()), cy = static_cast<float>(view.centre.y());
  const auto pxx = static_cast<float>(px.x()), pxy = static_cast<float>(px.y());
  const auto pyx = static_cast<float>(py.x()), pyy = static_cast<float>(py.y());
  const auto z0 = static_cast<float>(q0.z()), zx = static_cast<float>(qx.z()), zy = static_cast<float>(qy.z());
  for (int j = 0; j < kSize; ++j) {
    const auto y = static_cast<float>(j - kRadius);
    const float row_x = pyx * y, row_y = pyy * y, row_z = z0 + zy * y;
    float* row = warped_.data() + j * kRow;
    for (int i = 0; i < kSize; ++i) {
      const auto x = static_cast<float>(i - kRadius);
      const float inverse = 1.0f / (row_z + zx * x);
      row[i] = bilinear(*view.image, cx + (row_x + pxx * x) * inverse, cy + (row_y + pxy * x) * inverse);
    }
  }
  for (int b = 0; b < kBasis; ++b) out->moments[b] = (weighted_[b] * warped_).sum();
  out->energy = (warped_.square() * weight_).sum();
  return true;
}

double PatchSlope::unexplained(const Sampled& s, double* gain) const {
  const double total = gram_(7, 7);
  const double variance = s.energy - s.moments[7] * s.moments[7] / total;
  // The patch's mean is zero under the weights: gain and mean are independent.
  *gain = s.moments[6] / gram_(6, 6);
  const double noise = kSensorNoise * kSensorNoise * total;
  if (!(*gain > 0.3 && *gain < 3.0) || !(variance > noise)) return kLost;
  return std::clamp((variance - s.moments[6] * s.moments[6] / gram_(6, 6) + noise) / (variance + noise), 0.0, kLost);
}

double PatchSlope::align(View* view, const Eigen::Vector2d& slope) {
  static constexpr std::array<int, 4> kColumns = {0, 1, 6, 7};
  Eigen::Matrix4d normal;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) normal(i, j) = gram_(kColumns[i], kColumns[j]);
  const Eigen::Matrix4d inverse = normal.inverse();
  const Eigen::Vector2d measured = view->centre;
  double best = kLost, gain = 0;
  Eigen::Vector2d best_centre = measured;
  Sampled s;
  for (int step = 0;; ++step) {
    if (!sample(*view, slope, &s)) break;
    const double part = unexplained(s, &gain);
    if (part < best) {
      best = part;
      best_centre = view->centre;
    } else if (step > 0) {
      break;
    }
    if (step == kAlignSteps) break;
    Eigen::Vector4d rhs;
    for (int i = 0; i < 4; ++i) rhs[i] = s.moments[kColumns[i]];
    const Eigen::Vector4d x = inverse * rhs;
    if (!(x[2] > 0.1)) break;
    const Eigen::Vector2d shift = s.affine * (-x.head<2>() / x[2]);
    if (!(shift.squaredNorm() > 1e-4)) break;
    view->centre += shift;
    if ((view->centre - measured).norm() > kMaxDrift_px) break;
  }
  view->centre = best_centre;
  return best;
}

double PatchSlope::score(const Eigen::Vector2d& slope) {
  double sum = 0, worst = 0;
  for (View view : views_) {
    const double part = align(&view, slope);
    sum += part;
    worst = std::max(worst, part);
  }
  const int n = views();
  if (n >= 4) return (sum - worst) / (n - 1);
  return n > 0 ? sum / n : kLost;
}

PatchSlope::Refinement PatchSlope::refine(const Eigen::Vector2d& start, double prior_sigma) {
  Refinement out;
  out.slope = start;
  std::vector<View> views = views_;
  std::vector<double> part(views.size());
  for (std::size_t v = 0; v < views.size(); ++v) part[v] = align(&views[v], start);
  constexpr double kUsable = 0.6;
  Eigen::Matrix2d information;
  struct Step {
    View* view;
    Eigen::Matrix2d affine;
    Eigen::Matrix<double, 4, 2> from_slope;
    Eigen::Vector4d alone;
    double gain;
  };
  std::vector<Step> steps;
  for (int iteration = 0; iteration < kRefineSteps; ++iteration) {
    information = Eigen::Matrix2d::Identity() / (prior_sigma * prior_sigma);
    Eigen::Vector2d rhs = information * (start - out.slope);
    steps.clear();
    for (std::size_t v = 0; v < views.size(); ++v) {
      if (part[v] > kUsable) continue;
      Sampled s;
      double gain = 0;
      if (!sample(views[v], out.slope, &s) || unexplained(s, &gain) >= kLost) continue;
      // Columns: slope (2), shift (2), patch, mean; the model is image = gain patch + mean - gain (derivatives) update.
      Eigen::Matrix<double, kBasis, 6> columns = Eigen::Matrix<double, kBasis, 6>::Zero();
      columns(2, 0) = columns(3, 1) = s.epipolar.x();
      columns(4, 0) = columns(5, 1) = s.epipolar.y();
      columns(0, 2) = columns(1, 3) = columns(6, 4) = columns(7, 5) = 1.0;
      const Eigen::Matrix<double, 6, 6> normal = columns.transpose() * gram_ * columns;
      const Eigen::Matrix<double, 6, 1> moments = columns.transpose() * s.moments;
      const Eigen::Matrix4d own = normal.bottomRightCorner<4, 4>().inverse();
      const Eigen::Matrix<double, 4, 2> cross = normal.bottomLeftCorner<4, 2>();
      const Eigen::Matrix2d reduced = normal.topLeftCorner<2, 2>() - cross.transpose() * own * cross;
      const Eigen::Vector4d alone = own * moments.tail<4>();
      const Eigen::Vector2d reduced_rhs = moments.head<2>() - cross.transpose() * alone;
      // Noise of the view in grey levels of the patch.
      const double residual = s.energy - moments.tail<4>().dot(alone);
      const double variance =
          std::max(residual / gram_(7, 7), kSensorNoise * kSensorNoise) * (kModelError * kModelError) / (gain * gain);
      information += reduced / variance;
      rhs -= reduced_rhs / (gain * variance);
      steps.push_back({&views[v], s.affine, own * cross, alone, gain});
    }
    if (steps.empty()) return out;
    const Eigen::Vector2d update = information.inverse() * rhs;
    if (!update.allFinite()) return out;
    // At most a change of the prior's size at once.
    const double length = update.norm();
    const Eigen::Vector2d step = length > prior_sigma ? Eigen::Vector2d(update * (prior_sigma / length)) : update;
    out.slope += step;
    for (const Step& s : steps) {
      const Eigen::Vector4d x = s.alone + s.from_slope * (s.gain * step);
      Eigen::Vector2d shift = s.affine * (-x.head<2>() / s.gain);
      if (const double size = shift.norm(); size > 1.0) shift /= size;
      s.view->centre += shift;
    }
    if (step.norm() < 0.01 * prior_sigma) break;
  }
  const double trace = information.trace() / 2, det = information.determinant();
  const double least = trace - std::sqrt(std::max(0.0, trace * trace - det));
  out.sigma = 1.0 / (std::sqrt(least) * prior_sigma);
  out.ok = out.slope.allFinite();
  return out;
}

}  // namespace parallax
