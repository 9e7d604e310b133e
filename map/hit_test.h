// What lies under a pixel: the map's planes and points, hit by the ray through it.
//
// Pure functions; thread-safe. Frames: world, metres. Pixels: level 0.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "core/camera_model.h"
#include "core/se3.h"
#include "map/tracking_snapshot.h"

namespace parallax {

struct Ray {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  // unit length
  Eigen::Vector3d at(double distance) const { return origin + distance * direction; }
};

// The ray through a pixel; nothing where the lens has none.
std::optional<Ray> pixel_ray(const CameraModel& camera, const RigidTransform& camera_from_world,
                             const Eigen::Vector2d& pixel);
// The middle of the camera's view: the ray of camera-frame (0, 0, 1).
Ray optical_axis(const RigidTransform& camera_from_world);

enum class HitKind { plane, point };

struct Hit {
  HitKind kind = HitKind::plane;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // unit, towards the viewer
  double distance_m = 0;                              // from the ray's origin
  int plane = -1;                                     // index of the plane that was hit
  PointId point;                                      // the point that was hit
};

struct HitOptions {
  double point_radius_px = 8;  // a point further from the pixel is not under it
  double extent_factor = 1.5;  // a plane ends at so many times its extent_m from its origin, along each axis
  // A point is taken rather than the plane behind it when it is nearer by this share of the plane's distance: points on
  // the plane itself lie within the noise of it, and there the plane is more exact.
  double in_front = 0.04;
};

// The dominant plane first, then the others.
std::vector<Plane> planes_of(const TrackingSnapshot& map);

// The nearest plane in front of the ray's origin and within its extent. A plane seen from below counts too.
std::optional<Hit> hit_plane(const Ray& ray, std::span<const Plane> planes, const HitOptions& options = {});

// The map point nearest to the pixel on the screen, within point_radius_px; of two within a pixel of each other, the
// one nearer to the camera.
std::optional<Hit> hit_point(const CameraModel& camera, const RigidTransform& camera_from_world,
                             const Eigen::Vector2d& pixel, const TrackingSnapshot& map, const HitOptions& options = {});

// Both: the plane under the pixel, or a point well in front of it, or a point where no plane is hit.
std::optional<Hit> hit_test(const CameraModel& camera, const RigidTransform& camera_from_world,
                            const Eigen::Vector2d& pixel, const TrackingSnapshot& map, const HitOptions& options = {});

}  // namespace parallax
