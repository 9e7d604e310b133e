// Sessions made up for tests: small images, features, constraints, all from a seed.
#pragma once

#include <random>
#include <string>
#include <vector>

#include "sessions/session_database.h"

namespace parallax::test {

inline StereoCamera fabricated_camera() {
  StereoCamera camera;
  camera.width = 64;
  camera.height = 48;
  camera.focal_px = {60, 61};
  camera.centre_px = {31.5, 23.25};
  camera.baseline_m = 0.12;
  return camera;
}

inline SessionStart fabricated_start(const std::string& name) {
  SessionStart out;
  out.name = name;
  out.source = "made of " + name + ", \"quoted\" \xc3\xa4";
  out.camera = fabricated_camera();
  out.rectified_from_left = {exp_so3({0.01, -0.02, 0.005}), Eigen::Vector3d(0, -0.0, 0)};
  out.frames_per_second = 20;
  return out;
}

// Every value of its own, to the last bit.
class SessionFabricator {
 public:
  explicit SessionFabricator(std::uint64_t seed) : rng_(seed) {}

  double number() { return std::normal_distribution<double>()(rng_); }
  RigidTransform transform(double size = 1) {
    return {exp_so3(Eigen::Vector3d(number(), number(), number()) * 0.3 * size),
            Eigen::Vector3d(number(), number(), number()) * size};
  }
  Matrix6d covariance() {
    Matrix6d root;
    for (int i = 0; i < 36; ++i) root(i / 6, i % 6) = number();
    return 1e-4 * (root * root.transpose() + Matrix6d::Identity());
  }
  GreyImage image(const StereoCamera& camera = fabricated_camera()) {
    GreyImage out(camera.height, camera.width);
    for (int y = 0; y < out.rows; ++y)
      for (int x = 0; x < out.cols; ++x)
        out(y, x) = static_cast<std::uint8_t>(x + 2 * y + static_cast<int>(rng_() % 9));
    return out;
  }
  SessionFeatures features(int count) {
    SessionFeatures out;
    for (int i = 0; i < count; ++i) {
      PlaceFeature f;
      f.pixel = Eigen::Vector2d(31 + 9 * number(), 23 + 9 * number()).cast<float>();
      f.level = static_cast<int>(rng_() % kPyramidLevels);
      for (auto& bits : f.descriptor.bits) bits = rng_();
      out.features.push_back(f);
      out.right_px.push_back(i % 3 ? f.pixel.x() - 2.25F : std::numeric_limits<float>::quiet_NaN());
    }
    return out;
  }
  SessionBatch::NewKeyframe keyframe(int index, bool images = true, int n_features = 12) {
    SessionBatch::NewKeyframe out;
    out.keyframe.index = index;
    out.keyframe.frame = 5 * index;
    out.keyframe.time = Timestamp(1'000'000'007LL * index + 17);
    out.keyframe.after_failure = index == 3;
    out.keyframe.session_from_camera = transform();
    if (images) {
      out.keyframe.left = image();
      out.keyframe.right = image();
    }
    out.features = features(n_features);
    return out;
  }
  // Constraints first -> first + 1 -> ... -> last, with a few points each.
  SessionWindow window(int first, int last, int n_points = 3) {
    SessionWindow out;
    for (int k = first; k < last; ++k) {
      StereoConstraint c;
      c.from = k;
      c.to = k + 1;
      c.from_from_to = transform(0.2);
      c.covariance = covariance();
      c.after_failure = k + 1 == 3;
      out.constraints.push_back(c);
      for (int i = 0; i < n_points; ++i) {
        SessionPoint p;
        p.keyframe = k;
        p.camera = Eigen::Vector3d(number(), number(), 4 + 0.5 * number()).cast<float>();
        p.poses = 2 + i;
        out.points.push_back(p);
      }
    }
    return out;
  }
  Encounter encounter(std::int64_t id, const PoseKey& found, const PoseKey& query, EncounterState state) {
    Encounter out;
    out.id = id;
    out.found = found;
    out.query = query;
    out.found_from_query = transform();
    out.covariance = covariance();
    out.bow = 0.3 + 0.01 * number();
    if (id % 2) out.crf_near = 1 + 0.1 * number();
    out.matches = 60;
    out.inliers = 31;
    out.state = state;
    return out;
  }
  // A session of so many keyframes, all in one window.
  SessionBatch batch(int session, int keyframes, bool images = true) {
    SessionBatch out;
    out.session = session;
    for (int i = 0; i < keyframes; ++i) out.keyframes.push_back(keyframe(i, images));
    if (keyframes > 1) out.windows.push_back(window(0, keyframes - 1));
    return out;
  }

 private:
  std::mt19937_64 rng_;
};

}  // namespace parallax::test
