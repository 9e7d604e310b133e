// A rectified pair of cameras (MS §3.1): two equal pinholes side by side, rows aligned, the right one `baseline_m`
// along the left one's x axis. The left camera's frame is the rig's. A stereo measurement is (u_left, u_right, v), in
// pixels of level 0, as z of MS Eq. 1; u_right is NaN where the right camera did not see the point. A plain value.
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace parallax {

struct StereoCamera {
  int width = 0, height = 0;
  Eigen::Vector2d focal_px{1, 1}, centre_px{0, 0};
  double baseline_m = 0.1;

  double disparity_px(double depth_m) const { return focal_px.x() * baseline_m / depth_m; }
  double depth_m(double disparity) const { return focal_px.x() * baseline_m / disparity; }

  // Of a point in the left camera's frame; false behind the camera, and `pixel` is left as it was.
  bool project(const Eigen::Vector3d& point, Eigen::Vector3d* pixel) const {
    if (!(point.z() > 1e-9)) return false;
    const double inverse_depth = 1 / point.z(), u = focal_px.x() * point.x() * inverse_depth + centre_px.x();
    *pixel = {u, u - focal_px.x() * baseline_m * inverse_depth,
              focal_px.y() * point.y() * inverse_depth + centre_px.y()};
    return true;
  }

  // The ray (x, y, 1) of a pixel of the left image.
  Eigen::Vector3d ray(const Eigen::Vector2d& left_px) const {
    return {(left_px.x() - centre_px.x()) / focal_px.x(), (left_px.y() - centre_px.y()) / focal_px.y(), 1};
  }

  // The point of a measurement, in the left camera's frame, homogeneous and of unit norm: at infinity (w = 0) without a
  // right measurement or a positive disparity.
  Eigen::Vector4d triangulate(const Eigen::Vector3d& pixel) const {
    const double disparity = pixel.x() - pixel.y();
    Eigen::Vector4d point;
    point.head<3>() = ray({pixel.x(), pixel.z()});
    point.w() = disparity > 0 ? disparity / (focal_px.x() * baseline_m) : 0;
    return point.normalized();
  }

  bool in_image(const Eigen::Vector2d& px, double border_px = 0) const {
    return px.x() >= border_px && px.y() >= border_px && px.x() <= width - 1 - border_px &&
           px.y() <= height - 1 - border_px;
  }

  bool operator==(const StereoCamera&) const = default;
};

}  // namespace parallax
