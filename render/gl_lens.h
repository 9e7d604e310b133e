// A camera model as the shaders want it (assets/shaders/lens.glsl), and how finely things must be cut for it: straight
// edges are drawn straight, so they have to be short where the lens bends them. Internal to render/.
#pragma once

#include <vector>

#include "core/camera_model.h"
#include "render/gl_objects.h"

namespace parallax {

// Things nearer than this are cut off; depth has no far end. Metres.
inline constexpr float kNearPlane_m = 0.005f;

class GlLens {
 public:
  explicit GlLens(const CameraModel& camera);

  const CameraModel& camera() const { return camera_; }
  // What a straight edge may subtend, seen from the camera, and be drawn within 0.25 px of where the lens puts it
  // (every point of it, so that textures stay in place too), when it lies within off_axis_rad of the axis. Infinite for
  // a pinhole. Beyond the image's corners: as in them.
  double max_edge_rad(double off_axis_rad) const;
  // The same for a ball in the camera frame.
  double max_edge_rad(const Eigen::Vector3f& centre, float radius) const;
  // The w of lens.glsl: of a pinhole the depth, else the distance.
  double depth(const Eigen::Vector3d& point) const {
    return camera_.kind() == CameraModelKind::pinhole ? point.z() : point.norm();
  }
  // Whether things beside the camera, 90 degrees off the axis, end within the image.
  bool sees_to_image_plane() const { return camera_.kind() == CameraModelKind::fov; }
  void set_uniforms(const GlProgram& program) const;

 private:
  void find_limit();
  void find_max_edges();

  CameraModel camera_;
  double limit_ = 0;              // as lens_limit
  std::vector<double> max_edge_;  // by off-axis angle, from 0 in steps of step_rad_; falls
  double step_rad_ = 1;
};

}  // namespace parallax
