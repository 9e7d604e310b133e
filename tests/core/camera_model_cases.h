// The lenses the camera model tests run over: mild, strong and limiting cases of each model.
#pragma once

#include <string>
#include <vector>

#include "core/camera_model.h"

namespace parallax::testing {

struct CameraCase {
  std::string name;
  CameraModel camera;
};

inline std::vector<CameraCase> camera_cases() {
  using enum CameraModelKind;
  return {
      {"pinhole", CameraModel(pinhole, 640, 480, {522, 520}, {320, 240})},
      {"pinhole_wide", CameraModel(pinhole, 1920, 1080, {500, 510}, {950, 530})},
      {"radtan4_wide_desk",
       CameraModel(radtan, 752, 480, {420.506712, 420.610940}, {355.208298, 250.336787}, {-0.296609, 0.080818}, 4)},
      {"radtan4_euroc", CameraModel(radtan, 752, 480, {458.654, 457.296}, {367.215, 248.375},
                                    {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05}, 4)},
      {"radtan4_pincushion", CameraModel(radtan, 640, 480, {400, 410}, {300, 250}, {0.3, 0.1, 0.002, -0.001}, 4)},
      {"radtan5_tum", CameraModel(radtan, 640, 480, {517.306408, 516.469215}, {318.643040, 255.313989},
                                  {0.262383, -0.953104, -0.005358, 0.002628, 1.163314}, 5)},
      {"radtan5_strong_tangential",
       CameraModel(radtan, 640, 480, {535.9, 535.9}, {342.3, 235.6}, {-0.266, -0.0386, 0.02, -0.015, 0.2384}, 5)},
      {"radtan8_depth_camera", CameraModel(radtan, 1280, 720, {607, 606.5}, {638.4, 365.2},
                                           {0.4526, -2.549, 0.000713, -0.000322, 1.5036, 0.3319, -2.3758, 1.4302}, 8)},
      {"kannala_brandt_mild",
       CameraModel(kannala_brandt, 640, 480, {330, 331}, {322, 238}, {-0.0132, 0.0207, -0.0127, 0.00257}, 4)},
      {"kannala_brandt_beyond_90", CameraModel(kannala_brandt, 512, 512, {190.978477, 190.973307},
                                               {254.931706, 256.897442}, {0.00348, 0.000715, -0.00205, 0.000203}, 4)},
      {"kannala_brandt_strong", CameraModel(kannala_brandt, 800, 600, {300, 310}, {410, 290}, {-0.1, 0.01, 0, 0}, 4)},
      {"fov_desk", CameraModel(fov, 640, 480, {375, 376}, {322.3, 237.1}, {0.9}, 1)},
      {"fov_strong", CameraModel(fov, 640, 480, {280, 285}, {310, 250}, {1.35}, 1)},
      {"fov_nearly_none", CameraModel(fov, 640, 480, {375, 376}, {322.3, 237.1}, {1e-12}, 1)},
      {"fov_none", CameraModel(fov, 640, 480, {375, 376}, {322.3, 237.1}, {0.0}, 1)},
  };
}

// Points of the camera frame whose pixels cover the image and a margin around it, at depths from near to far; for
// Kannala-Brandt also points beside and behind the image plane.
inline std::vector<Eigen::Vector3d> points_over_image(const CameraModel& camera, int steps) {
  std::vector<Eigen::Vector3d> points;
  const double depths[] = {0.05, 1.0, 30.0};
  for (int row = 0; row <= steps; ++row) {
    for (int column = 0; column <= steps; ++column) {
      const Eigen::Vector2d pixel(-10 + (camera.width() + 20.0) * column / steps,
                                  -10 + (camera.height() + 20.0) * row / steps);
      Eigen::Vector3d ray;
      if (camera.unproject(pixel, &ray) && ray.norm() < 500) points.push_back(ray * depths[(row + column) % 3]);
    }
  }
  points.push_back({0, 0, 1});
  points.push_back({1e-9, 0, 1});
  points.push_back({0, -1e-5, 2});
  points.push_back({1e-3, 1e-3, 1});
  if (camera.kind() == CameraModelKind::kannala_brandt) {
    for (const Eigen::Vector3d& p :
         {Eigen::Vector3d(1, 0.2, 0), Eigen::Vector3d(-1, 0.5, -0.2), Eigen::Vector3d(0.3, 2, -0.5)}) {
      Eigen::Vector2d pixel;
      if (camera.project(p, &pixel)) points.push_back(p);
    }
  }
  return points;
}

}  // namespace parallax::testing
