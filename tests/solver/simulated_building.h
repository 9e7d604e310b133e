// A building walked again and again: two storeys of corridors on a grid, a pose every half metre, constraints along the
// way and loops to poses of earlier passes that were near. Truth, and measurements with noise of the covariances they
// claim. Seeded.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <tuple>
#include <vector>

#include "core/se3.h"

namespace parallax::testing {

struct SimulatedMeasurement {
  int from = 0, to = 0;
  RigidTransform from_from_to;
  Matrix6d covariance;
};

struct SimulatedBuildingOptions {
  int poses = 1000;
  int corridors_x = 7, corridors_y = 4;  // crossings of a storey, kSpacing apart
  int storeys = 2;
  int loop_every = 5;  // poses between two loops, once the place is known
  double step_m = 0.5;
  double odometry_m = 0.005, odometry_rad = 0.002;  // standard deviations of one constraint
  double loop_m = 0.02, loop_rad = 0.005;
};

struct SimulatedBuilding {
  std::vector<RigidTransform> truth;               // building_from_pose
  std::vector<SimulatedMeasurement> measurements;  // by the later of the two poses
};

inline Matrix6d diagonal_covariance(double m, double rad) {
  Matrix6d c = Matrix6d::Zero();
  c.diagonal() << m * m, m * m, m * m, rad * rad, rad * rad, rad * rad;
  return c;
}

inline RigidTransform with_noise(const RigidTransform& T, const Matrix6d& covariance, std::mt19937_64* random) {
  std::normal_distribution<double> normal;
  Vector6d e;
  for (int k = 0; k < 6; ++k) e[k] = normal(*random) * std::sqrt(covariance(k, k));
  return RigidTransform::exp(e) * T;
}

inline SimulatedBuilding make_building(const SimulatedBuildingOptions& options, std::uint64_t seed) {
  constexpr double kSpacing = 6, kStorey = 3;
  std::mt19937_64 random(seed);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  SimulatedBuilding building;
  int x = 0, y = 0, z = 0, dx = 1, dy = 0, dz = 0;
  Eigen::Vector3d position(0, 0, 0);
  std::map<std::tuple<int, int, int>, std::vector<int>> cells;
  const Matrix6d odometry = diagonal_covariance(options.odometry_m, options.odometry_rad),
                 loop = diagonal_covariance(options.loop_m, options.loop_rad);
  double heading = 0;
  int since_loop = 0;
  while (static_cast<int>(building.truth.size()) < options.poses) {
    // To the next crossing.
    const Eigen::Vector3d target((x + dx) * kSpacing, (y + dy) * kSpacing, (z + dz) * kStorey);
    const int steps = std::max(1, static_cast<int>((target - position).norm() / options.step_m));
    const Eigen::Vector3d stride = (target - position) / steps;
    for (int k = 0; k < steps && static_cast<int>(building.truth.size()) < options.poses; ++k) {
      const double aim = dx != 0 || dy != 0 ? std::atan2(dy, dx) : heading;
      heading += 0.5 * std::remainder(aim - heading, 2 * std::numbers::pi);
      position += stride;
      const Eigen::Vector3d turn(uniform(-0.05, 0.05), uniform(-0.05, 0.05), heading + uniform(-0.05, 0.05));
      const Eigen::Vector3d sway(uniform(-0.2, 0.2), uniform(-0.2, 0.2), uniform(-0.1, 0.1));
      const int i = static_cast<int>(building.truth.size());
      building.truth.emplace_back(
          exp_so3(Eigen::Vector3d(0, 0, turn.z())) * exp_so3(Eigen::Vector3d(turn.x(), turn.y(), 0)), position + sway);
      const RigidTransform& now = building.truth.back();
      const auto measure = [&](int from, const Matrix6d& covariance) {
        const RigidTransform exact = building.truth[static_cast<std::size_t>(from)].inverse() * now;
        building.measurements.push_back({from, i, with_noise(exact, covariance, &random), covariance});
      };
      if (i > 0) measure(i - 1, odometry);
      auto& here = cells[{static_cast<int>(std::lround(position.x())), static_cast<int>(std::lround(position.y())),
                          static_cast<int>(std::lround(position.z()))}];
      if (++since_loop >= options.loop_every) {
        // One of those that were here before and looked the same way, not the last few.
        std::vector<int> seen;
        for (const int j : here)
          if (j < i - 40 && (building.truth[static_cast<std::size_t>(j)].R.transpose() * now.R).trace() > 2.0)
            seen.push_back(j);
        if (!seen.empty()) {
          measure(seen[std::uniform_int_distribution<std::size_t>(0, seen.size() - 1)(random)], loop);
          since_loop = 0;
        }
      }
      here.push_back(i);
    }
    x += dx;
    y += dy;
    z += dz;
    position = target;
    // Anywhere that is not outside, and not back if there is another way.
    std::vector<std::tuple<int, int, int>> ways;
    const auto offer = [&](int ax, int ay, int az) {
      if (x + ax < 0 || x + ax >= options.corridors_x || y + ay < 0 || y + ay >= options.corridors_y) return;
      if (z + az < 0 || z + az >= options.storeys) return;
      if (az != 0 && !(x == 0 && y == 0)) return;  // the stairs
      if (ax == -dx && ay == -dy && az == -dz) return;
      ways.emplace_back(ax, ay, az);
    };
    offer(1, 0, 0);
    offer(-1, 0, 0);
    offer(0, 1, 0);
    offer(0, -1, 0);
    offer(0, 0, 1);
    offer(0, 0, -1);
    std::tie(dx, dy, dz) = ways[std::uniform_int_distribution<std::size_t>(0, ways.size() - 1)(random)];
  }
  return building;
}

}  // namespace parallax::testing
