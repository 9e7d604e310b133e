#include "render/gl_lens.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace parallax {
namespace {

constexpr double kMaxDeviation_px = 0.25;
constexpr double kLargestEdge_rad = 0.25, kSmallestEdge_rad = 0.01;

// How far from the projected middle of a short edge, seen face on, the drawn middle lies.
double deviation_px(const GlLens& lens, const Eigen::Vector3d& ray, const Eigen::Vector3d& across, double angle) {
  const Eigen::Vector3d a = ray + std::tan(angle / 2) * across, b = ray - std::tan(angle / 2) * across;
  Eigen::Vector2d pa, pb, middle;
  const CameraModel& camera = lens.camera();
  if (!camera.project(a, &pa) || !camera.project(b, &pb) || !camera.project(ray, &middle)) return 0;
  const double wa = lens.depth(a), wb = lens.depth(b);
  if (!(wa > 0 && wb > 0)) return 0;
  return ((pa * wa + pb * wb) / (wa + wb) - middle).norm();
}

}  // namespace

GlLens::GlLens(const CameraModel& camera) : camera_(camera) {
  find_limit();
  find_max_edges();
}

void GlLens::find_limit() {
  // The model's domain is a disc around the axis, whose radius it tells by what it projects.
  const bool fisheye = camera_.kind() == CameraModelKind::kannala_brandt;
  double low = 0, high = fisheye ? std::numbers::pi : 1e4;
  const auto inside = [&](double at) {
    Eigen::Vector2d pixel;
    return fisheye ? camera_.project({std::sin(at), 0, std::cos(at)}, &pixel) : camera_.project({at, 0, 1}, &pixel);
  };
  if (inside(high)) {
    low = high;
  } else {
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (low + high);
      (inside(middle) ? low : high) = middle;
    }
  }
  limit_ = fisheye ? low : low * low;
}

void GlLens::find_max_edges() {
  if (camera_.kind() == CameraModelKind::pinhole) return;
  constexpr int columns = 24, rows = 18, directions = 4, bins = 24;
  std::vector<std::pair<double, double>> samples;  // off-axis angle, longest edge
  double widest = 1e-3;
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column <= columns; ++column) {
      Eigen::Vector3d ray;
      const Eigen::Vector2d pixel((camera_.width() - 1.0) * column / columns, (camera_.height() - 1.0) * row / rows);
      if (!camera_.unproject(pixel, &ray)) continue;
      ray.normalize();
      const Eigen::Vector3d u = ray.unitOrthogonal(), v = ray.cross(u);
      double edge = kLargestEdge_rad;
      for (int k = 0; k < directions; ++k) {
        const double turn = std::numbers::pi * k / directions;
        const Eigen::Vector3d across = std::cos(turn) * u + std::sin(turn) * v;
        while (edge > kSmallestEdge_rad && deviation_px(*this, ray, across, edge) > kMaxDeviation_px) edge *= 0.9;
      }
      samples.emplace_back(std::acos(std::min(1.0, ray.z())), edge);
      widest = std::max(widest, samples.back().first);
    }
  }
  step_rad_ = widest / bins;
  max_edge_.assign(bins + 1, kLargestEdge_rad);
  for (const auto& [angle, edge] : samples) {
    double& bin = max_edge_[static_cast<std::size_t>(angle / step_rad_)];
    bin = std::min(bin, edge);
  }
  for (std::size_t i = 1; i < max_edge_.size(); ++i) max_edge_[i] = std::min(max_edge_[i], max_edge_[i - 1]);
}

double GlLens::max_edge_rad(double off_axis_rad) const {
  if (max_edge_.empty()) return std::numeric_limits<double>::infinity();
  const double bin = std::ceil(std::max(0.0, off_axis_rad) / step_rad_);
  return max_edge_[static_cast<std::size_t>(std::min(bin, static_cast<double>(max_edge_.size() - 1)))];
}

double GlLens::max_edge_rad(const Eigen::Vector3f& centre, float radius) const {
  const float distance = centre.norm();
  if (!(distance > radius)) return max_edge_rad(std::numbers::pi);
  return max_edge_rad(std::acos(std::clamp(centre.z() / distance, -1.0f, 1.0f)) + std::asin(radius / distance));
}

void GlLens::set_uniforms(const GlProgram& program) const {
  float d[8];
  std::transform(camera_.distortion().begin(), camera_.distortion().end(), d,
                 [](double value) { return static_cast<float>(value); });
  const auto pair = [&](const char* name, const Eigen::Vector2d& value) {
    gl().Uniform2f(program.uniform(name), static_cast<float>(value.x()), static_cast<float>(value.y()));
  };
  gl().Uniform1i(program.uniform("lens_kind"), static_cast<int>(camera_.kind()));
  pair("lens_focal", camera_.focal_px());
  pair("lens_centre", camera_.centre_px());
  pair("lens_size", {camera_.width(), camera_.height()});
  gl().Uniform1fv(program.uniform("lens_d"), 8, d);
  gl().Uniform1f(program.uniform("lens_limit"), static_cast<float>(limit_));
  gl().Uniform1f(program.uniform("near_plane"), kNearPlane_m);
}

}  // namespace parallax
