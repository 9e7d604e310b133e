// What the renderer's tests share: a picture drawn off-screen, and measuring in it.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "render/draw_list.h"
#include "render/gl_context.h"
#include "render/scene_renderer.h"

namespace parallax::testing {

// A context and a renderer of one size.
class OffscreenScene {
 public:
  OffscreenScene(int width, int height, const SceneRendererOptions& options = {})
      : width_(width), height_(height), context_(width, height), renderer_(options) {}

  cv::Mat3b draw(const DrawList& list) { return draw(list, {0, 0, width_, height_}); }
  cv::Mat3b draw(const DrawList& list, const Viewport& viewport) {
    renderer_.draw(list, viewport);
    return read_framebuffer(width_, height_);
  }
  SceneRenderer& renderer() { return renderer_; }

 private:
  int width_, height_;
  OffscreenContext context_;
  SceneRenderer renderer_;
};

// Nothing but black, seen from the origin along z.
inline DrawList empty_list(const CameraModel& camera) {
  DrawList list;
  list.camera = camera;
  list.background_colour = {0, 0, 0, 1};
  list.camera_from_world = RigidTransform();
  return list;
}

inline RigidTransform look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target,
                              const Eigen::Vector3d& up = Eigen::Vector3d::UnitZ()) {
  const Eigen::Vector3d z = (target - eye).normalized(), x = z.cross(up).normalized(), y = z.cross(x);
  Eigen::Matrix3d camera_from_world;
  camera_from_world.row(0) = x;
  camera_from_world.row(1) = y;
  camera_from_world.row(2) = z;
  return {camera_from_world, -camera_from_world * eye};
}

inline double linear_light(unsigned char value) {
  const double c = value / 255.0;
  return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
}

// Centre of gravity of the light (green) within `reach` pixels of a place; nothing where it is dark.
inline std::optional<Eigen::Vector2d> centroid(const cv::Mat3b& image, const Eigen::Vector2d& around, int reach) {
  const int cx = static_cast<int>(std::lround(around.x())), cy = static_cast<int>(std::lround(around.y()));
  double sum = 0;
  Eigen::Vector2d total = Eigen::Vector2d::Zero();
  for (int y = std::max(0, cy - reach); y <= std::min(image.rows - 1, cy + reach); ++y) {
    for (int x = std::max(0, cx - reach); x <= std::min(image.cols - 1, cx + reach); ++x) {
      const double light = linear_light(image(y, x)[1]);
      sum += light;
      total += light * Eigen::Vector2d(x, y);
    }
  }
  if (sum < 0.5) return std::nullopt;
  return total / sum;
}

}  // namespace parallax::testing
