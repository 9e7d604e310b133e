// The windowed bundle adjustment against central differences, exact truth, Ceres with Euclidean points, a dense inverse
// and the spread of its own results.
#include "solver/window_smoothing.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>
#include <random>

#include "core/cpu_dispatch.h"
#include "solver/chi_square.h"
#include "solver/homogeneous_point.h"
#include "solver/relative_pose_prior.h"
#include "tests/solver/ceres_window.h"
#include "tests/solver/synthetic_window.h"

namespace parallax {
namespace {

using testing::ceres_smooth_window;
using testing::make_window;
using testing::pose_difference;
using testing::SyntheticWindow;
using testing::WindowScene;

constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();

WindowOptions plain(RobustKernel kernel = RobustKernel::none) {
  WindowOptions options;
  options.kernel = kernel;
  options.estimate_sigma = false;
  options.max_iterations = 200;
  options.relative_cost_tolerance = 1e-14;
  return options;
}

class HomogeneousPointTest : public ::testing::Test {
 protected:
  Eigen::Vector3d vector(double size) { return size * Eigen::Vector3d(normal_(rng_), normal_(rng_), normal_(rng_)); }
  RigidTransform pose() { return {exp_so3(vector(0.2)), vector(0.5)}; }
  std::mt19937 rng_{3};
  std::normal_distribution<double> normal_;
};

TEST_F(HomogeneousPointTest, TheExponentialStaysOnTheSphereAndAddsUpAlongALine) {
  for (const double size : {0.0, 1e-9, 1e-4, 9e-4, 1.1e-3, 0.3, 3.0, 6.2}) {
    const Eigen::Vector3d d = size * vector(1).normalized();
    const Eigen::Vector4d q = sphere_exp(d);
    EXPECT_NEAR(q.norm(), 1, 1e-15);
    EXPECT_LT((sphere_product(sphere_exp(0.4 * d), sphere_exp(0.6 * d)) - q).norm(), 1e-14);
    // As a quaternion it is the rotation by the vector d.
    EXPECT_LT((Eigen::Quaterniond(q).toRotationMatrix() - exp_so3(d)).norm(), 1e-14);
    const Eigen::Vector4d p = Eigen::Vector4d(vector(1).x(), 1, 2, -0.3).normalized();
    EXPECT_LT((move_on_sphere(p, d) - sphere_product(p, q)).norm(), 1e-15);
  }
}

TEST_F(HomogeneousPointTest, DerivativesAreThoseOfCentralDifferences) {
  const StereoCamera camera{512, 384, {400, 410}, {255.5, 191.5}, 0.12};
  const Eigen::Vector3d rays[] = {{0, 0, 1}, {0.6, -0.4, 1}, {-0.6, 0.4, 1}};
  for (const double inverse_depth : {1 / 0.3, 1.0, 0.1, 1e-3, 1e-9, 0.0, -1e-4, -0.02})
    for (const Eigen::Vector3d& ray : rays)
      for (const double sign : {1.0, -1.0})
        for (int repeat = 0; repeat < 3; ++repeat) {
          const RigidTransform T = pose();
          Eigen::Vector4d p;
          p << T.R.transpose() * (ray - inverse_depth * T.t), inverse_depth;
          p *= sign / p.norm();
          Eigen::Vector3d pixel, plus, minus;
          Matrix36d d_pose;
          Eigen::Matrix3d d_point;
          ASSERT_TRUE(project_homogeneous(camera, T, p, &pixel, &d_pose, &d_point));
          // What the Euclidean form says, where it can.
          if (inverse_depth > 1e-8) {
            ASSERT_TRUE(camera.project(T * Eigen::Vector3d(p.head<3>() / p.w()), &plus));
            EXPECT_LT((plus - pixel).norm(), 1e-6);
          }
          EXPECT_NEAR(pixel.x() - pixel.y(), camera.focal_px.x() * camera.baseline_m * inverse_depth, 1e-9);
          constexpr double kStep = 1e-6;
          for (int i = 0; i < 6; ++i) {
            const Vector6d d = kStep * Vector6d::Unit(i);
            ASSERT_TRUE(project_homogeneous(camera, move_pose(d, T), p, &plus));
            ASSERT_TRUE(project_homogeneous(camera, move_pose(-d, T), p, &minus));
            EXPECT_LT(((plus - minus) / (2 * kStep) - d_pose.col(i)).norm(), 1e-5 * (1 + d_pose.norm()));
          }
          for (int i = 0; i < 3; ++i) {
            const Eigen::Vector3d d = kStep * Eigen::Vector3d::Unit(i);
            ASSERT_TRUE(project_homogeneous(camera, T, move_on_sphere(p, d), &plus));
            ASSERT_TRUE(project_homogeneous(camera, T, move_on_sphere(p, -d), &minus));
            EXPECT_LT(((plus - minus) / (2 * kStep) - d_point.col(i)).norm(), 1e-5 * (1 + d_point.norm()));
          }
        }
}

TEST_F(HomogeneousPointTest, APriorsDerivativesAreThoseOfCentralDifferences) {
  for (int repeat = 0; repeat < 20; ++repeat) {
    const RigidTransform a = pose(), b = pose();
    RelativePosePrior prior;
    prior.b_from_a = repeat == 0 ? b * a.inverse() : RigidTransform(exp_so3(vector(0.5)), vector(0.5));
    Matrix6d d_a, d_b;
    solver::prior_residual(prior, a, b, &d_a, &d_b);
    for (int i = 0; i < 6; ++i) {
      const Vector6d d = 1e-6 * Vector6d::Unit(i);
      const auto at = [&](const RigidTransform& x, const RigidTransform& y) {
        return solver::prior_residual(prior, x, y, nullptr, nullptr);
      };
      EXPECT_LT((5e5 * (at(move_pose(d, a), b) - at(move_pose(-d, a), b)) - d_a.col(i)).norm(), 1e-7);
      EXPECT_LT((5e5 * (at(a, move_pose(d, b)) - at(a, move_pose(-d, b))) - d_b.col(i)).norm(), 1e-7);
    }
  }
}

TEST(WindowSmoothing, WithoutNoiseTheTruthComesBack) {
  for (const RobustKernel kernel : {RobustKernel::none, RobustKernel::huber, RobustKernel::tukey}) {
    const SyntheticWindow w = make_window({.mono = 0.3, .infinite = 0.1}, 1);
    WindowProblem problem = w.start;
    // Somewhere else in the world, and every other point with the other sign.
    const RigidTransform moved(exp_so3({0.3, -0.8, 0.1}), {40, -20, 5});
    WindowProblem truth = w.truth;
    for (RigidTransform& pose : truth.poses) pose = pose * moved;
    for (RigidTransform& pose : problem.poses) pose = pose * moved;
    for (std::size_t i = 0; i < problem.points.size(); ++i) {
      for (WindowProblem* p : {&truth, &problem})
        p->points[i] = (i % 2 ? -1 : 1) * camera_point(moved.inverse(), p->points[i]).normalized();
    }
    WindowOptions options;
    options.kernel = kernel;
    options.relative_cost_tolerance = 0;
    const WindowSummary summary = smooth_window(&problem, options);
    EXPECT_TRUE(summary.converged && !summary.failed && !summary.stopped);
    EXPECT_LT(summary.final_cost, 1e-12);
    EXPECT_LE(summary.iterations, 10);
    EXPECT_LT(pose_difference(problem, truth), 1e-9);
    EXPECT_EQ(problem.poses[0].R, truth.poses[0].R);  // fixed
    for (std::size_t i = 0; i < problem.points.size(); ++i) {
      EXPECT_NEAR(problem.points[i].norm(), 1, 1e-14);
      EXPECT_LT(std::min((problem.points[i] - truth.points[i]).norm(), (problem.points[i] + truth.points[i]).norm()),
                1e-9);
    }
  }
}

TEST(WindowSmoothing, ReachesTheEuclideanOptimumOfCeres) {
  const SimdLevel level = simd_level();
  for (const RobustKernel kernel : {RobustKernel::none, RobustKernel::huber}) {
    const SyntheticWindow w = make_window(
        {.noise_px = 0.5, .outliers = kernel == RobustKernel::none ? 0 : 0.05, .mono = 0.1, .seen = 0.8}, 5);
    WindowProblem ours = w.start, slow = w.start, theirs = w.start;
    const WindowOptions options = plain(kernel);
    const WindowSummary a = smooth_window(&ours, options), b = ceres_smooth_window(&theirs, options);
    EXPECT_NEAR(a.initial_cost, b.initial_cost, 1e-8 * b.initial_cost);
    EXPECT_NEAR(a.final_cost, b.final_cost, 1e-9 * b.final_cost);
    EXPECT_LT(pose_difference(ours, theirs), 1e-5);
    set_simd_level(SimdLevel::kScalar);
    const WindowSummary c = smooth_window(&slow, options);
    set_simd_level(level);
    EXPECT_NEAR(c.final_cost, a.final_cost, 1e-9 * a.final_cost);
    EXPECT_LT(pose_difference(ours, slow), 1e-6);
  }
}

// Far away the Euclidean form cannot follow a disparity that noise made negative; the homogeneous one loses nothing.
TEST(WindowSmoothing, FarPointsDoNoWorseThanTheEuclideanForm) {
  const SyntheticWindow w = make_window({.nearest_m = 3, .farthest_m = 2000, .noise_px = 0.5, .start_point = 1e-5}, 9);
  WindowProblem ours = w.start, theirs = w.start;
  for (Eigen::Vector4d& p : theirs.points) p.w() = std::max(p.w(), 1e-4);
  const WindowSummary a = smooth_window(&ours, plain()), b = ceres_smooth_window(&theirs, plain());
  EXPECT_TRUE(a.converged);
  EXPECT_LT(a.iterations, 15);
  EXPECT_LE(a.final_cost, b.final_cost * (1 + 1e-9));
  EXPECT_LT(pose_difference(ours, w.truth), 0.02);
}

TEST(WindowSmoothing, OutliersAreFoundAndDoNotPull) {
  const SyntheticWindow w = make_window({.points = 200, .noise_px = 0.5, .outliers = 0.1}, 11);
  WindowProblem clean = w.start, problem = w.start;
  clean.observations.clear();
  for (std::size_t i = 0; i < w.outlier.size(); ++i)
    if (!w.outlier[i]) clean.observations.push_back(w.start.observations[i]);
  std::vector<std::uint8_t> outlier;
  smooth_window(&clean, plain());
  const WindowSummary summary = smooth_window(&problem, {}, {}, &outlier);
  EXPECT_TRUE(summary.converged);
  EXPECT_LT(summary.sigma, 1.2);
  ASSERT_EQ(outlier.size(), w.outlier.size());
  int wrong = 0;
  for (std::size_t i = 0; i < outlier.size(); ++i) wrong += outlier[i] != w.outlier[i];
  EXPECT_LE(wrong, static_cast<int>(outlier.size()) / 100);
  EXPECT_LT(pose_difference(problem, clean), 0.5 * pose_difference(clean, w.truth));
}

TEST(WindowSmoothing, PointsAtInfinityConstrainTheRotationAlone) {
  const SyntheticWindow w = make_window({.poses = 3, .infinite = 1, .start_point = 0}, 13);
  WindowProblem problem = w.start;
  for (Eigen::Vector4d& p : problem.points) p = -p;
  const WindowSummary summary = smooth_window(&problem, plain());
  EXPECT_FALSE(summary.failed);
  EXPECT_LT(summary.final_cost, 1e-12);
  for (std::size_t i = 1; i < problem.poses.size(); ++i) {
    EXPECT_LT(log_so3(problem.poses[i].R * w.truth.poses[i].R.transpose()).norm(), 1e-9);
    // Nothing pulls at the translation but what w moved by on the way; the rotation alone turned it.
    EXPECT_NEAR(problem.poses[i].t.norm(), w.start.poses[i].t.norm(), 1e-4);
  }
  for (std::size_t i = 0; i < problem.points.size(); ++i)
    EXPECT_LT((problem.points[i] - w.truth.points[i]).norm(), 1e-9) << "direction and sign";
}

TEST(WindowSmoothing, BehindTheCameraNothingPulls) {
  for (const RobustKernel kernel : {RobustKernel::none, RobustKernel::tukey}) {
    const SyntheticWindow w = make_window({}, 17);
    WindowProblem problem = w.start;
    const RigidTransform back = problem.poses[0].inverse();
    for (const double w_sign : {1.0, -1.0}) {  // five metres behind, in either sign
      Eigen::Vector4d p;
      p << back * Eigen::Vector3d(0.2, 0.1, -5), 1;
      problem.points.push_back(w_sign * p.normalized());
      problem.observations.push_back({0, static_cast<int>(problem.points.size()) - 1, {300, 310, 200}, 0.5});
    }
    std::vector<std::uint8_t> outlier;
    WindowOptions options = plain(kernel);
    options.estimate_sigma = true;  // the start is many pixels off
    const WindowSummary summary = smooth_window(&problem, options, {}, &outlier);
    EXPECT_TRUE(summary.converged);
    EXPECT_LT(pose_difference(problem, w.truth), 1e-9);
    for (std::size_t i = 0; i < outlier.size(); ++i) EXPECT_EQ(outlier[i], i + 2 >= outlier.size());
  }
}

TEST(WindowSmoothing, APriorHoldsWhatNothingElseSees) {
  const SyntheticWindow w = make_window({.poses = 4}, 19);
  WindowProblem problem = w.start;
  // A pose that saw nothing, known by its neighbours, and a pair of poses the data and a weak prior agree on.
  problem.poses.push_back(RigidTransform());
  problem.pose_fixed.push_back(0);
  RelativePosePrior prior{3, 4, {exp_so3({0.1, 0, 0.2}), {0.1, 0.2, 0.3}}, 100 * Matrix6d::Identity()};
  problem.priors = {prior, {2, 1, w.truth.poses[1] * w.truth.poses[2].inverse(), Matrix6d::Identity()}};
  const WindowSummary summary = smooth_window(&problem, plain());
  EXPECT_TRUE(summary.converged);
  const RigidTransform error = problem.poses[4] * problem.poses[3].inverse() * prior.b_from_a.inverse();
  EXPECT_LT(error.log().norm(), 1e-8);
  std::vector<Matrix6d> covariance;
  ASSERT_TRUE(window_covariance(problem, plain(), {{3, 4}}, &covariance));
  EXPECT_LT((covariance[0] - 0.01 * Matrix6d::Identity()).norm(), 1e-9);
  problem.priors.clear();
  EXPECT_FALSE(window_covariance(problem, plain(), {{3, 4}}, &covariance));
}

TEST(WindowSmoothing, ADogLegIsTakenWhereGaussNewtonOvershoots) {
  const SyntheticWindow w = make_window({.start_m = 0.15, .start_rad = 0.1, .start_point = 0.1}, 23);
  for (const double radius : {1e4, 50.0}) {
    WindowProblem problem = w.start;
    WindowOptions options = plain();
    options.initial_trust_radius = radius;
    const WindowSummary summary = smooth_window(&problem, options);
    EXPECT_LT(summary.final_cost, 1e-10) << summary.iterations;
    if (radius < 100) {
      EXPECT_GT(summary.dog_leg_steps, 0);
    }
    EXPECT_LT(pose_difference(problem, w.truth), 1e-8);
  }
}

// The information of all poses but the first and of all points, from the plain derivatives, inverted as it is.
TEST(WindowCovariance, IsTheDenseInverse) {
  const SyntheticWindow w = make_window({.poses = 5, .points = 40, .noise_px = 0.5, .mono = 0.2}, 29);
  WindowProblem problem = w.start;
  smooth_window(&problem, plain());
  problem.pose_fixed[3] = 1;  // only the first fixed pose is the gauge
  problem.priors = {{1, 4, problem.poses[4] * problem.poses[1].inverse(), 1e3 * Matrix6d::Identity()}};
  const auto poses = static_cast<int>(problem.poses.size()), n = 6 * poses + 3 * 40;
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n, n);
  const auto add = [&](const Eigen::MatrixXd& j) { information += j.transpose() * j; };
  for (const StereoObservation& o : problem.observations) {
    Eigen::Vector3d pixel;
    Matrix36d d_pose;
    Eigen::Matrix3d d_point;
    ASSERT_TRUE(project_homogeneous(problem.camera, problem.poses[std::size_t(o.pose)],
                                    problem.points[std::size_t(o.point)], &pixel, &d_pose, &d_point));
    Eigen::MatrixXd j = Eigen::MatrixXd::Zero(3, n);
    j.middleCols<6>(6 * o.pose) = d_pose / o.sigma_px;
    j.middleCols<3>(6 * poses + 3 * o.point) = d_point / o.sigma_px;
    if (std::isnan(o.pixel.y())) j.row(1).setZero();
    add(j);
  }
  Matrix6d d_a, d_b;
  solver::prior_residual(problem.priors[0], problem.poses[1], problem.poses[4], &d_a, &d_b);
  Eigen::MatrixXd j = Eigen::MatrixXd::Zero(6, n);
  j.middleCols<6>(6) = std::sqrt(1e3) * d_a;
  j.middleCols<6>(24) = std::sqrt(1e3) * d_b;
  add(j);
  const Eigen::MatrixXd inverse =
      information.bottomRightCorner(n - 6, n - 6).llt().solve(Eigen::MatrixXd::Identity(n - 6, n - 6));
  const std::vector<std::pair<int, int>> pairs = {{0, 4}, {1, 3}, {4, 2}, {3, 0}};
  std::vector<Matrix6d> covariance;
  ASSERT_TRUE(window_covariance(problem, plain(), pairs, &covariance));
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const auto [a, b] = pairs[k];
    Eigen::MatrixXd map = Eigen::MatrixXd::Zero(6, n);
    map.middleCols<6>(6 * b).setIdentity();
    map.middleCols<6>(6 * a) = -(problem.poses[std::size_t(b)] * problem.poses[std::size_t(a)].inverse()).adjoint();
    const Eigen::MatrixXd expected = map.rightCols(n - 6) * inverse * map.rightCols(n - 6).transpose();
    EXPECT_LT((covariance[k] - expected).norm(), 1e-8 * expected.norm());
  }
}

TEST(WindowCovariance, IsTheSpreadOfTheResults) {
  constexpr int kRuns = 200;
  double sum = 0;
  for (unsigned run = 0; run < kRuns; ++run) {
    const SyntheticWindow w = make_window(
        {.poses = 5, .points = 50, .noise_px = 0.5, .mono = 0.1, .start_m = 0.01, .start_point = 1e-3}, 1000 + run);
    WindowProblem problem = w.start;
    ASSERT_TRUE(smooth_window(&problem, plain()).converged);
    std::vector<Matrix6d> covariance;
    ASSERT_TRUE(window_covariance(problem, plain(), {{1, 4}}, &covariance));
    const Vector6d error =
        (problem.poses[4] * problem.poses[1].inverse() * (w.truth.poses[4] * w.truth.poses[1].inverse()).inverse())
            .log();
    sum += error.dot(covariance[0].llt().solve(error));
  }
  const ChiSquareBounds bounds = chi_square_bounds_95(6 * kRuns);
  EXPECT_GT(sum, bounds.low);
  EXPECT_LT(sum, bounds.high);
}

TEST(WindowSmoothing, StopsWhenAskedTo) {
  const SyntheticWindow w = make_window({.noise_px = 0.5}, 31);
  WindowProblem problem = w.start;
  std::stop_source source;
  source.request_stop();
  WindowSummary summary = smooth_window(&problem, {}, source.get_token());
  EXPECT_TRUE(summary.stopped && !summary.failed && !summary.converged);
  EXPECT_EQ(summary.iterations, 0);
  for (std::size_t i = 0; i < problem.poses.size(); ++i) EXPECT_EQ(problem.poses[i].R, w.start.poses[i].R);
  summary = smooth_window(&problem, {}, Interruption::at_poll(3));  // two questions an iteration
  EXPECT_TRUE(summary.stopped);
  EXPECT_EQ(summary.iterations, 1);
  EXPECT_LT(summary.final_cost, summary.initial_cost);
}

TEST(WindowSmoothing, BadInputChangesNothing) {
  const SyntheticWindow w = make_window({.poses = 3, .points = 20}, 37);
  std::vector<WindowProblem> bad(9, w.start);
  bad[0].observations[4].pixel.x() = kNotANumber;
  bad[1].observations[4].sigma_px = 0;
  bad[2].points[3].setZero();
  bad[3].poses[1].t.y() = kNotANumber;
  bad[4].camera.focal_px.x() = 0;
  bad[5].observations.clear();
  bad[6].observations[2].pixel.y() = std::numeric_limits<double>::infinity();
  for (RigidTransform& pose : bad[7].poses)
    pose = RigidTransform(exp_so3({0, 3.14159, 0}), Eigen::Vector3d::Zero()) * pose;  // looks away
  bad[8].priors.push_back({0, 1, {}, kNotANumber * Matrix6d::Identity()});
  for (std::size_t i = 0; i < bad.size(); ++i) {
    const WindowProblem before = bad[i];
    EXPECT_TRUE(smooth_window(&bad[i], plain()).failed) << i;
    std::vector<Matrix6d> covariance(1, Matrix6d::Zero());
    EXPECT_FALSE(window_covariance(bad[i], plain(), {{0, 1}}, &covariance)) << i;
    EXPECT_EQ(covariance.size(), 1u);
    for (std::size_t k = 0; k < before.points.size(); ++k) EXPECT_EQ(bad[i].points[k], before.points[k]);
    for (std::size_t k = 0; k < before.poses.size(); ++k) {
      EXPECT_EQ(bad[i].poses[k].R, before.poses[k].R);
      EXPECT_EQ(bad[i].poses[k].t.x(), before.poses[k].t.x());
    }
  }
  // A point that one camera alone sees, once, is no reason to fail, and says nothing.
  WindowProblem lone = w.start;
  lone.points.push_back(Eigen::Vector4d(0, 0, 1, 0.2).normalized());
  lone.observations.push_back({1, static_cast<int>(lone.points.size()) - 1, {200, kNotANumber, 100}, 0.5});
  WindowOptions options = plain();
  options.relative_cost_tolerance = 0;
  EXPECT_TRUE(smooth_window(&lone, options).converged);
  EXPECT_LT(pose_difference(lone, w.truth), 1e-8);
}

TEST(ChiSquare, BoundsAreThoseOfTheTables) {
  const double table[][3] = {{3, 0.2158, 9.3484},
                             {6, 1.2373, 14.4494},
                             {10, 3.2470, 20.4832},
                             {100, 74.2219, 129.5612},
                             {1000, 914.257, 1089.531}};
  for (const auto& [dof, low, high] : table) {
    const ChiSquareBounds bounds = chi_square_bounds_95(dof);
    EXPECT_NEAR(bounds.low, low, (dof < 10 ? 0.16 : 0.008) * low);
    EXPECT_NEAR(bounds.high, high, 0.005 * high);
  }
}

}  // namespace
}  // namespace parallax
