#include "map/hit_test.h"

#include <cmath>

namespace parallax {
namespace {

// A ray closer to the plane's own direction than this (sine of the angle) has no certain place on it.
constexpr double kGrazing = 1e-4;
// Nearer than this to the camera nothing is hit: it could not be in focus.
constexpr double kNearest_m = 1e-4;
// Points this close to each other on the screen are told apart by depth.
constexpr double kSamePlace_px = 1.0;
// Planes whose poses differ by less are one plane, kept in two places.
constexpr double kSamePlane = 1e-9;

}  // namespace

std::optional<Ray> pixel_ray(const CameraModel& camera, const RigidTransform& camera_from_world,
                             const Eigen::Vector2d& pixel) {
  Eigen::Vector3d in_camera;
  if (!pixel.allFinite() || !camera.unproject(pixel, &in_camera)) return std::nullopt;
  const RigidTransform world_from_camera = camera_from_world.inverse();
  return Ray{world_from_camera.t, (world_from_camera.R * in_camera).normalized()};
}

Ray optical_axis(const RigidTransform& camera_from_world) {
  const RigidTransform world_from_camera = camera_from_world.inverse();
  return {world_from_camera.t, world_from_camera.R.col(2)};
}

std::optional<Hit> hit_plane(const Ray& ray, std::span<const Plane> planes, const HitOptions& options) {
  std::optional<Hit> best;
  for (std::size_t i = 0; i < planes.size(); ++i) {
    const RigidTransform plane_from_world = planes[i].world_from_plane.inverse();
    const Eigen::Vector3d origin = plane_from_world * ray.origin, direction = plane_from_world.R * ray.direction;
    if (std::abs(direction.z()) < kGrazing) continue;
    const double distance = -origin.z() / direction.z();
    if (!(distance > kNearest_m) || (best && distance >= best->distance_m)) continue;
    const Eigen::Vector3d at = origin + distance * direction;
    if (at.head<2>().cwiseAbs().maxCoeff() > options.extent_factor * planes[i].extent_m) continue;
    Hit hit;
    hit.kind = HitKind::plane;
    hit.position = ray.at(distance);
    hit.normal = planes[i].world_from_plane.R.col(2) * (direction.z() < 0 ? 1 : -1);
    hit.distance_m = distance;
    hit.plane = static_cast<int>(i);
    best = hit;
  }
  return best;
}

std::optional<Hit> hit_point(const CameraModel& camera, const RigidTransform& camera_from_world,
                             const Eigen::Vector2d& pixel, const TrackingSnapshot& map, const HitOptions& options) {
  if (!pixel.allFinite()) return std::nullopt;
  int best = -1;
  double best_px = options.point_radius_px, best_depth = 0;
  for (int i = 0; i < map.size(); ++i) {
    const Eigen::Vector3d p = camera_from_world * map.position[static_cast<std::size_t>(i)];
    Eigen::Vector2d at;
    if (p.z() < kNearest_m || !camera.project(p, &at)) continue;
    const double px = (at - pixel).norm();
    if (px > options.point_radius_px) continue;
    const bool same_place = best >= 0 && std::abs(px - best_px) < kSamePlace_px;
    if (best < 0 || (same_place ? p.z() < best_depth : px < best_px)) {
      best = i;
      best_px = px;
      best_depth = p.z();
    }
  }
  if (best < 0) return std::nullopt;
  const auto row = static_cast<std::size_t>(best);
  const Eigen::Vector3d centre = camera_from_world.inverse().t;
  Hit hit;
  hit.kind = HitKind::point;
  hit.position = map.position[row];
  hit.distance_m = (hit.position - centre).norm();
  hit.point = map.id[row];
  const Eigen::Vector3d normal(map.nx[row], map.ny[row], map.nz[row]);
  const Eigen::Vector3d to_viewer = (centre - hit.position).normalized();
  hit.normal = normal.norm() > 0.5 ? normal.normalized() : to_viewer;
  if (hit.normal.dot(to_viewer) < 0) hit.normal = -hit.normal;
  return hit;
}

std::optional<Hit> hit_test(const CameraModel& camera, const RigidTransform& camera_from_world,
                            const Eigen::Vector2d& pixel, const TrackingSnapshot& map, const HitOptions& options) {
  const std::optional<Hit> point = hit_point(camera, camera_from_world, pixel, map, options);
  const std::optional<Ray> ray = pixel_ray(camera, camera_from_world, pixel);
  const std::vector<Plane> planes = planes_of(map);
  const std::optional<Hit> plane = ray ? hit_plane(*ray, planes, options) : std::nullopt;
  if (!plane) return point;
  if (point && point->distance_m < plane->distance_m * (1 - options.in_front)) return point;
  return plane;
}

std::vector<Plane> planes_of(const TrackingSnapshot& map) {
  std::vector<Plane> out;
  if (map.plane) out.push_back(*map.plane);
  for (const Plane& plane : map.planes) {
    const bool dominant = map.plane && (map.plane->world_from_plane.t - plane.world_from_plane.t).norm() < kSamePlane &&
                          (map.plane->world_from_plane.R - plane.world_from_plane.R).norm() < kSamePlane;
    if (!dominant) out.push_back(plane);
  }
  return out;
}

}  // namespace parallax
