// Scenes of made-up worlds for tests of matching: points with random descriptors, seen by a stereo pair with noise.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <random>
#include <vector>

#include "core/se3.h"
#include "core/stereo_camera.h"
#include "place/stereo_scene.h"

namespace parallax::testing {

inline StereoCamera made_camera() {
  StereoCamera camera;
  camera.width = 512;
  camera.height = 384;
  camera.focal_px = {400, 400};
  camera.centre_px = {255.5, 191.5};
  camera.baseline_m = 0.12;
  return camera;
}

struct MadeWorld {
  struct Point {
    Eigen::Vector3d at;
    BinaryDescriptor descriptor;
  };
  std::vector<Point> points;
};

inline BinaryDescriptor made_descriptor(std::mt19937_64* rng) {
  BinaryDescriptor out;
  for (auto& word : out.bits) word = (*rng)();
  return out;
}

inline double made_uniform(double low, double high, std::mt19937_64* rng) {
  return low + (high - low) * static_cast<double>((*rng)() >> 11U) / 9007199254740992.0;
}

inline double made_gaussian(std::mt19937_64* rng) {
  return std::sqrt(-2 * std::log(made_uniform(1e-12, 1, rng))) * std::cos(2 * M_PI * made_uniform(0, 1, rng));
}

// Points in a box from `low` to `high`.
inline void add_made_points(const Eigen::Vector3d& low, const Eigen::Vector3d& high, int count, std::mt19937_64* rng,
                            MadeWorld* world) {
  for (int i = 0; i < count; ++i) {
    MadeWorld::Point point;
    for (int k = 0; k < 3; ++k) point.at[k] = made_uniform(low[k], high[k], rng);
    point.descriptor = made_descriptor(rng);
    world->points.push_back(point);
  }
}

struct MadeView {
  double noise_px = 0.4, disparity_noise_px = 0.15;
  int noise_bits = 14;
  double missed = 0.3;  // share of the points in view that are not found
  int clutter = 40;     // features of nothing that stays
};

// Features and right_px; trees, points and bag are made by complete_stereo_scene(). `of_point` gets the world's row of
// each feature, -1 for clutter.
inline StereoScene made_scene(const MadeWorld& world, const RigidTransform& camera_from_world, const MadeView& view,
                              std::mt19937_64* rng, std::vector<int>* of_point = nullptr) {
  const StereoCamera camera = made_camera();
  StereoScene scene;
  if (of_point != nullptr) of_point->clear();
  const auto add = [&](const Eigen::Vector3d& pixel, const BinaryDescriptor& descriptor, int row) {
    PlaceFeature feature;
    feature.pixel = Eigen::Vector2d(pixel.x(), pixel.z()).cast<float>();
    feature.descriptor = descriptor;
    scene.features.push_back(feature);
    scene.right_px.push_back(static_cast<float>(pixel.y()));
    if (of_point != nullptr) of_point->push_back(row);
  };
  for (std::size_t i = 0; i < world.points.size(); ++i) {
    Eigen::Vector3d pixel;
    if (!camera.project(camera_from_world * world.points[i].at, &pixel) ||
        !camera.in_image({pixel.x(), pixel.z()}, kDescriptorBorder) || made_uniform(0, 1, rng) < view.missed)
      continue;
    const double du = view.noise_px * made_gaussian(rng), dv = view.noise_px * made_gaussian(rng);
    pixel += Eigen::Vector3d(du, du + view.disparity_noise_px * made_gaussian(rng), dv);
    BinaryDescriptor descriptor = world.points[i].descriptor;
    for (int k = 0; k < view.noise_bits; ++k) descriptor.bits[(*rng)() % 4] ^= std::uint64_t{1} << ((*rng)() % 64);
    add(pixel, descriptor, static_cast<int>(i));
  }
  for (int i = 0; i < view.clutter; ++i) {
    const double u = made_uniform(20, 490, rng);
    add({u, i % 4 == 0 ? NAN : u - made_uniform(3, 20, rng), made_uniform(20, 360, rng)}, made_descriptor(rng), -1);
  }
  return scene;
}

}  // namespace parallax::testing
