// A made-up map with exact truth: a camera that wanders over a cluttered desk (or a row of desks), points seen by some
// ten keyframes each. For tests and benchmarks of the solver.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "solver/bundle_adjustment.h"

namespace parallax::testing {

struct SyntheticBundleOptions {
  int keyframes = 12;
  int points = 300;
  double views = 10;          // mean number of keyframes that see a point
  double noise_px = 0;        // added to every pixel, times its sigma
  double outliers = 0;        // part of the observations that are wrong by 20 to 80 px
  double pose_error = 0.01;   // metres and radians / 2 of the start
  double point_error = 0.02;  // metres
  int fixed = 1;              // the first so many keyframes are fixed, and start at the truth
  unsigned seed = 1;
  CameraModel camera{CameraModelKind::radtan, 640, 480, {500, 505}, {320, 238}, {-0.1, 0.05, 1e-3, -5e-4}, 4};
};

struct SyntheticBundle {
  BundleProblem problem;              // the start
  std::vector<RigidTransform> poses;  // the truth
  std::vector<Eigen::Vector3d> points;
  std::vector<std::uint8_t> outlier;  // of the observations
};

inline SyntheticBundle make_synthetic_bundle(const SyntheticBundleOptions& o) {
  std::mt19937 random(o.seed);
  std::normal_distribution<double> gauss;
  std::uniform_real_distribution<double> uniform(0, 1);
  SyntheticBundle out;
  BundleProblem& problem = out.problem;
  // One draw a statement: in which order arguments are evaluated is the compiler's choice, and so would be the map.
  const auto drawn_point = [&](auto& distribution) {
    Eigen::Vector3d v;
    for (int i = 2; i >= 0; --i) v[i] = distribution(random);
    return v;
  };
  problem.camera = o.camera;
  // The camera sees about 0.8 m x 0.6 m of the desk from 0.65 m above it.
  const double height = 0.65, footprint = 0.45, area = std::max(0.5, o.keyframes * footprint / o.views);
  const double width = std::sqrt(area * 4 / 3), depth = area / width;
  for (int i = 0; i < o.keyframes; ++i) {
    const double s = 2 * std::numbers::pi * i / o.keyframes;  // a closed Lissajous figure over the desk
    const Eigen::Vector3d centre(0.45 * width * std::sin(3 * s + 0.4), 0.45 * depth * std::sin(4 * s),
                                 -height + 0.08 * gauss(random));
    Vector6d tilt;
    tilt << 0, 0, 0, 0.15 * gauss(random), 0.15 * gauss(random), 0.5 * gauss(random);
    const Eigen::Matrix3d rotation = RigidTransform::exp(tilt).R;
    out.poses.emplace_back(rotation, -(rotation * centre));
  }
  while (int(out.points.size()) < o.points) {
    const Eigen::Vector3d u = drawn_point(uniform), point(width * (u.x() - 0.5), depth * (u.y() - 0.5), -0.2 * u.z());
    std::vector<BundleObservation> seen;
    for (int i = 0; i < o.keyframes; ++i) {
      BundleObservation observation;
      observation.pose = i;
      observation.point = int(out.points.size());
      if (!o.camera.project(out.poses[std::size_t(i)] * point, &observation.pixel)) continue;
      if (o.camera.in_image(observation.pixel, 2)) seen.push_back(observation);
    }
    if (seen.size() < 3) continue;
    out.points.push_back(point);
    for (BundleObservation& observation : seen) {
      observation.sigma_px = double(1 << int(3 * uniform(random) * uniform(random)));
      const bool wrong = uniform(random) < o.outliers;
      const double noise_y = gauss(random), noise_x = gauss(random);
      const Eigen::Vector2d noise(noise_x, noise_y);
      observation.pixel += o.noise_px * observation.sigma_px * noise;
      if (wrong) {
        const double angle = 2 * std::numbers::pi * uniform(random), size = 20 + 60 * uniform(random);
        observation.pixel += observation.sigma_px * size * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      }
      problem.observations.push_back(observation);
      out.outlier.push_back(wrong);
    }
  }
  for (int i = 0; i < o.keyframes; ++i) {
    Vector6d error;
    for (int k = 0; k < 6; ++k) error[k] = (k < 3 ? 1.0 : 0.5) * o.pose_error * gauss(random);
    problem.pose_fixed.push_back(i < o.fixed);
    problem.poses.push_back(i < o.fixed ? out.poses[std::size_t(i)]
                                        : RigidTransform::exp(error) * out.poses[std::size_t(i)]);
  }
  for (const Eigen::Vector3d& p : out.points) problem.points.push_back(p + o.point_error * drawn_point(gauss));
  return out;
}

// The same map as a local problem (PTAM Eq. 11): only the keyframes `free` nearest the last one are adjusted, with the
// points they see; every other keyframe that sees those is fixed.
inline BundleProblem local_problem(const SyntheticBundle& map, int free) {
  const BundleProblem& all = map.problem;
  const int n = int(all.poses.size());
  const auto centre = [&](int i) { return map.poses[std::size_t(i)].inverse().t; };
  std::vector<std::pair<double, int>> nearest;
  for (int i = 0; i < n; ++i) nearest.emplace_back((centre(i) - centre(n - 1)).norm(), i);
  std::sort(nearest.begin(), nearest.end());
  std::vector<int> is_free(std::size_t(n), 0), pose_index(std::size_t(n), -1), point_index(all.points.size(), -1);
  for (int k = 0; k < std::min(free, n); ++k) is_free[std::size_t(nearest[std::size_t(k)].second)] = 1;
  for (const auto& o : all.observations)
    if (is_free[std::size_t(o.pose)]) point_index[std::size_t(o.point)] = 0;
  BundleProblem local;
  local.camera = all.camera;
  for (std::size_t p = 0; p < all.points.size(); ++p)
    if (point_index[p] == 0) {
      point_index[p] = int(local.points.size());
      local.points.push_back(all.points[p]);
    }
  for (BundleObservation o : all.observations) {
    if (point_index[std::size_t(o.point)] < 0) continue;
    int& pose = pose_index[std::size_t(o.pose)];
    if (pose < 0) {
      pose = int(local.poses.size());
      const bool adjusted = is_free[std::size_t(o.pose)];
      local.poses.push_back(adjusted ? all.poses[std::size_t(o.pose)] : map.poses[std::size_t(o.pose)]);
      local.pose_fixed.push_back(!adjusted);
    }
    o.pose = pose;
    o.point = point_index[std::size_t(o.point)];
    local.observations.push_back(o);
  }
  return local;
}

}  // namespace parallax::testing
