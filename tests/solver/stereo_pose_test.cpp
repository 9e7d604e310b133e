#include "solver/stereo_pose.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "solver/chi_square.h"

namespace parallax {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
const StereoCamera kCamera{512, 384, {400, 402}, {255.5, 191.5}, 0.119};

// How the points of a scene are seen; parts are of the points.
struct PoseScene {
  int points = 100;
  double nearest_m = 1.5, farthest_m = 15;
  double infinite = 0, left_only = 0, outliers = 0;
  double noise_px = 0;         // of every coordinate
  double sigma_px = 0.3;       // what is said of it
  double disparity_noise = 0;  // of the pair that the point was placed from, px: said in sigma_w
};

struct Seen {
  RigidTransform truth;
  std::vector<StereoPoseObservation> observations;
  std::vector<std::uint8_t> outlier;
};

Seen look(const PoseScene& scene, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal;
  const auto uniform = [&](double from, double to) { return std::uniform_real_distribution<double>(from, to)(rng); };
  Seen seen;
  seen.truth = RigidTransform(exp_so3({0.02, -0.05, 0.03}), {0.06, -0.03, -0.15});
  const double fb = kCamera.focal_px.x() * kCamera.baseline_m;
  while (static_cast<int>(seen.observations.size()) < scene.points) {
    const Eigen::Vector3d ray = kCamera.ray({uniform(5, 506), uniform(5, 378)});
    const bool infinite = uniform(0, 1) < scene.infinite;
    const double w = infinite ? 0 : 1 / (scene.nearest_m * std::pow(scene.farthest_m / scene.nearest_m, uniform(0, 1)));
    const Eigen::Vector3d x = seen.truth.R * ray + seen.truth.t * w;
    if (x.z() < 0.1) continue;
    const double u = kCamera.focal_px.x() * x.x() / x.z() + kCamera.centre_px.x();
    const double v = kCamera.focal_px.y() * x.y() / x.z() + kCamera.centre_px.y();
    if (!kCamera.in_image({u, v})) continue;
    StereoPoseObservation o;
    o.pixel = {u, u - fb * w / x.z(), v};
    for (int i = 0; i < 3; ++i) o.pixel[i] += scene.noise_px * normal(rng);
    o.point << ray, w + scene.disparity_noise / fb * normal(rng);
    o.sigma_w = scene.disparity_noise / fb;
    o.sigma_w /= o.point.norm();
    o.point.normalize();
    o.sigma_px = scene.sigma_px;
    if (uniform(0, 1) < scene.left_only) o.pixel.y() = kNaN;
    seen.outlier.push_back(uniform(0, 1) < scene.outliers);
    if (seen.outlier.back()) o.pixel = {uniform(0, 511), uniform(0, 511), uniform(0, 383)};
    seen.observations.push_back(o);
  }
  return seen;
}

Vector6d error_of(const RigidTransform& estimate, const RigidTransform& truth) {
  return (estimate * truth.inverse()).log();
}

Vector6d perturbation(std::mt19937* rng, double metres, double radians) {
  std::normal_distribution<double> normal;
  Vector6d d;
  for (int i = 0; i < 6; ++i) d[i] = (i < 3 ? metres : radians) * normal(*rng);
  return d;
}

// What the residuals are, straight from the camera: nothing of the solver's.
double sum_of_squares(const Seen& seen, const RigidTransform& pose) {
  double sum = 0;
  for (const StereoPoseObservation& o : seen.observations) {
    Eigen::Vector3d pixel = Eigen::Vector3d::Zero();
    EXPECT_TRUE(kCamera.project(pose * Eigen::Vector3d(o.point.head<3>() / o.point.w()), &pixel));
    const Eigen::Vector3d r = (pixel - o.pixel) / o.sigma_px;
    sum += std::isfinite(r.y()) ? r.squaredNorm() : r.x() * r.x() + r.z() * r.z();
  }
  return sum;
}

TEST(StereoPose, WithoutNoiseTheTruthIsReachedFromAside) {
  PoseScene near, mixed, mono;
  mixed.infinite = 0.4;
  mixed.left_only = 0.4;
  mono.left_only = 1;
  for (const PoseScene& scene : {near, mixed, mono}) {
    std::mt19937 rng(3);
    for (unsigned seed = 0; seed < 20; ++seed) {
      const Seen seen = look(scene, seed);
      RigidTransform pose = RigidTransform::exp(perturbation(&rng, 0.05, 0.02)) * seen.truth;
      std::vector<std::uint8_t> inlier;
      const StereoPoseSummary summary = refine_stereo_pose(kCamera, seen.observations, {}, &pose, &inlier);
      ASSERT_TRUE(summary.ok) << seed;
      EXPECT_LT(error_of(pose, seen.truth).norm(), 1e-9) << seed;
      EXPECT_EQ(summary.inliers, scene.points);
      EXPECT_EQ(std::count(inlier.begin(), inlier.end(), 1), scene.points);
    }
  }
}

// Points at infinity tell the rotation and nothing else: the translation cannot be had, and a few near ones give it.
TEST(StereoPose, PointsAtInfinityTellTheRotationAlone) {
  PoseScene scene;
  scene.infinite = 1;
  Seen far = look(scene, 1);
  RigidTransform pose = far.truth;
  EXPECT_FALSE(refine_stereo_pose(kCamera, far.observations, {}, &pose, nullptr).ok);
  EXPECT_EQ(pose.t, far.truth.t);
  PoseScene few;
  few.points = 6;
  const Seen near = look(few, 2);
  far.observations.insert(far.observations.end(), near.observations.begin(), near.observations.end());
  pose = RigidTransform::exp((Vector6d() << 0.02, 0.01, -0.02, 0.01, 0.01, -0.01).finished()) * far.truth;
  const StereoPoseSummary summary = refine_stereo_pose(kCamera, far.observations, {}, &pose, nullptr);
  ASSERT_TRUE(summary.ok);
  EXPECT_LT(error_of(pose, far.truth).norm(), 1e-9);
}

// With noise the end is a minimum of the squares by central differences, and its covariance their second derivative.
TEST(StereoPose, EndIsAMinimumAndCovarianceItsCurvature) {
  PoseScene scene;
  scene.left_only = 0.3;
  scene.noise_px = scene.sigma_px = 0.05;
  const Seen seen = look(scene, 5);
  StereoPoseOptions options;
  options.min_scale = 1e3;  // Tukey's kernel so wide that all count alike
  options.iterations = 30;
  RigidTransform pose = seen.truth;
  const StereoPoseSummary summary = refine_stereo_pose(kCamera, seen.observations, options, &pose, nullptr);
  ASSERT_TRUE(summary.ok);
  EXPECT_EQ(summary.scale, 1e3);
  const auto at = [&](const Vector6d& d) { return 0.5 * sum_of_squares(seen, RigidTransform::exp(d) * pose); };
  constexpr double kStep = 1e-4;
  Vector6d gradient;
  Matrix6d hessian;
  for (int i = 0; i < 6; ++i) {
    const Vector6d di = kStep * Vector6d::Unit(i);
    gradient[i] = (at(di) - at(-di)) / (2 * kStep);
    for (int j = 0; j < 6; ++j) {
      const Vector6d dj = kStep * Vector6d::Unit(j);
      hessian(i, j) = (at(di + dj) - at(di - dj) - at(-di + dj) + at(-di - dj)) / (4 * kStep * kStep);
    }
  }
  // In standard deviations of the pose, the step that is left.
  EXPECT_LT(std::sqrt(std::abs(gradient.dot(hessian.ldlt().solve(gradient)))), 0.01);
  const Matrix6d information = (summary.covariance / 1e6).inverse();
  const Vector6d scale = hessian.diagonal().cwiseSqrt().cwiseInverse();
  EXPECT_LT((scale.asDiagonal() * (information - hessian) * scale.asDiagonal()).cwiseAbs().maxCoeff(), 0.02);
}

TEST(StereoPose, HalfOutliersAreFoundOut) {
  PoseScene scene;
  scene.outliers = 0.5;
  scene.noise_px = 0.2;
  scene.left_only = 0.2;
  scene.infinite = 0.1;
  for (unsigned seed = 0; seed < 20; ++seed) {
    const Seen seen = look(scene, seed);
    std::mt19937_64 rng(seed);
    const RigidTransform guess(exp_so3({0.2, -0.1, 0.15}), {0.3, 0.2, 0.4});  // useless
    RigidTransform pose;
    std::vector<std::uint8_t> inlier;
    const StereoPoseSummary found =
        find_stereo_pose(kCamera, seen.observations, std::span(&guess, 1), {}, &rng, &pose, &inlier);
    ASSERT_TRUE(found.ok) << seed;
    EXPECT_GT(found.hypotheses, 0);
    EXPECT_EQ(std::count(inlier.begin(), inlier.end(), 1), found.inliers);
    const Vector6d coarse = error_of(pose, seen.truth);
    EXPECT_LT(coarse.head<3>().norm(), 0.05) << seed;
    EXPECT_LT(coarse.tail<3>().norm(), 0.01) << seed;
    int wrong = 0;
    std::vector<StereoPoseObservation> agreeing;
    for (std::size_t i = 0; i < inlier.size(); ++i) {
      wrong += inlier[i] == seen.outlier[i];
      if (inlier[i]) agreeing.push_back(seen.observations[i]);
    }
    EXPECT_LE(wrong, 5) << seed;
    ASSERT_TRUE(refine_stereo_pose(kCamera, agreeing, {}, &pose, nullptr).ok);
    const Vector6d fine = error_of(pose, seen.truth);
    EXPECT_LT(fine.head<3>().norm(), 0.008) << seed;
    EXPECT_LT(fine.tail<3>().norm(), 0.002) << seed;
  }
}

TEST(StereoPose, GoodGuessNeedsFewHypothesesAndIsDeterministic) {
  PoseScene scene;
  scene.noise_px = 0.1;
  const Seen seen = look(scene, 4);
  std::vector<RigidTransform> poses(2);
  for (RigidTransform& pose : poses) {
    std::mt19937_64 rng(9);
    std::vector<std::uint8_t> inlier;
    const auto found =
        find_stereo_pose(kCamera, seen.observations, std::span(&seen.truth, 1), {}, &rng, &pose, &inlier);
    EXPECT_TRUE(found.ok);
    EXPECT_EQ(found.inliers, scene.points);
    EXPECT_LE(found.hypotheses, 3);
  }
  EXPECT_EQ(poses[0].R, poses[1].R);
  EXPECT_EQ(poses[0].t, poses[1].t);
}

// Normalised estimation error squared over 200 runs, with depths that are known and with depths that are themselves
// measured.
TEST(StereoPose, CovarianceIsTheSizeOfTheErrors) {
  for (const double disparity_noise : {0.0, 0.5}) {
    PoseScene scene;
    scene.points = 150;
    scene.noise_px = scene.sigma_px = 0.3;
    scene.disparity_noise = disparity_noise;
    scene.left_only = 0.2;
    constexpr int kRuns = 200;
    double nees = 0;
    Vector6d sum = Vector6d::Zero();
    Matrix6d covariance = Matrix6d::Zero();
    for (unsigned run = 0; run < kRuns; ++run) {
      const Seen seen = look(scene, 1000 + run);
      RigidTransform pose = seen.truth;
      const StereoPoseSummary summary = refine_stereo_pose(kCamera, seen.observations, {}, &pose, nullptr);
      ASSERT_TRUE(summary.ok);
      const Vector6d error = error_of(pose, seen.truth);
      nees += error.dot(summary.covariance.ldlt().solve(error));
      sum += error;
      covariance += summary.covariance;
    }
    const ChiSquareBounds bounds = chi_square_bounds_95(6 * kRuns);
    RecordProperty("nees_" + std::to_string(disparity_noise > 0), std::to_string(nees / kRuns));
    // The floor of the covariance makes it a little careful.
    EXPECT_GT(nees, 0.85 * bounds.low) << "mean " << nees / kRuns;
    EXPECT_LT(nees, bounds.high) << "mean " << nees / kRuns;
    // No bias: the mean error is within what its own covariance allows (chi-squared of 6, 99.9 %).
    const Vector6d mean = sum / kRuns;
    EXPECT_LT(mean.dot((covariance / (kRuns * static_cast<double>(kRuns))).ldlt().solve(mean)), 22.5);
  }
}

// Far points whose depth is a guess: taken at their word they pull the translation, with sigma_w they do not.
TEST(StereoPose, UncertainDepthsDoNotBias) {
  double trusted = 0, told = 0;
  for (unsigned seed = 0; seed < 30; ++seed) {
    PoseScene near, far;
    near.points = 25;
    near.farthest_m = 5;
    near.noise_px = far.noise_px = 0.1;
    near.sigma_px = far.sigma_px = 0.1;
    far.points = 120;
    far.nearest_m = 3;
    far.left_only = 1;
    Seen seen = look(near, seed);
    std::mt19937 rng(seed);
    // All too near by as much: an error that does not average out.
    for (StereoPoseObservation o : look(far, 100 + seed).observations) {
      o.point.w() += 0.1 * o.point.head<3>().norm();
      const double norm = o.point.norm();
      o.point /= norm;
      o.sigma_w = 0.1 / norm;
      seen.observations.push_back(o);
    }
    for (const bool tell : {false, true}) {
      Seen copy = seen;
      if (!tell)
        for (StereoPoseObservation& o : copy.observations) o.sigma_w = 0;
      RigidTransform pose = seen.truth;
      ASSERT_TRUE(refine_stereo_pose(kCamera, copy.observations, {}, &pose, nullptr).ok);
      (tell ? told : trusted) += error_of(pose, seen.truth).head<3>().norm() / 30;
    }
  }
  RecordProperty("trusted_m", std::to_string(trusted));
  RecordProperty("told_m", std::to_string(told));
  EXPECT_LT(told, 0.004);
  EXPECT_GT(trusted, 2 * told);
}

TEST(StereoPose, FewerThanSixAreRefusedAndThePoseStays) {
  PoseScene scene;
  scene.points = 5;
  const Seen seen = look(scene, 1);
  const RigidTransform start(exp_so3({0.01, 0.02, 0.03}), {0.1, 0.2, 0.3});
  RigidTransform pose = start;
  std::mt19937_64 rng(1);
  std::vector<std::uint8_t> inlier;
  EXPECT_FALSE(find_stereo_pose(kCamera, seen.observations, std::span(&seen.truth, 1), {}, &rng, &pose, &inlier).ok);
  EXPECT_EQ(inlier, std::vector<std::uint8_t>(5, 0));
  EXPECT_FALSE(refine_stereo_pose(kCamera, seen.observations, {}, &pose, &inlier).ok);
  EXPECT_FALSE(find_stereo_pose(kCamera, {}, {}, {}, &rng, &pose, &inlier).ok);
  EXPECT_FALSE(refine_stereo_pose(kCamera, {}, {}, &pose, nullptr).ok);
  EXPECT_EQ(pose.R, start.R);
  EXPECT_EQ(pose.t, start.t);
  // Many that agree on nothing.
  PoseScene chaos;
  chaos.outliers = 1;
  chaos.points = 40;
  EXPECT_FALSE(find_stereo_pose(kCamera, look(chaos, 3).observations, {}, {}, &rng, &pose, &inlier).ok);
  EXPECT_EQ(pose.t, start.t);
}

TEST(StereoPose, WhatIsNoNumberIsLeftOut) {
  PoseScene scene;
  Seen seen = look(scene, 2);
  const std::size_t good = seen.observations.size();
  for (int kind = 0; kind < 6; ++kind) {
    StereoPoseObservation o = seen.observations[static_cast<std::size_t>(kind)];
    if (kind == 0) o.point.x() = kNaN;
    if (kind == 1) o.pixel.x() = kNaN;
    if (kind == 2) o.pixel.z() = HUGE_VAL;
    if (kind == 3) o.sigma_px = 0;
    if (kind == 4) o.sigma_w = kNaN;
    if (kind == 5) o.point *= -1;  // behind the camera
    seen.observations.push_back(o);
  }
  std::mt19937_64 rng(1);
  RigidTransform pose;
  std::vector<std::uint8_t> inlier;
  const auto found = find_stereo_pose(kCamera, seen.observations, {}, {}, &rng, &pose, &inlier);
  ASSERT_TRUE(found.ok);
  EXPECT_EQ(found.inliers, static_cast<int>(good));
  const auto refined = refine_stereo_pose(kCamera, seen.observations, {}, &pose, &inlier);
  ASSERT_TRUE(refined.ok);
  EXPECT_EQ(refined.inliers, static_cast<int>(good));
  EXPECT_LT(error_of(pose, seen.truth).norm(), 1e-9);
  for (std::size_t i = 0; i < inlier.size(); ++i) EXPECT_EQ(inlier[i] != 0, i < good) << i;
}

}  // namespace
}  // namespace parallax
