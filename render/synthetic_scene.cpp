#include "render/synthetic_scene.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <map>
#include <mutex>
#include <numbers>
#include <tuple>
#include <utility>

#include "core/check.h"
#include "render/synthetic_scenes.h"

namespace parallax {

using Eigen::Vector2d;
using Eigen::Vector3d;

int SyntheticScene::add_texture(const cv::Mat3b& picture) {
  textures_.push_back(std::make_shared<const Texture>(picture));
  return static_cast<int>(textures_.size()) - 1;
}

int SyntheticScene::add(const Surface& surface) {
  PARALLAX_CHECK(surface.texture >= 0 && surface.texture < texture_count(), "a surface needs a picture of this scene");
  surfaces_.push_back(surface);
  return static_cast<int>(surfaces_.size()) - 1;
}

int SyntheticScene::add_rectangle(const Vector3d& origin, const Vector3d& u, const Vector3d& v, int texture,
                                  bool two_sided) {
  return add({SurfaceShape::rectangle, origin, u, v, texture, two_sided});
}

void SyntheticScene::add_box(const Vector2d& centre, double bottom, const Vector3d& size, double yaw, int top_texture,
                             int front_texture, int side_texture) {
  const Vector3d ex(std::cos(yaw), std::sin(yaw), 0), ey(-std::sin(yaw), std::cos(yaw), 0);
  const Vector3d x = ex * size.x(), y = ey * size.y(), down(0, 0, -size.z());
  const Vector3d middle(centre.x(), centre.y(), bottom + size.z());
  const Vector3d near_left = middle - x / 2 - y / 2, near_right = middle + x / 2 - y / 2;
  const Vector3d far_left = middle - x / 2 + y / 2, far_right = middle + x / 2 + y / 2;
  add_rectangle(far_left, x, -y, top_texture);
  add_rectangle(near_left, x, down, front_texture);
  add_rectangle(far_right, -x, down, front_texture);
  add_rectangle(near_right, y, down, side_texture);
  add_rectangle(far_left, -y, down, side_texture);
}

void SyntheticScene::add_can(const Vector2d& centre, double bottom, double radius, double height, double yaw,
                             int mantle_texture, int lid_texture, bool open) {
  const Vector3d top(centre.x(), centre.y(), bottom + height);
  add({SurfaceShape::cylinder, top, Vector3d(std::cos(yaw), std::sin(yaw), 0) * radius, Vector3d(0, 0, -height),
       mantle_texture, true});
  const double level = open ? height * 0.3 : 0.0;
  add({SurfaceShape::disc, top + Vector3d(-radius, radius, -level), Vector3d(2 * radius, 0, 0),
       Vector3d(0, -2 * radius, 0), lid_texture, false});
}

std::optional<SurfaceHit> SyntheticScene::intersect(const Surface& surface, const Vector3d& from,
                                                    const Vector3d& direction) {
  SurfaceHit hit;
  if (surface.shape == SurfaceShape::cylinder) {
    const double radius = surface.u.norm(), height = surface.v.norm();
    const Vector3d e1 = surface.u / radius, axis = surface.v / height, e2 = e1.cross(axis);
    const Vector3d o = from - surface.origin;
    const double o1 = o.dot(e1), o2 = o.dot(e2), d1 = direction.dot(e1), d2 = direction.dot(e2);
    const double a = d1 * d1 + d2 * d2, b = o1 * d1 + o2 * d2, c = o1 * o1 + o2 * o2 - radius * radius;
    const double discriminant = b * b - a * c;
    if (discriminant < 0 || a == 0) return std::nullopt;
    for (const double sign : {-1.0, 1.0}) {
      hit.distance = (-b + sign * std::sqrt(discriminant)) / a;
      const double t = (o.dot(axis) + hit.distance * direction.dot(axis)) / height;
      if (hit.distance <= 0 || t < 0 || t > 1) continue;
      const double turn = std::atan2(o2 + hit.distance * d2, o1 + hit.distance * d1) / (2 * std::numbers::pi);
      hit.texture_st = {turn < 0 ? turn + 1 : turn, t};
      return hit;
    }
    return std::nullopt;
  }
  const Vector3d n = surface.u.cross(surface.v);
  const double towards = n.dot(direction);
  if (towards == 0 || (towards < 0 && !surface.two_sided)) return std::nullopt;
  hit.distance = n.dot(surface.origin - from) / towards;
  if (hit.distance <= 0) return std::nullopt;
  const Vector3d p = from + hit.distance * direction - surface.origin;
  const double s = p.cross(surface.v).dot(n) / n.squaredNorm(), t = surface.u.cross(p).dot(n) / n.squaredNorm();
  if (s < 0 || s > 1 || t < 0 || t > 1) return std::nullopt;
  if (surface.shape == SurfaceShape::disc && (s - 0.5) * (s - 0.5) + (t - 0.5) * (t - 0.5) > 0.25) return std::nullopt;
  hit.texture_st = {s, t};
  return hit;
}

std::optional<SurfaceHit> SyntheticScene::cast(const Vector3d& from, const Vector3d& direction) const {
  std::optional<SurfaceHit> best;
  for (std::size_t i = 0; i < surfaces_.size(); ++i) {
    auto hit = intersect(surfaces_[i], from, direction);
    if (!hit || (best && best->distance <= hit->distance)) continue;
    hit->surface = static_cast<int>(i);
    best = hit;
  }
  return best;
}

Vector3d SyntheticScene::point_on(const Surface& surface, double s, double t) {
  if (surface.shape != SurfaceShape::cylinder) return surface.origin + s * surface.u + t * surface.v;
  const Vector3d e2 = surface.u.cross(surface.v.normalized());
  const double angle = 2 * std::numbers::pi * s;
  return surface.origin + t * surface.v + std::cos(angle) * surface.u + std::sin(angle) * e2;
}

double SyntheticScene::shading(const Vector3d& normal) {
  static const Vector3d lamp = Vector3d(-0.35, -0.5, 0.8).normalized();
  return 0.62 + 0.08 * normal.z() + 0.34 * std::max(0.0, normal.dot(lamp));
}

std::shared_ptr<const SyntheticScene> synthetic_scene(const std::string& name, std::uint64_t seed, int day) {
  static std::mutex mutex;
  static std::map<std::tuple<std::string, std::uint64_t, int>, std::weak_ptr<const SyntheticScene>> scenes;
  const std::scoped_lock lock(mutex);
  auto& slot = scenes[{name, seed, day}];
  auto scene = slot.lock();
  if (!scene) {
    scene = std::make_shared<const SyntheticScene>(build_synthetic_scene(name, seed, day));
    slot = scene;
  }
  return scene;
}

}  // namespace parallax
