#include "core/camera_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <sstream>

#include "core/error.h"
#include "core/polynomial.h"

namespace parallax {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// Radii beyond this (z = 1), 0.006 degrees from the image plane, are outside every model that needs z > 0.
constexpr double largest_radius = 1e4;

// A fold of a fisheye polynomial at a smaller angle, inside the image, is a wrong calibration (unlit corners are not).
constexpr double smallest_fisheye_fold_rad = std::numbers::pi / 3;

// Plausible parameters: focal length in image sizes, principal point in image sizes, any distortion coefficient.
constexpr double smallest_focal = 1e-3, largest_focal = 1e5, largest_centre = 100, largest_coefficient = 1e9;
constexpr int largest_image_side = 65536;

// Distorted normalised coordinates with their symmetric Jacobian [xx xy; xy yy].
struct Distorted {
  double x, y, xx, xy, yy;
};

// OpenCV's radial-tangential model, rational when k4, k5 or k6 are set. d: k1 k2 p1 p2 k3 k4 k5 k6.
inline Distorted distort_radtan(const std::array<double, 8>& d, double x, double y) {
  const double s = x * x + y * y;
  const double numerator = 1 + s * (d[0] + s * (d[1] + s * d[4]));
  const double denominator_inverse = 1 / (1 + s * (d[5] + s * (d[6] + s * d[7])));
  const double radial = numerator * denominator_inverse;
  const double d_numerator = d[0] + s * (2 * d[1] + 3 * s * d[4]);
  const double d_denominator = d[5] + s * (2 * d[6] + 3 * s * d[7]);
  const double d_radial = (d_numerator - radial * d_denominator) * denominator_inverse;  // d radial / d s
  const double p1 = d[2], p2 = d[3];
  Distorted out;
  out.x = x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x);
  out.y = y * radial + p1 * (s + 2 * y * y) + 2 * p2 * x * y;
  out.xx = radial + 2 * x * x * d_radial + 2 * p1 * y + 6 * p2 * x;
  out.xy = 2 * x * y * d_radial + 2 * p1 * x + 2 * p2 * y;
  out.yy = radial + 2 * y * y * d_radial + 6 * p1 * y + 2 * p2 * x;
  return out;
}

// Kannala-Brandt: the distorted radius of an angle, and its derivative.
inline void distort_angle(const std::array<double, 8>& d, double angle, double* radius, double* derivative) {
  const double s = angle * angle;
  *radius = angle * (1 + s * (d[0] + s * (d[1] + s * (d[2] + s * d[3]))));
  *derivative = 1 + s * (3 * d[0] + s * (5 * d[1] + s * (7 * d[2] + s * 9 * d[3])));
}

// Solves f(x) = target for f(0) = 0, increasing on [0, high], by Newton iterations kept inside a shrinking bracket.
// f(x, &value, &derivative). False when f(high) < target.
template <typename Function>
bool solve_increasing(const Function& f, double target, double high, double* solution) {
  double value = 0, derivative = 0;
  f(high, &value, &derivative);
  if (!(value >= target)) return false;
  double low = 0, x = std::min(target, high);
  for (int i = 0; i < 200; ++i) {
    f(x, &value, &derivative);
    const double error = value - target;
    if (std::abs(error) <= 1e-16 * target) break;
    (error > 0 ? high : low) = x;
    double next = x - error / derivative;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (next == x) break;
    x = next;
  }
  *solution = x;
  return true;
}

[[noreturn]] void refuse(const std::string& what, double found, const std::string& expected) {
  std::ostringstream text;
  text << "camera model: " << what << ": found " << found << ", expected " << expected;
  throw InputError(text.str());
}

}  // namespace

const char* to_string(CameraModelKind kind) {
  switch (kind) {
    case CameraModelKind::pinhole:
      return "pinhole";
    case CameraModelKind::radtan:
      return "radtan";
    case CameraModelKind::kannala_brandt:
      return "kannala_brandt";
    case CameraModelKind::fov:
      return "fov";
  }
  return "unknown";
}

CameraModel::CameraModel(CameraModelKind kind, int width, int height, const Eigen::Vector2d& focal_px,
                         const Eigen::Vector2d& centre_px, const std::array<double, 8>& distortion, int n_distortion)
    : kind_(kind),
      width_(width),
      height_(height),
      focal_(focal_px),
      centre_(centre_px),
      distortion_(distortion),
      n_distortion_(n_distortion) {
  check_parameters();
  for (int i = n_distortion_; i < 8; ++i) distortion_[i] = 0;  // so that equal models compare equal
  find_domain();
  check_no_fold_in_image();
  find_image_radius();
}

void CameraModel::check_parameters() const {
  const char* side_expected = "a whole number from 1 to 65536";
  if (width_ < 1 || width_ > largest_image_side) refuse("image width", width_, side_expected);
  if (height_ < 1 || height_ > largest_image_side) refuse("image height", height_, side_expected);
  const double size = std::max(width_, height_);
  for (int i = 0; i < 2; ++i) {
    const std::string axis = i == 0 ? "x" : "y";
    if (!(focal_[i] > 0) || !std::isfinite(focal_[i])) refuse("focal length f" + axis, focal_[i], "a positive number");
    if (focal_[i] < smallest_focal * size || focal_[i] > largest_focal * size)
      refuse("focal length f" + axis, focal_[i], "0.001 to 100000 times the image size");
    if (!std::isfinite(centre_[i]) || std::abs(centre_[i]) > largest_centre * size)
      refuse("principal point c" + axis, centre_[i], "a finite number within 100 image sizes");
  }
  const int n = n_distortion_;
  if (kind_ < CameraModelKind::pinhole || kind_ > CameraModelKind::fov)
    refuse("kind", static_cast<int>(kind_), "one of CameraModelKind");
  if (kind_ == CameraModelKind::pinhole && n != 0) refuse("number of distortion parameters of pinhole", n, "0");
  if (kind_ == CameraModelKind::radtan && n != 4 && n != 5 && n != 8)
    refuse("number of distortion parameters of radtan", n, "4, 5 or 8");
  if (kind_ == CameraModelKind::kannala_brandt && n != 4)
    refuse("number of distortion parameters of kannala_brandt", n, "4");
  if (kind_ == CameraModelKind::fov && n != 1) refuse("number of distortion parameters of fov", n, "1");
  for (int i = 0; i < n; ++i)
    if (!std::isfinite(distortion_[i]) || std::abs(distortion_[i]) > largest_coefficient)
      refuse("distortion parameter " + std::to_string(i + 1), distortion_[i], "a finite number below 1e9");
  if (kind_ == CameraModelKind::fov && !(distortion_[0] >= 0 && distortion_[0] < 3.14))
    refuse("omega", distortion_[0], "radians from 0 to below pi");
}

void CameraModel::find_domain() {
  domain_radius2_ = largest_radius * largest_radius;
  switch (kind_) {
    case CameraModelKind::pinhole:
      domain_radius2_ = infinity;
      break;
    case CameraModelKind::fov:
      fov_omega_ = std::max(distortion_[0], 1e-9);
      fov_factor_ = 2 * std::tan(fov_omega_ / 2);
      break;
    case CameraModelKind::kannala_brandt: {
      // d/d angle of the odd polynomial, in angle^2.
      const auto& k = distortion_;
      const std::vector<double> slope{1, 3 * k[0], 5 * k[1], 7 * k[2], 9 * k[3]};
      const double pi = std::numbers::pi;
      domain_angle_ = std::sqrt(smallest_root(slope, 0, pi * pi));
      const double radius = domain_angle_ < pi / 2 ? std::tan(domain_angle_) : infinity;
      domain_radius2_ = radius * radius;
      break;
    }
    case CameraModelKind::radtan: {
      // The distorted radius r N(s) / D(s), s = r^2, has the slope (N D + 2 s (N' D - N D')) / D^2.
      const auto& k = distortion_;
      const std::vector<double> n{1, k[0], k[1], k[4]}, d{1, k[5], k[6], k[7]};
      std::vector<double> slope(7, 0.0);
      for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j) slope[i + j] += n[i] * d[j] * (1 + 2 * (i - j));
      const double s = std::min(smallest_root(slope, 0, domain_radius2_), smallest_root(d, 0, domain_radius2_));
      domain_radius2_ = s;
      break;
    }
  }
}

void CameraModel::check_no_fold_in_image() const {
  if (kind_ == CameraModelKind::kannala_brandt) {
    if (domain_angle_ >= smallest_fisheye_fold_rad) return;
    double radius = 0, slope = 0;
    distort_angle(distortion_, domain_angle_, &radius, &slope);
    for (double u : {0.0, width_ - 1.0})
      for (double v : {0.0, height_ - 1.0})
        if (std::hypot((u - centre_.x()) / focal_.x(), (v - centre_.y()) / focal_.y()) > radius)
          refuse("the distortion folds onto itself inside the image: fold angle", domain_angle_,
                 "more radians, or a fold outside the image");
  }
  if (kind_ != CameraModelKind::radtan) return;
  constexpr int steps = 24;
  for (int row = 0; row <= steps; ++row) {
    for (int column = 0; column <= steps; ++column) {
      const Eigen::Vector2d pixel(column * (width_ - 1.0) / steps, row * (height_ - 1.0) / steps);
      Eigen::Vector3d ray;
      bool good = unproject(pixel, &ray);
      if (good) {
        const Distorted d = distort_radtan(distortion_, ray.x(), ray.y());
        good = d.xx * d.yy - d.xy * d.xy > 0 && d.xx > 0;
      }
      if (!good) {
        std::ostringstream where;
        where << "pixel (" << pixel.x() << ", " << pixel.y() << ")";
        throw InputError("camera model: the distortion folds onto itself inside the image: found no ray through " +
                         where.str() + ", expected one through every pixel");
      }
    }
  }
}

void CameraModel::find_image_radius() {
  // Along the rectangle just outside the image, where the radius is largest. A pixel that sees nothing: the domain's.
  constexpr int steps = 64;
  const double left = -0.5 - image_margin_px, right = width_ - 0.5 + image_margin_px;
  const double top = -0.5 - image_margin_px, bottom = height_ - 0.5 + image_margin_px;
  const auto include = [&](double u, double v) {
    Eigen::Vector3d ray;
    const bool seen = unproject({u, v}, &ray);
    max_radius2_ = std::max(max_radius2_, seen ? ray.head<2>().squaredNorm() : domain_radius2_);
  };
  for (int i = 0; i <= steps; ++i) {
    const double u = left + (right - left) * i / steps, v = top + (bottom - top) * i / steps;
    include(u, top);
    include(u, bottom);
    include(left, v);
    include(right, v);
  }
  if (kind_ == CameraModelKind::pinhole && max_radius2_ > largest_radius * largest_radius)
    refuse("focal length fx", focal_.x(), "one that keeps the image within 10000 focal lengths");

  if (kind_ != CameraModelKind::radtan || (distortion_[2] == 0 && distortion_[3] == 0)) return;
  // Tangential terms change the slope by at most 6 |p| r. The domain ends where they could outweigh the radial slope,
  // or where the image ends, whichever is further out (inside the image the absence of a fold has been checked).
  const auto& k = distortion_;
  const std::vector<double> n{1, k[0], k[1], k[4]}, d{1, k[5], k[6], k[7]};
  std::vector<double> slope(14, 0.0);  // in r
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) {
      slope[2 * (i + j)] += n[i] * d[j] * (1 + 2 * (i - j));
      slope[2 * (i + j) + 1] -= 6 * std::hypot(k[2], k[3]) * d[i] * d[j];
    }
  }
  const double r = smallest_root(slope, 0, std::sqrt(domain_radius2_));
  domain_radius2_ = std::min(domain_radius2_, std::max(max_radius2_, r * r));
}

template <bool with_jacobian>
inline bool CameraModel::project_any(const Eigen::Vector3d& point, Eigen::Vector2d* pixel,
                                     Eigen::Matrix<double, 2, 3>* jacobian) const {
  const double X = point.x(), Y = point.y(), Z = point.z();
  if (kind_ == CameraModelKind::kannala_brandt) {
    const double rho2 = X * X + Y * Y, rho = std::sqrt(rho2), n2 = rho2 + Z * Z;
    if (rho2 <= 1e-30 * n2) {
      if (!(Z > 0)) return false;
      const double inverse = 1 / Z, a = X * inverse, b = Y * inverse;
      *pixel = {focal_.x() * a + centre_.x(), focal_.y() * b + centre_.y()};
      if constexpr (with_jacobian)
        *jacobian << focal_.x() * inverse, 0, -focal_.x() * inverse * a, 0, focal_.y() * inverse,
            -focal_.y() * inverse * b;
      return true;
    }
    const double angle = std::atan2(rho, Z);
    if (!(angle <= domain_angle_)) return false;
    double radius, slope;
    distort_angle(distortion_, angle, &radius, &slope);
    const double g = radius / rho;
    *pixel = {focal_.x() * g * X + centre_.x(), focal_.y() * g * Y + centre_.y()};
    if constexpr (with_jacobian) {
      const double n2_inverse = 1 / n2;
      const double h = (slope * Z * n2_inverse - g) / rho2;  // (d g / d rho) / rho
      const double g_z = -slope * n2_inverse;                // d g / d Z
      *jacobian << focal_.x() * (g + X * X * h), focal_.x() * X * Y * h, focal_.x() * X * g_z, focal_.y() * X * Y * h,
          focal_.y() * (g + Y * Y * h), focal_.y() * Y * g_z;
    }
    return true;
  }

  if (!(Z > 0)) return false;
  const double z_inverse = 1 / Z, x = X * z_inverse, y = Y * z_inverse, s = x * x + y * y;
  if (!(s <= domain_radius2_)) return false;
  Distorted d;
  switch (kind_) {
    case CameraModelKind::radtan:
      d = distort_radtan(distortion_, x, y);
      break;
    case CameraModelKind::fov: {
      // PTAM Eq. 4 and 5. g = r' / r, h = (d g / d r) / r.
      const double r = std::sqrt(s);
      double g = fov_factor_ / fov_omega_, h = 0;
      if (s > 1e-30) {
        g = std::atan(fov_factor_ * r) / (fov_omega_ * r);
        h = (fov_factor_ / (fov_omega_ * (1 + fov_factor_ * fov_factor_ * s)) - g) / s;
      }
      d = {x * g, y * g, g + x * x * h, x * y * h, g + y * y * h};
      break;
    }
    default:
      d = {x, y, 1, 0, 1};
      break;
  }
  *pixel = {focal_.x() * d.x + centre_.x(), focal_.y() * d.y + centre_.y()};
  if constexpr (with_jacobian) {
    const double fx = focal_.x() * z_inverse, fy = focal_.y() * z_inverse;
    *jacobian << fx * d.xx, fx * d.xy, -fx * (d.xx * x + d.xy * y), fy * d.xy, fy * d.yy, -fy * (d.xy * x + d.yy * y);
  }
  return true;
}

bool CameraModel::project(const Eigen::Vector3d& point, Eigen::Vector2d* pixel) const {
  return project_any<false>(point, pixel, nullptr);
}

bool CameraModel::project(const Eigen::Vector3d& point, Eigen::Vector2d* pixel,
                          Eigen::Matrix<double, 2, 3>* d_pixel_d_point) const {
  return project_any<true>(point, pixel, d_pixel_d_point);
}

bool CameraModel::unproject(const Eigen::Vector2d& pixel, Eigen::Vector3d* ray) const {
  const double x_d = (pixel.x() - centre_.x()) / focal_.x(), y_d = (pixel.y() - centre_.y()) / focal_.y();
  const double r_d = std::sqrt(x_d * x_d + y_d * y_d);
  if (!std::isfinite(r_d)) return false;
  double scale = 1;  // undistorted by distorted radius
  switch (kind_) {
    case CameraModelKind::pinhole:
      break;
    case CameraModelKind::fov: {
      const double angle = r_d * fov_omega_;
      if (angle >= std::numbers::pi / 2) return false;
      scale = r_d > 1e-15 ? std::tan(angle) / (fov_factor_ * r_d) : fov_omega_ / fov_factor_;
      if (!(scale * scale * r_d * r_d <= domain_radius2_)) return false;
      break;
    }
    case CameraModelKind::kannala_brandt: {
      if (r_d <= 1e-15) break;
      double angle = 0;
      const auto f = [this](double a, double* value, double* slope) { distort_angle(distortion_, a, value, slope); };
      if (!solve_increasing(f, r_d, domain_angle_, &angle) || angle >= std::numbers::pi / 2) return false;
      scale = std::tan(angle) / r_d;
      break;
    }
    case CameraModelKind::radtan: {
      if (r_d <= 1e-15 && distortion_[2] == 0 && distortion_[3] == 0) break;
      // The radial part alone cannot diverge and starts the Newton iteration of the whole model close by. A tangential
      // term may carry a pixel just past the radial limit: start at the limit then.
      const auto radial_only = [this](double r, double* value, double* slope) {
        std::array<double, 8> radial = distortion_;
        radial[2] = radial[3] = 0;
        const Distorted d = distort_radtan(radial, r, 0);
        *value = d.x;
        *slope = d.xx;
      };
      const double limit = std::sqrt(domain_radius2_);
      double r = limit;
      const bool inside = solve_increasing(radial_only, r_d, limit, &r);
      if (distortion_[2] == 0 && distortion_[3] == 0) {
        if (!inside) return false;
        scale = r / r_d;
        break;
      }
      double x = r_d > 0 ? x_d * r / r_d : 0, y = r_d > 0 ? y_d * r / r_d : 0, error = infinity;
      for (int i = 0; i < 20; ++i) {
        const Distorted d = distort_radtan(distortion_, x, y);
        const double ex = d.x - x_d, ey = d.y - y_d, determinant = d.xx * d.yy - d.xy * d.xy;
        const double previous = error;
        error = std::abs(ex) + std::abs(ey);
        if (error == 0 || (error < 1e-12 && error >= previous) || !(std::abs(determinant) > 1e-12)) break;
        x -= (d.yy * ex - d.xy * ey) / determinant;
        y -= (d.xx * ey - d.xy * ex) / determinant;
      }
      if (!(error < 1e-12 * (1 + r_d)) || !(x * x + y * y <= domain_radius2_)) return false;
      *ray = {x, y, 1};
      return true;
    }
  }
  *ray = {x_d * scale, y_d * scale, 1};
  return true;
}

Eigen::Matrix<double, 2, 6> CameraModel::pose_jacobian(const Eigen::Matrix<double, 2, 3>& d_pixel_d_point,
                                                       const Eigen::Vector3d& point) {
  Eigen::Matrix<double, 2, 6> jacobian;
  jacobian.leftCols<3>() = d_pixel_d_point;
  for (int i = 0; i < 2; ++i) {
    // row * -hat(p) = p x row.
    const double a = d_pixel_d_point(i, 0), b = d_pixel_d_point(i, 1), c = d_pixel_d_point(i, 2);
    jacobian(i, 3) = point.y() * c - point.z() * b;
    jacobian(i, 4) = point.z() * a - point.x() * c;
    jacobian(i, 5) = point.x() * b - point.y() * a;
  }
  return jacobian;
}

double CameraModel::mean_focal_px() const { return std::sqrt(0.5 * focal_.squaredNorm()); }

CameraModel CameraModel::scaled(int new_width, int new_height) const {
  const Eigen::Vector2d scale(static_cast<double>(new_width) / width_, static_cast<double>(new_height) / height_);
  const Eigen::Vector2d half(0.5, 0.5);
  return CameraModel(kind_, new_width, new_height, focal_.cwiseProduct(scale),
                     (centre_ + half).cwiseProduct(scale) - half, distortion_, n_distortion_);
}

}  // namespace parallax
