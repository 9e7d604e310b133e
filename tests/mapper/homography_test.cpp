#include "mapper/homography.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <random>
#include <vector>

namespace parallax {
namespace {

struct PlanarProblem {
  RigidTransform pose;
  Eigen::Vector3d normal;  // n . X = d
  double d = 1;
  std::vector<Eigen::Vector3d> rays1, rays2;
  Eigen::Matrix3d H;
};

class Homography : public ::testing::Test {
 protected:
  double uniform(double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(rng_); }

  PlanarProblem draw(int n) {
    PlanarProblem p;
    p.pose.R = exp_so3(Eigen::Vector3d(uniform(-0.3, 0.3), uniform(-0.3, 0.3), uniform(-0.3, 0.3)));
    p.pose.t = Eigen::Vector3d(uniform(-0.4, 0.4), uniform(-0.4, 0.4), uniform(-0.4, 0.4));
    p.normal = Eigen::Vector3d(uniform(-0.6, 0.6), uniform(-0.6, 0.6), 1).normalized();
    p.d = uniform(0.8, 2);
    p.H = p.pose.R + p.pose.t / p.d * p.normal.transpose();
    while (static_cast<int>(p.rays1.size()) < n) {
      const Eigen::Vector3d r(uniform(-0.8, 0.8), uniform(-0.6, 0.6), 1);
      const double depth = p.d / p.normal.dot(r);
      const Eigen::Vector3d second = p.pose * (depth * r);
      if (depth <= 0 || second.z() < 0.2) continue;
      p.rays1.push_back(r);
      p.rays2.push_back(second / second.z());
    }
    return p;
  }

  std::mt19937_64 rng_{17};
};

TEST_F(Homography, FourPairsGiveTheExactHomographyWithItsSign) {
  int thin = 0;
  for (int k = 0; k < 2000; ++k) {
    const PlanarProblem p = draw(4);
    Eigen::Matrix3d H;
    ASSERT_TRUE(fit_homography(p.rays1, p.rays2, &H));
    const double error = (H - p.H / p.H.norm()).norm();
    thin += error > 1e-8 ? 1 : 0;  // nearly collinear draws lose digits
    EXPECT_LT(error, 1e-3);
  }
  EXPECT_LE(thin, 20);
}

TEST_F(Homography, ManyPairsGiveTheLeastSquaresHomography) {
  for (int k = 0; k < 200; ++k) {
    PlanarProblem p = draw(40);
    Eigen::Matrix3d H;
    ASSERT_TRUE(fit_homography(p.rays1, p.rays2, &H));
    EXPECT_LT((H - p.H / p.H.norm()).norm(), 1e-6);
    // Noise of a pixel or so moves it only a little.
    for (auto& r : p.rays2) r.head<2>() += Eigen::Vector2d(uniform(-0.002, 0.002), uniform(-0.002, 0.002));
    ASSERT_TRUE(fit_homography(p.rays1, p.rays2, &H));
    EXPECT_LT((H - p.H / p.H.norm()).norm(), 0.01);
  }
}

TEST_F(Homography, RefusesTooFewAndCollinear) {
  PlanarProblem p = draw(4);
  Eigen::Matrix3d H;
  EXPECT_FALSE(fit_homography(std::span(p.rays1).first(3), std::span(p.rays2).first(3), &H));
  p.rays1[2] = 0.5 * (p.rays1[0] + p.rays1[1]);
  p.rays2[2] = 0.5 * (p.rays2[0] + p.rays2[1]);
  EXPECT_FALSE(fit_homography(p.rays1, p.rays2, &H));
  std::vector<Eigen::Vector3d> line;
  for (int i = 0; i < 20; ++i) line.emplace_back(0.05 * i - 0.5, 0.02 * i, 1);
  EXPECT_FALSE(fit_homography(line, line, &H));
}

TEST_F(Homography, DecompositionContainsTheTruthAndReproducesTheHomography) {
  for (int k = 0; k < 2000; ++k) {
    const PlanarProblem p = draw(12);
    std::array<PlanarPose, 4> poses;
    ASSERT_EQ(decompose_homography(p.H * uniform(0.1, 5), &poses), 4);
    double best = 100;
    int in_front = 0;
    for (const PlanarPose& pose : poses) {
      const RigidTransform& T = pose.second_from_first;
      EXPECT_NEAR(T.R.determinant(), 1.0, 1e-9);
      EXPECT_LT((T.R + T.t * pose.normal.transpose() - p.H).norm(), 1e-6);
      best = std::min(best, (T.R - p.pose.R).norm() + (T.t - p.pose.t / p.d).norm() + (pose.normal - p.normal).norm());
      bool all = true;
      for (const auto& r : p.rays1) all = all && plane_in_front(pose, r);
      in_front += all ? 1 : 0;
    }
    EXPECT_LT(best, 1e-5) << "draw " << k;
    EXPECT_GE(in_front, 1);
    EXPECT_LE(in_front, 2);
  }
}

TEST_F(Homography, PureRotationHasNoDecomposition) {
  std::array<PlanarPose, 4> poses;
  EXPECT_EQ(decompose_homography(exp_so3(Eigen::Vector3d(0.1, 0.2, -0.3)) * 0.7, &poses), 0);
}

}  // namespace
}  // namespace parallax
