// A made-up window with exact truth: a stereo camera that walks forward and turns among points of a room, or of a wide
// view, or at infinity.
#pragma once

#include <cmath>
#include <limits>
#include <random>

#include "solver/homogeneous_point.h"
#include "solver/window_smoothing.h"

namespace parallax::testing {

struct WindowScene {
  int poses = 8, points = 120;
  double nearest_m = 2, farthest_m = 10;
  double noise_px = 0, outliers = 0, mono = 0;  // standard deviation; parts of the observations
  double infinite = 0;                          // part of the points
  double seen = 1;                              // part of what is in view that is measured
  double start_m = 0.02, start_rad = 0.01;      // how far the start is from the truth
  double start_point = 0.01;                    // tangent of the sphere
};

struct SyntheticWindow {
  WindowProblem truth, start;
  std::vector<std::uint8_t> outlier;  // of the observations
};

inline SyntheticWindow make_window(const WindowScene& scene, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal;
  const auto uniform = [&](double from, double to) { return std::uniform_real_distribution<double>(from, to)(rng); };
  const auto vector = [&](double size) {
    return Eigen::Vector3d(size * normal(rng), size * normal(rng), size * normal(rng));
  };
  SyntheticWindow out;
  WindowProblem& w = out.truth;
  w.camera = {512, 384, {400, 402}, {255.5, 191.5}, 0.119};
  for (int i = 0; i < scene.poses; ++i) {
    const RigidTransform window_from_camera(exp_so3({0.01 * std::sin(i), 0.03 * i, 0.02 * std::cos(2.0 * i)}),
                                            {0.05 * std::sin(1.3 * i), 0.03 * std::cos(i), 0.2 * i});
    w.poses.push_back(window_from_camera.inverse());
    w.pose_fixed.push_back(i == 0);
  }
  while (static_cast<int>(w.points.size()) < scene.points) {
    const auto pose = std::uniform_int_distribution<std::size_t>(0, w.poses.size() - 1)(rng);
    const double depth = scene.nearest_m * std::pow(scene.farthest_m / scene.nearest_m, uniform(0, 1));
    const Eigen::Vector3d ray = w.camera.ray({uniform(5, 506), uniform(5, 378)});
    const RigidTransform back = w.poses[pose].inverse();
    Eigen::Vector4d p;
    if (uniform(0, 1) < scene.infinite) {
      p << back.R * ray, 0;
    } else {
      p << back * Eigen::Vector3d(depth * ray), 1;
    }
    w.points.push_back(p.normalized());
    for (std::size_t i = 0; i < w.poses.size(); ++i) {
      Eigen::Vector3d pixel;
      if (camera_point(w.poses[i], w.points.back()).z() < 0.02 ||
          !project_homogeneous(w.camera, w.poses[i], w.points.back(), &pixel) ||
          !w.camera.in_image({pixel.x(), pixel.z()}) || (i != pose && uniform(0, 1) > scene.seen))
        continue;
      pixel += vector(scene.noise_px);
      out.outlier.push_back(uniform(0, 1) < scene.outliers);
      if (out.outlier.back()) pixel += Eigen::Vector3d(uniform(15, 40), uniform(15, 40), uniform(-40, -15));
      if (uniform(0, 1) < scene.mono) pixel.y() = std::numeric_limits<double>::quiet_NaN();
      w.observations.push_back({static_cast<int>(i), static_cast<int>(w.points.size()) - 1, pixel,
                                scene.noise_px > 0 ? scene.noise_px : 0.5});
    }
  }
  out.start = w;
  for (std::size_t i = 1; i < w.poses.size(); ++i) {
    Vector6d d;
    d << vector(scene.start_m), vector(scene.start_rad);
    out.start.poses[i] = move_pose(d, w.poses[i]);
  }
  for (Eigen::Vector4d& p : out.start.points) p = move_on_sphere(p, vector(scene.start_point));
  return out;
}

// Largest distance of the cameras' centres and angle between two windows' poses.
inline double pose_difference(const WindowProblem& a, const WindowProblem& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.poses.size(); ++i) {
    const RigidTransform d = a.poses[i].inverse() * b.poses[i];
    largest = std::max({largest, d.t.norm(), d.angle()});
  }
  return largest;
}

}  // namespace parallax::testing
