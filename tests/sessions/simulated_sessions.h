// Sessions that walk round one building, with exact truth: what odometry and place recognition would tell of them.
#pragma once

#include <Eigen/Cholesky>
#include <cmath>
#include <random>
#include <vector>

#include "sessions/session_types.h"

namespace parallax::testing {

struct SimulatedSession {
  int number = 1;
  RigidTransform global_from_session;              // truth
  std::vector<RigidTransform> global_from_camera;  // truth
  std::vector<StereoConstraint> constraints;

  RigidTransform session_from_camera(int keyframe) const {
    return global_from_session.inverse() * global_from_camera[static_cast<std::size_t>(keyframe)];
  }
};

inline Matrix6d simulated_covariance(double sigma_m, double sigma_rad) {
  Vector6d d;
  d << Eigen::Vector3d::Constant(sigma_m * sigma_m), Eigen::Vector3d::Constant(sigma_rad * sigma_rad);
  return d.asDiagonal();
}

// truth = exp(e) measured, e ~ N(0, covariance).
inline RigidTransform simulated_measurement(const RigidTransform& truth, const Matrix6d& covariance,
                                            std::mt19937_64* rng) {
  std::normal_distribution<double> normal;
  Vector6d e;
  for (int i = 0; i < 6; ++i) e[i] = normal(*rng);
  return RigidTransform::exp(-(covariance.llt().matrixL() * e)) * truth;
}

// Round a rectangle of 20 x 8 m, 0.25 m a step, looking ahead, up and down a little; begins `start` metres along the
// way.
inline SimulatedSession simulate_session(int number, int keyframes, double start_m, double noise, std::uint64_t seed) {
  SimulatedSession out;
  out.number = number;
  std::mt19937_64 rng(seed);
  for (int i = 0; i < keyframes; ++i) {
    const double way = std::fmod(start_m + 0.25 * i, 56.0);
    double x = 0, z = 0, heading = 0;
    if (way < 20) {
      x = way, z = 0, heading = M_PI / 2;
    } else if (way < 28) {
      x = 20, z = way - 20, heading = 0;
    } else if (way < 48) {
      x = 48 - way, z = 8, heading = -M_PI / 2;
    } else {
      x = 0, z = 56 - way, heading = M_PI;
    }
    out.global_from_camera.push_back(
        {exp_so3({0, heading, 0}) * exp_so3({0.1 * std::sin(0.3 * i), 0, 0}), {x, 0.1 * std::sin(0.5 * i), z}});
  }
  out.global_from_session = out.global_from_camera.front();
  const Matrix6d covariance = simulated_covariance(0.003, 0.0007);
  for (int i = 1; i < keyframes; ++i) {
    const auto at = static_cast<std::size_t>(i);
    StereoConstraint c;
    c.from = i - 1;
    c.to = i;
    c.covariance = covariance;
    const RigidTransform truth = out.global_from_camera[at - 1].inverse() * out.global_from_camera[at];
    c.from_from_to = simulated_measurement(truth, noise * noise * covariance + 1e-18 * Matrix6d::Identity(), &rng);
    out.constraints.push_back(c);
  }
  return out;
}

inline Encounter simulate_encounter(std::int64_t id, const SimulatedSession& found, int found_keyframe,
                                    const SimulatedSession& query, int query_keyframe, double noise,
                                    std::mt19937_64* rng) {
  Encounter out;
  out.id = id;
  out.found = {found.number, found_keyframe};
  out.query = {query.number, query_keyframe};
  out.covariance = simulated_covariance(0.01, 0.003);
  const RigidTransform truth = found.global_from_camera[static_cast<std::size_t>(found_keyframe)].inverse() *
                               query.global_from_camera[static_cast<std::size_t>(query_keyframe)];
  out.found_from_query =
      simulated_measurement(truth, noise * noise * out.covariance + 1e-18 * Matrix6d::Identity(), rng);
  out.inliers = 40;
  return out;
}

}  // namespace parallax::testing
