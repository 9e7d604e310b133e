#include "solver/pose_refinement.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>
#include <numbers>
#include <random>

#include "core/cpu_dispatch.h"
#include "solver/schur_solver.h"
#include "tests/support/lenses.h"

namespace parallax {
namespace {

struct RefinementScene {
  CameraModel camera = testing::lens(3);
  RigidTransform truth, start;
  std::vector<PoseObservation> observations;
};

Vector6d random_increment(std::mt19937& random, double metres, double radians) {
  std::normal_distribution<double> gauss;
  Vector6d mu;
  for (int k = 0; k < 6; ++k) mu[k] = (k < 3 ? metres : radians) * gauss(random);
  return mu;
}

RefinementScene refinement_scene(int n, double noise, double outliers, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> gauss;
  std::uniform_real_distribution<double> uniform(0, 1);
  RefinementScene s;
  s.truth = RigidTransform::exp(random_increment(random, 0.5, 0.5));
  s.start = RigidTransform::exp(random_increment(random, 0.01, 0.01)) * s.truth;
  while (int(s.observations.size()) < n) {
    const Eigen::Vector3d point(2 * uniform(random) - 1, 1.6 * uniform(random) - 0.8, 0.8 + 1.5 * uniform(random));
    PoseObservation o;
    o.point = s.truth.inverse() * point;
    if (!s.camera.project(point, &o.pixel) || !s.camera.in_image(o.pixel)) continue;
    o.sigma_px = double(1 << int(4 * uniform(random)));
    const Eigen::Vector2d error(gauss(random), gauss(random));
    o.pixel += noise * o.sigma_px * error;
    if (int(s.observations.size()) < outliers * n)
      o.pixel += o.sigma_px * Eigen::Vector2d(60 * uniform(random) + 15, 60 * uniform(random) - 30);
    s.observations.push_back(o);
  }
  return s;
}

double log_distance(const RigidTransform& a, const RigidTransform& b) { return (a * b.inverse()).log().norm(); }

TEST(PoseKernels, ProjectAndDifferentiateAsTheCameraModelDoes) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const SimdLevel highest = supported_simd_level();
  for (int level = 0; level <= int(highest); ++level) {
    set_simd_level(SimdLevel(level));
    for (int kind = 0; kind < 4; ++kind) {
      const CameraModel camera = testing::lens(kind);
      solver::PoseJob job;
      job.lens = solver::lens_parameters(camera);
      constexpr int n = 512;
      job.count = job.stride = n;
      std::vector<double> v(21 * n, 0.0);
      const RigidTransform pose = RigidTransform::exp(random_increment(random, 0.3, 0.3));
      for (int i = 0; i < n; ++i) {
        // All directions, near the axis and exactly on it too.
        Eigen::Vector3d p(2 * uniform(random), 2 * uniform(random), 2 * uniform(random) + 1);
        if (i % 16 == 0) p.head<2>() *= 1e-7;
        if (i == 5) p = {0, 0, 2};
        p = pose.inverse() * p;
        for (int k = 0; k < 3; ++k) v[std::size_t(k * n + i)] = p[k];
        v[std::size_t(5 * n + i)] = 1;
      }
      double* d = v.data();
      job.x = d;
      job.y = d + n;
      job.z = d + 2 * n;
      job.u = d + 3 * n;
      job.v = d + 4 * n;
      job.inverse_sigma = d + 5 * n;
      job.ru = d + 6 * n;
      job.rv = d + 7 * n;
      job.squared = d + 8 * n;
      job.jacobian = d + 9 * n;
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) job.pose[3 * r + c] = pose.R(r, c);
        job.pose[9 + r] = pose.t[r];
      }
      solver::solver_kernels(job.lens.lens).pose_project(job);
      int inside = 0;
      for (int i = 0; i < n; ++i) {
        const Eigen::Vector3d p = pose * Eigen::Vector3d(d[i], d[n + i], d[2 * n + i]);
        Eigen::Vector2d px;
        Eigen::Matrix<double, 2, 3> j;
        if (!camera.project(p, &px, &j)) {
          EXPECT_GE(job.squared[i], solver::kUnusedSquared);
          continue;
        }
        ++inside;
        EXPECT_NEAR(job.ru[i], px.x(), 1e-8 * (1 + px.norm()));
        EXPECT_NEAR(job.rv[i], px.y(), 1e-8 * (1 + px.norm()));
        const auto jacobian = CameraModel::pose_jacobian(j, p);
        for (int r = 0; r < 2; ++r)
          for (int c = 0; c < 6; ++c)
            EXPECT_NEAR(job.jacobian[(6 * r + c) * n + i], jacobian(r, c), 1e-7 * (1 + jacobian.norm()));
        // And central differences of a left increment.
        if (p.z() < 0.3) continue;
        for (int c = 0; c < 6; ++c) {
          const double h = 1e-6;
          Eigen::Vector2d up, down;
          if (!camera.project(RigidTransform::exp(h * Vector6d::Unit(c)) * p, &up) ||
              !camera.project(RigidTransform::exp(-h * Vector6d::Unit(c)) * p, &down))
            continue;
          const Eigen::Vector2d slope = (up - down) / (2 * h);
          EXPECT_NEAR(job.jacobian[c * n + i], slope.x(), 1e-5 * (100 + jacobian.norm()));
          EXPECT_NEAR(job.jacobian[(6 + c) * n + i], slope.y(), 1e-5 * (100 + jacobian.norm()));
        }
      }
      EXPECT_GT(inside, n / 3);
    }
  }
  set_simd_level(highest);
}

TEST(PoseRefinement, FindsTheExactPose) {
  for (const int n : {4, 5, 7, 10, 33, 1000}) {
    RefinementScene s = refinement_scene(n, 0, 0, unsigned(n));
    RigidTransform pose = s.start;
    std::vector<float> weight;
    const PoseSummary summary = refine_pose(s.camera, s.observations, {}, &pose, &weight);
    EXPECT_TRUE(summary.ok);
    EXPECT_LT(log_distance(pose, s.truth), 1e-7) << n;
    EXPECT_EQ(summary.inliers, n);
    ASSERT_EQ(int(weight.size()), n);
    for (const float w : weight) EXPECT_GT(w, 0.999f);
  }
}

TEST(PoseRefinement, CovarianceIsConsistent) {
  for (const RobustKernel kernel : {RobustKernel::none, RobustKernel::huber, RobustKernel::tukey}) {
    double nees = 0;
    constexpr int kRuns = 200;
    for (unsigned run = 0; run < kRuns; ++run) {
      RefinementScene s = refinement_scene(300, 1.0, 0, 1000 + run);
      RigidTransform pose = s.start;
      PoseOptions options;
      options.kernel = kernel;
      const PoseSummary summary = refine_pose(s.camera, s.observations, options, &pose);
      ASSERT_TRUE(summary.ok);
      const Vector6d error = (pose * s.truth.inverse()).log();
      nees += error.dot(summary.covariance.ldlt().solve(error)) / kRuns;
    }
    // 95 % bounds of the mean of 200 chi-squared variables with six degrees of freedom, and 3 % for a scale that is
    // itself estimated.
    const double bound = 1.96 * std::sqrt(2.0 * 6 / kRuns) + 0.2;
    EXPECT_NEAR(nees, 6.0, bound) << int(kernel);
  }
}

TEST(PoseRefinement, FortyPercentOutliersDoNoHarm) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    RefinementScene s = refinement_scene(300, 0.5, 0.4, seed);
    s.start = RigidTransform::exp(0.2 * (s.start * s.truth.inverse()).log()) * s.truth;
    RigidTransform pose = s.start;
    std::vector<float> weight;
    const PoseSummary summary = refine_pose(s.camera, s.observations, {}, &pose, &weight);
    EXPECT_TRUE(summary.ok);
    EXPECT_LT(log_distance(pose, s.truth), 0.004);
    for (int i = 0; i < 120; ++i) EXPECT_LT(weight[std::size_t(i)], 0.05f);
    EXPECT_GT(summary.inliers, 170);
  }
}

TEST(PoseRefinement, DegenerateInputLeavesThePoseAlone) {
  const RefinementScene s = refinement_scene(20, 0, 0, 3);
  const auto refused = [&](std::vector<PoseObservation> observations) {
    RigidTransform pose = s.start;
    std::vector<float> weight(3, 7.f);
    const PoseSummary summary = refine_pose(s.camera, observations, {}, &pose, &weight);
    EXPECT_EQ(weight.size(), observations.size());
    EXPECT_EQ(pose.t, s.start.t);
    EXPECT_EQ(pose.R, s.start.R);
    return !summary.ok;
  };
  EXPECT_TRUE(refused({}));
  EXPECT_TRUE(refused({s.observations[0], s.observations[1]}));
  EXPECT_TRUE(refused(std::vector<PoseObservation>(50, s.observations[0])));
  std::vector<PoseObservation> bad = s.observations;
  for (PoseObservation& o : bad) o.pixel.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(refused(bad));
  bad = s.observations;
  for (PoseObservation& o : bad) o.point = s.start.inverse() * -(s.start * o.point);  // behind the camera
  EXPECT_TRUE(refused(bad));
}

TEST(PoseRefinement, WhatCannotBeSeenHasNoWeight) {
  RefinementScene s = refinement_scene(60, 0, 0, 9);
  s.observations[10].point = s.truth.inverse() * -(s.truth * s.observations[10].point);
  s.observations[20].pixel.y() = std::numeric_limits<double>::infinity();
  s.observations[30].sigma_px = 0;
  RigidTransform pose = s.start;
  std::vector<float> weight;
  const PoseSummary summary = refine_pose(s.camera, s.observations, {}, &pose, &weight);
  EXPECT_TRUE(summary.ok);
  EXPECT_LT(log_distance(pose, s.truth), 1e-7);
  EXPECT_EQ(summary.inliers, 57);
  for (const std::size_t i : {10u, 20u, 30u}) EXPECT_EQ(weight[i], 0.f);
}

TEST(PoseRefinement, PriorHoldsWhatTheImageDoesNot) {
  // One point seen three times fixes a direction only; the prior decides the rest.
  const RefinementScene s = refinement_scene(1, 0, 0, 12);
  const std::vector<PoseObservation> observations(3, s.observations[0]);
  PoseOptions options;
  options.prior_information = Matrix6d::Identity() * 100;
  RigidTransform pose = s.start;
  const PoseSummary summary = refine_pose(s.camera, observations, options, &pose);
  ASSERT_TRUE(summary.ok);
  Eigen::Vector2d px;
  ASSERT_TRUE(s.camera.project(pose * s.observations[0].point, &px));
  EXPECT_LT((px - s.observations[0].pixel).norm(), 0.1);
  EXPECT_LT(log_distance(pose, s.start), log_distance(s.truth, s.start) + 0.02);
  // A strong prior keeps the pose where it was.
  const RefinementScene many = refinement_scene(50, 0, 0, 13);
  options.prior_information = Matrix6d::Identity() * 1e14;
  pose = many.start;
  ASSERT_TRUE(refine_pose(many.camera, many.observations, options, &pose).ok);
  EXPECT_LT(log_distance(pose, many.start), 1e-4);
}

TEST(RobustKernel, SigmaIsConsistentAndExactWhateverTheSize) {
  std::mt19937 random(2);
  std::normal_distribution<double> gauss;
  for (const int n : {1, 2, 5, 8, 100, 5000, 5001, 40000}) {
    std::vector<float> squared;
    for (int i = 0; i < n; ++i) {
      const double x = 1.7 * gauss(random), y = 1.7 * gauss(random);
      squared.push_back(float(x * x + y * y));
    }
    std::vector<float> sorted = squared;
    std::sort(sorted.begin(), sorted.end());
    const std::size_t h = sorted.size() / 2;
    const double median = n % 2 ? double(sorted[h]) : 0.5 * (double(sorted[h - 1]) + double(sorted[h]));
    const double expected = std::sqrt(median / (2 * std::numbers::ln2)) * (1 + 5.0 / std::max(1, n - 6));
    std::vector<double> doubles(squared.begin(), squared.end());
    EXPECT_DOUBLE_EQ(robust_sigma_2d(std::span<float>(squared)), expected);
    EXPECT_DOUBLE_EQ(robust_sigma_2d(std::span<double>(doubles)), expected);
    if (n >= 5000) {
      EXPECT_NEAR(expected, 1.7, 0.08);
    }
  }
  EXPECT_EQ(robust_sigma_2d(std::span<float>()), 0);
}

TEST(RobustKernel, WeightsAreTheSlopesOfTheCosts) {
  for (const RobustKernel kernel : {RobustKernel::none, RobustKernel::huber, RobustKernel::tukey})
    for (double s = 0.01; s < 2; s += 0.07) {
      const double h = 1e-6;
      EXPECT_NEAR((kernel_cost(kernel, s + h) - kernel_cost(kernel, s - h)) / (2 * h), kernel_weight(kernel, s), 1e-6);
    }
}

}  // namespace
}  // namespace parallax
