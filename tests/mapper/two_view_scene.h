// Synthetic two-view problems with exact truth, for tests and benchmarks: a scene, two views of it, matches with noise
// and outliers. First camera at the origin.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "core/camera_model.h"
#include "core/se3.h"
#include "mapper/two_view.h"

namespace parallax::testing_support {

enum class TwoViewScene {
  planar,
  planar_with_clutter,
  general,
  forward,
  rotation_only,
  no_motion,
  approach_plane,
  random
};

struct TwoViewSettings {
  TwoViewScene scene = TwoViewScene::planar_with_clutter;
  int matches = 500;
  double noise_px = 0.5;   // standard deviation, each coordinate, each view
  double outliers = 0.25;  // part of the matches
  double clutter = 0.2;    // part of the points that stand off the plane
  double baseline = 0.1;   // metres
};

struct TwoViewProblem {
  std::vector<TwoViewMatch> matches;
  std::vector<std::uint8_t> outlier;
  std::vector<Eigen::Vector3d> points;  // metres, frame of view 1; of outliers too, before their match was spoilt
  RigidTransform second_from_first;     // metres
};

// Lenses that see 90 degrees across 640x480.
inline CameraModel wide_pinhole() {
  return {CameraModelKind::pinhole, 640, 480, Eigen::Vector2d(320, 320), Eigen::Vector2d(319.5, 239.5)};
}
inline CameraModel wide_fov() {
  return {CameraModelKind::fov, 640, 480, Eigen::Vector2d(384, 384), Eigen::Vector2d(318, 241), {0.9}, 1};
}

class TwoViewGenerator {
 public:
  explicit TwoViewGenerator(std::uint64_t seed) : rng_(seed) {}

  TwoViewProblem draw(const CameraModel& camera, const TwoViewSettings& s) {
    TwoViewProblem p;
    p.second_from_first.R = exp_so3(vector(0.15));
    const double turn = uniform(0, 2 * M_PI);
    Eigen::Vector3d centre(std::cos(turn), std::sin(turn), uniform(-0.3, 0.3));  // of camera 2
    Eigen::Vector3d normal(uniform(-0.6, 0.6), uniform(-0.9, 0.3), -1);
    switch (s.scene) {
      case TwoViewScene::forward:
        centre = Eigen::Vector3d(uniform(-0.15, 0.15), uniform(-0.15, 0.15), uniform(0, 1) < 0.5 ? 1 : -1);
        break;
      case TwoViewScene::approach_plane:
        centre = Eigen::Vector3d(uniform(-0.6, 0.6), uniform(-0.6, 0.6), uniform(0, 1) < 0.5 ? 1 : -1);
        break;
      case TwoViewScene::rotation_only:
        p.second_from_first.R = exp_so3(vector(1.0).normalized() * uniform(0.05, 0.25));
        centre.setZero();
        break;
      case TwoViewScene::no_motion:
        p.second_from_first.R.setIdentity();
        centre.setZero();
        break;
      default:
        break;
    }
    if (centre.norm() > 0) centre *= s.baseline / centre.norm();
    p.second_from_first.t = -(p.second_from_first.R * centre);
    normal.normalize();
    const double distance = uniform(0.5, 1.0);  // to the plane, along the optical axis

    std::normal_distribution<double> noise(0, s.noise_px);
    const auto noisy = [&](const Eigen::Vector2d& px) {
      return s.noise_px > 0 ? Eigen::Vector2d(px.x() + noise(rng_), px.y() + noise(rng_)) : px;
    };
    while (static_cast<int>(p.matches.size()) < s.matches) {
      const Eigen::Vector2d px(uniform(0, camera.width() - 1), uniform(0, camera.height() - 1));
      Eigen::Vector3d ray;
      if (!camera.unproject(px, &ray)) continue;
      double depth = normal.z() * distance / normal.dot(ray);
      if (!(depth > 0.1 && depth < 5)) continue;
      const bool off_plane = s.scene == TwoViewScene::planar_with_clutter && uniform(0, 1) < s.clutter;
      if (off_plane) depth *= uniform(0.65, 0.95);
      if (s.scene == TwoViewScene::general || s.scene == TwoViewScene::forward ||
          s.scene == TwoViewScene::rotation_only)
        depth = uniform(0.5, 1.5);
      const Eigen::Vector3d point = depth * ray;
      TwoViewMatch match;
      Eigen::Vector2d second;
      if (!camera.project(p.second_from_first * point, &second) || !camera.in_image(second)) continue;
      match.first = noisy(px);
      match.second = noisy(second);
      const bool outlier = s.scene == TwoViewScene::random || uniform(0, 1) < s.outliers;
      if (outlier) {
        // Half go anywhere, half to a near neighbour, as wrong patch matches do.
        match.second = s.scene == TwoViewScene::random || uniform(0, 1) < 0.5
                           ? Eigen::Vector2d(uniform(0, camera.width() - 1), uniform(0, camera.height() - 1))
                           : Eigen::Vector2d(second.x() + uniform(-40, 40), second.y() + uniform(-40, 40));
      }
      p.matches.push_back(match);
      p.outlier.push_back(outlier ? 1 : 0);
      p.points.push_back(point);
    }
    return p;
  }

  double uniform(double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(rng_); }
  Eigen::Vector3d vector(double size) { return {uniform(-size, size), uniform(-size, size), uniform(-size, size)}; }

 private:
  std::mt19937_64 rng_;
};

inline double rotation_error_deg(const RigidTransform& a, const RigidTransform& b) {
  return log_so3(a.R * b.R.transpose()).norm() * 180 / M_PI;
}
inline double direction_error_deg(const RigidTransform& a, const RigidTransform& b) {
  return std::atan2(a.t.cross(b.t).norm(), a.t.dot(b.t)) * 180 / M_PI;
}

}  // namespace parallax::testing_support
