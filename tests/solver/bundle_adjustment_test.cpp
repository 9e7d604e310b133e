#include "solver/bundle_adjustment.h"

#include <gtest/gtest.h>

#include <chrono>
#include <limits>
#include <thread>

#include "core/check.h"
#include "core/cpu_dispatch.h"
#include "tests/solver/ceres_bundle.h"
#include "tests/solver/synthetic_bundle.h"

namespace parallax {
namespace {

using testing::make_synthetic_bundle;
using testing::SyntheticBundle;
using testing::SyntheticBundleOptions;

BundleOptions tight(RobustKernel kernel) {
  BundleOptions o;
  o.kernel = kernel;
  o.estimate_sigma = false;
  o.max_iterations = 100;
  o.relative_cost_tolerance = 1e-13;
  return o;
}

// Largest distance of camera centres and points from the truth, after the similarity that fits best.
double worst_error(const BundleProblem& p, const SyntheticBundle& truth) {
  Eigen::Matrix3Xd a(3, p.points.size() + p.poses.size()), b = a;
  for (std::size_t i = 0; i < p.points.size(); ++i) {
    a.col(Eigen::Index(i)) = p.points[i];
    b.col(Eigen::Index(i)) = truth.points[i];
  }
  for (std::size_t i = 0; i < p.poses.size(); ++i) {
    a.col(Eigen::Index(p.points.size() + i)) = p.poses[i].inverse().t;
    b.col(Eigen::Index(p.points.size() + i)) = truth.poses[i].inverse().t;
  }
  SimilarityTransform fit;
  EXPECT_TRUE(align_points(a, b, true, &fit));
  double worst = 0;
  for (Eigen::Index i = 0; i < a.cols(); ++i) worst = std::max(worst, (fit * a.col(i) - b.col(i)).norm());
  return worst;
}

// Robust cost computed here, from the definition, with the camera model itself.
double cost_by_hand(const BundleProblem& p, RobustKernel kernel, double sigma) {
  const double c = kernel_width(kernel) * sigma;
  double sum = 0;
  for (const BundleObservation& o : p.observations) {
    Eigen::Vector2d px;
    if (p.camera.project(p.poses[std::size_t(o.pose)] * p.points[std::size_t(o.point)], &px))
      sum += kernel_cost(kernel, (px - o.pixel).squaredNorm() / (o.sigma_px * o.sigma_px * c * c));
    else if (kernel == RobustKernel::tukey)
      sum += 1.0 / 3;
  }
  return 0.5 * c * c * sum;
}

std::vector<CameraModel> lenses() {
  return {
      CameraModel(CameraModelKind::pinhole, 640, 480, {500, 505}, {320, 238}),
      CameraModel(CameraModelKind::radtan, 640, 480, {500, 505}, {320, 238}, {-0.2, 0.05, 1e-3, -5e-4, 0.01}, 5),
      CameraModel(CameraModelKind::kannala_brandt, 640, 480, {400, 405}, {320, 238}, {0.02, -0.01, 0.003, -0.001}, 4),
      CameraModel(CameraModelKind::fov, 640, 480, {400, 405}, {320, 238}, {0.9}, 1)};
}

TEST(BundleAdjustment, FindsExactTruthWithEveryLensAndInstructionSet) {
  const SimdLevel highest = supported_simd_level();
  for (int level = 0; level <= int(highest); ++level) {
    set_simd_level(SimdLevel(level));
    for (const CameraModel& camera : lenses()) {
      SyntheticBundleOptions o;
      o.camera = camera;
      o.fixed = 2;  // scale too
      const SyntheticBundle map = make_synthetic_bundle(o);
      BundleProblem p = map.problem;
      std::vector<std::uint8_t> outlier;
      const BundleSummary s = adjust_bundle(&p, tight(RobustKernel::none), {}, &outlier);
      EXPECT_TRUE(s.converged);
      EXPECT_FALSE(s.failed);
      EXPECT_GT(s.initial_cost, 1e3);
      EXPECT_LT(s.final_cost, 1e-12) << to_string(camera.kind());
      for (std::size_t i = 0; i < p.points.size(); ++i) EXPECT_LT((p.points[i] - map.points[i]).norm(), 1e-7);
      for (std::size_t i = 0; i < p.poses.size(); ++i)
        EXPECT_LT((p.poses[i] * map.poses[i].inverse()).log().norm(), 1e-7);
      EXPECT_EQ(std::count(outlier.begin(), outlier.end(), 1), 0);
    }
  }
  set_simd_level(highest);
}

TEST(BundleAdjustment, ReportsTheCostItIsDefinedToMinimise) {
  for (const RobustKernel kernel : {RobustKernel::none, RobustKernel::huber, RobustKernel::tukey}) {
    SyntheticBundleOptions o;
    o.noise_px = 1;
    o.outliers = 0.1;
    const SyntheticBundle map = make_synthetic_bundle(o);
    BundleProblem p = map.problem;
    BundleOptions options = tight(kernel);
    options.fixed_sigma = 1.3;
    options.max_iterations = 4;
    const BundleSummary s = adjust_bundle(&p, options);
    EXPECT_NEAR(s.initial_cost, cost_by_hand(map.problem, kernel, 1.3), 1e-10 * s.initial_cost);
    EXPECT_NEAR(s.final_cost, cost_by_hand(p, kernel, 1.3), 1e-10 * s.final_cost);
    EXPECT_LT(s.final_cost, s.initial_cost);
  }
}

TEST(BundleAdjustment, ReachesTheOptimumOfCeres) {
  for (const RobustKernel kernel : {RobustKernel::none, RobustKernel::huber, RobustKernel::tukey}) {
    for (const int fixed : {1, 2}) {
      SyntheticBundleOptions o;
      o.keyframes = 15;
      o.views = 14;  // every point well determined, so that optima can be compared
      o.noise_px = 0.8;
      o.outliers = kernel == RobustKernel::none ? 0 : 0.05;
      o.pose_error = 0.003;
      o.point_error = 0.004;
      o.fixed = fixed;
      const SyntheticBundle map = make_synthetic_bundle(o);
      const BundleOptions options = tight(kernel);
      BundleProblem ours = map.problem;
      // Tukey's cost has many minima: both start near one, where Huber's ends.
      if (kernel == RobustKernel::tukey) adjust_bundle(&ours, tight(RobustKernel::huber));
      BundleProblem theirs = ours;
      const BundleSummary a = adjust_bundle(&ours, options);
      const BundleSummary b = testing::ceres_adjust_bundle(&theirs, options);
      EXPECT_NEAR(a.initial_cost, b.initial_cost, 1e-9 * b.initial_cost);
      EXPECT_NEAR(a.final_cost, b.final_cost, 1e-8 * b.final_cost);
      SyntheticBundle reference;
      reference.points = theirs.points;
      reference.poses = theirs.poses;
      EXPECT_LT(worst_error(ours, reference), 1e-4);
    }
  }
}

TEST(BundleAdjustment, FlagsOutliersAndKeepsInliers) {
  SyntheticBundleOptions o;
  o.keyframes = 20;
  o.noise_px = 0.7;
  o.outliers = 0.1;
  o.pose_error = 0.003;
  o.point_error = 0.004;
  const SyntheticBundle map = make_synthetic_bundle(o);
  BundleProblem p = map.problem;
  BundleOptions options;
  options.max_iterations = 50;
  std::vector<std::uint8_t> outlier;
  const BundleSummary s = adjust_bundle(&p, options, {}, &outlier);
  EXPECT_FALSE(s.failed);
  // Residuals are smaller than the noise, by the share of unknowns; outliers raise the median a little.
  EXPECT_GT(s.sigma, 0.45);
  EXPECT_LT(s.sigma, 0.75);
  int missed = 0, wrongly = 0, wrong = 0;
  ASSERT_EQ(outlier.size(), map.outlier.size());
  for (std::size_t i = 0; i < outlier.size(); ++i) {
    wrong += map.outlier[i];
    missed += map.outlier[i] && !outlier[i];
    wrongly += !map.outlier[i] && outlier[i];
  }
  EXPECT_GT(wrong, 100);
  EXPECT_LE(missed, wrong / 20);
  EXPECT_LE(wrongly, int(outlier.size()) / 25);
}

TEST(BundleAdjustment, FixedPosesStayAndLocalProblemsAreSolved) {
  SyntheticBundleOptions o;
  o.keyframes = 40;
  o.points = 800;
  o.noise_px = 0.5;
  o.fixed = 0;
  const SyntheticBundle map = make_synthetic_bundle(o);
  BundleProblem local = testing::local_problem(map, 5);
  ASSERT_GT(std::count(local.pose_fixed.begin(), local.pose_fixed.end(), 1), 5);
  ASSERT_EQ(std::count(local.pose_fixed.begin(), local.pose_fixed.end(), 0), 5);
  BundleProblem theirs = local;
  const BundleProblem start = local;
  const BundleOptions options = tight(RobustKernel::huber);
  const BundleSummary a = adjust_bundle(&local, options);
  const BundleSummary b = testing::ceres_adjust_bundle(&theirs, options);
  EXPECT_NEAR(a.final_cost, b.final_cost, 1e-8 * b.final_cost);
  for (std::size_t i = 0; i < local.poses.size(); ++i) {
    if (local.pose_fixed[i]) {
      EXPECT_EQ(local.poses[i].R, start.poses[i].R);
      EXPECT_EQ(local.poses[i].t, start.poses[i].t);
    } else {
      EXPECT_NE(local.poses[i].t, start.poses[i].t);
      EXPECT_LT((local.poses[i] * theirs.poses[i].inverse()).log().norm(), 1e-6);
    }
  }
}

TEST(BundleAdjustment, AdjustsPointsAloneWhenEveryPoseIsFixed) {
  SyntheticBundleOptions o;
  o.fixed = o.keyframes;
  const SyntheticBundle map = make_synthetic_bundle(o);
  BundleProblem p = map.problem;
  const BundleSummary s = adjust_bundle(&p, tight(RobustKernel::none));
  EXPECT_LT(s.final_cost, 1e-15);
  for (std::size_t i = 0; i < p.points.size(); ++i) EXPECT_LT((p.points[i] - map.points[i]).norm(), 1e-7);
}

TEST(BundleAdjustment, TwoThreadsAgreeWithOneAndEachWithItself) {
  SyntheticBundleOptions o;
  o.keyframes = 30;
  o.points = 900;
  o.noise_px = 1;
  o.outliers = 0.03;
  const SyntheticBundle map = make_synthetic_bundle(o);
  std::vector<BundleProblem> results;
  for (const int threads : {1, 1, 2, 2}) {
    results.push_back(map.problem);
    BundleOptions options;
    options.threads = threads;
    adjust_bundle(&results.back(), options);
  }
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    EXPECT_EQ(results[0].points[i], results[1].points[i]);
    EXPECT_EQ(results[2].points[i], results[3].points[i]);
    EXPECT_LT((results[0].points[i] - results[2].points[i]).norm(), 1e-6);
  }
}

TEST(BundleAdjustment, AStopLeavesAStateNoWorseThanTheStart) {
  SyntheticBundleOptions o;
  o.keyframes = 80;
  o.points = 3000;
  o.noise_px = 1;
  const SyntheticBundle map = make_synthetic_bundle(o);
  const double before = cost_by_hand(map.problem, RobustKernel::tukey, 1);
  int stopped = 0;
  for (int k = 0; k < 12; ++k) {
    BundleProblem p = map.problem;
    BundleOptions options = tight(RobustKernel::tukey);
    options.relative_cost_tolerance = 0;
    options.threads = 1 + k % 2;
    std::stop_source stop;
    if (k == 0) stop.request_stop();
    std::jthread later([&stop, k] {
      std::this_thread::sleep_for(std::chrono::microseconds(700 * k));
      stop.request_stop();
    });
    const BundleSummary s = adjust_bundle(&p, options, stop.get_token());
    stopped += s.stopped;
    const double after = cost_by_hand(p, RobustKernel::tukey, 1);
    EXPECT_LE(after, before * (1 + 1e-12));
    if (s.iterations > 0) {
      EXPECT_NEAR(after, s.final_cost, 1e-9 * after);
    }
    if (k == 0) {
      EXPECT_TRUE(s.stopped);
      EXPECT_EQ(after, before);
    }
  }
  EXPECT_GE(stopped, 1);
}

TEST(BundleAdjustment, ObservationsBehindTheCameraAreOutliers) {
  for (const RobustKernel kernel : {RobustKernel::none, RobustKernel::huber, RobustKernel::tukey}) {
    SyntheticBundleOptions near;
    near.pose_error = near.point_error = 0.001;
    near.views = 14;
    const SyntheticBundle map = make_synthetic_bundle(near);
    BundleProblem p = map.problem;
    // One keyframe is turned round, and fixed there: nothing it claims to see is in front of it.
    Vector6d turn = Vector6d::Zero();
    turn[4] = std::numbers::pi;
    p.poses[5] = RigidTransform::exp(turn) * map.poses[5];
    p.pose_fixed[5] = 1;
    std::vector<std::uint8_t> outlier;
    const BundleSummary s = adjust_bundle(&p, tight(kernel), {}, &outlier);
    EXPECT_FALSE(s.failed);
    for (std::size_t i = 0; i < outlier.size(); ++i) {
      EXPECT_EQ(outlier[i] != 0, p.observations[i].pose == 5);
    }
    for (const BundleObservation& o : p.observations) {
      if (o.pose == 5) continue;
      Eigen::Vector2d px;
      ASSERT_TRUE(p.camera.project(p.poses[std::size_t(o.pose)] * p.points[std::size_t(o.point)], &px));
      EXPECT_LT((px - o.pixel).norm(), 1e-4);
    }
  }
}

TEST(BundleAdjustment, DegenerateInput) {
  BundleProblem empty;
  EXPECT_TRUE(adjust_bundle(&empty, {}).converged);

  SyntheticBundle map = make_synthetic_bundle({});
  BundleProblem p = map.problem;
  p.observations.clear();
  const BundleSummary none = adjust_bundle(&p, {});
  EXPECT_TRUE(none.converged);
  EXPECT_EQ(none.final_cost, 0);
  EXPECT_EQ(p.poses[3].t, map.problem.poses[3].t);

  p = map.problem;
  p.observations[7].pixel.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(adjust_bundle(&p, {}).failed);
  EXPECT_EQ(p.points[0], map.problem.points[0]);
  p = map.problem;
  p.points[3].z() = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(adjust_bundle(&p, {}).failed);
  p = map.problem;
  p.observations[7].sigma_px = 0;
  EXPECT_TRUE(adjust_bundle(&p, {}).failed);
  p = map.problem;
  p.observations[7].point = int(p.points.size());
  EXPECT_THROW(adjust_bundle(&p, {}), CheckFailure);
}

TEST(BundleAdjustment, RankDeficientProblemsStillConverge) {
  // Points seen once, a pose with two observations, one without any, the same observation twice, all frames free.
  SyntheticBundleOptions o;
  o.fixed = 0;
  const SyntheticBundle map = make_synthetic_bundle(o);
  BundleProblem p = map.problem;
  std::vector<int> seen(p.points.size(), 0);
  std::vector<BundleObservation> kept;
  int of_third = 0;
  for (const BundleObservation& observation : map.problem.observations) {
    if (observation.pose == 4) continue;
    if (observation.pose == 3 && ++of_third > 2) continue;
    if (observation.point < 20 && seen[std::size_t(observation.point)]++ > 0) continue;
    kept.push_back(observation);
    if (observation.point == 30) kept.push_back(observation);
  }
  p.observations = kept;
  const BundleSummary s = adjust_bundle(&p, tight(RobustKernel::none));
  EXPECT_FALSE(s.failed);
  EXPECT_LT(s.final_cost, 1e-9);
  EXPECT_EQ(p.poses[4].t, map.problem.poses[4].t);
  for (const Eigen::Vector3d& x : p.points) EXPECT_TRUE(x.allFinite());
}

TEST(BundleAdjustment, ADuplicatedObservationCountsTwice) {
  SyntheticBundleOptions o;
  o.noise_px = 1;
  o.fixed = 2;
  BundleProblem twice = make_synthetic_bundle(o).problem;
  const std::size_t n = twice.observations.size();
  BundleProblem heavier = twice;
  for (std::size_t i = 0; i < n; i += 3) {
    twice.observations.push_back(twice.observations[i]);
    heavier.observations[i].sigma_px /= std::sqrt(2.0);
  }
  BundleOptions options = tight(RobustKernel::none);
  options.max_iterations = 6;
  const BundleSummary a = adjust_bundle(&twice, options), b = adjust_bundle(&heavier, options);
  EXPECT_NEAR(a.initial_cost, b.initial_cost, 1e-9 * a.initial_cost);
  EXPECT_NEAR(a.final_cost, b.final_cost, 1e-9 * a.final_cost);
  for (std::size_t i = 0; i < twice.points.size(); ++i) EXPECT_LT((twice.points[i] - heavier.points[i]).norm(), 1e-7);
}

}  // namespace
}  // namespace parallax
