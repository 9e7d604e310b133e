#include "mapper/triangulation.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "mapper/two_view.h"

namespace parallax {
namespace {

Eigen::Vector3d ray(const Eigen::Vector3d& p) { return p / p.z(); }

double reprojection_cost(const RigidTransform& T, const Eigen::Vector3d& r1, const Eigen::Vector3d& r2,
                         const Eigen::Vector3d& x) {
  return (ray(x) - r1).squaredNorm() + (ray(T * x) - r2).squaredNorm();
}

class Triangulation : public ::testing::Test {
 protected:
  double uniform(double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(rng_); }
  RigidTransform pose() {
    return {exp_so3(Eigen::Vector3d(uniform(-0.3, 0.3), uniform(-0.3, 0.3), uniform(-0.3, 0.3))),
            Eigen::Vector3d(uniform(-0.3, 0.3), uniform(-0.3, 0.3), uniform(-0.3, 0.3))};
  }
  Eigen::Vector3d point() {
    const double z = uniform(0.8, 4);
    return {z * uniform(-0.9, 0.9), z * uniform(-0.7, 0.7), z};
  }
  std::mt19937_64 rng_{5};
};

TEST_F(Triangulation, ExactRaysGiveThePoint) {
  int tried = 0;
  for (int k = 0; k < 3000; ++k) {
    const RigidTransform T = pose();
    const Eigen::Vector3d x = point(), second = T * x;
    if (second.z() < 0.3 || parallax_angle(T, ray(x), ray(second)) < 0.005) continue;
    ++tried;
    Eigen::Vector3d found;
    ASSERT_TRUE(triangulate(T, ray(x), ray(second), &found));
    EXPECT_LT((found - x).norm(), 1e-9 * x.norm() / 0.005);
    double z1 = 0, z2 = 0;
    ASSERT_TRUE(ray_depths(T, ray(x), ray(second), &z1, &z2));
    EXPECT_NEAR(z1, x.z(), 1e-7);
    EXPECT_NEAR(z2, second.z(), 1e-7);
  }
  EXPECT_GT(tried, 2500);
}

TEST_F(Triangulation, NoisyRaysComeWithinAHairOfTheReprojectionOptimum) {
  for (int k = 0; k < 500; ++k) {
    const RigidTransform T = pose();
    const Eigen::Vector3d x = point(), second = T * x;
    if (second.z() < 0.3 || parallax_angle(T, ray(x), ray(second)) < 0.03) continue;
    Eigen::Vector3d r1 = ray(x), r2 = ray(second);
    for (int c = 0; c < 2; ++c) {
      r1(c) += uniform(-0.002, 0.002);
      r2(c) += uniform(-0.002, 0.002);
    }
    Eigen::Vector3d found;
    ASSERT_TRUE(triangulate(T, r1, r2, &found));
    // Slow reference: pattern search on the cost itself.
    Eigen::Vector3d best = found;
    double cost = reprojection_cost(T, r1, r2, best);
    for (double step = 0.02; step > 1e-8; step *= 0.5)
      for (bool improved = true; improved;) {
        improved = false;
        for (int d = 0; d < 26; ++d) {
          const int code = d < 13 ? d : d + 1;
          const Eigen::Vector3d trial =
              best + step * Eigen::Vector3d(code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1).cwiseProduct(ray(best));
          const double c = reprojection_cost(T, r1, r2, trial);
          if (c < cost * (1 - 1e-12)) {
            cost = c;
            best = trial;
            improved = true;
          }
        }
      }
    EXPECT_LE(reprojection_cost(T, r1, r2, found), 1.001 * cost + 1e-14);
  }
}

TEST_F(Triangulation, RefusesParallelRaysAndPointsBehind) {
  Eigen::Vector3d found;
  const RigidTransform sideways(Eigen::Matrix3d::Identity(), Eigen::Vector3d(-1, 0, 0));
  const Eigen::Vector3d centre(0, 0, 1);
  EXPECT_FALSE(triangulate(sideways, centre, centre, &found));
  EXPECT_FALSE(triangulate(sideways, centre, Eigen::Vector3d(5e-7, 0, 1), &found));
  // The camera moved right, so points move left: a match that moved right lies behind both.
  EXPECT_TRUE(triangulate(sideways, centre, Eigen::Vector3d(-0.1, 0, 1), &found));
  EXPECT_NEAR(found.z(), 10.0, 1e-9);
  EXPECT_FALSE(triangulate(sideways, centre, Eigen::Vector3d(0.1, 0, 1), &found));
  EXPECT_FALSE(triangulate(RigidTransform(), centre, Eigen::Vector3d(0.1, 0, 1), &found));
}

TEST_F(Triangulation, ParallaxAngleIsTheAngleAtThePoint) {
  const RigidTransform T(exp_so3(Eigen::Vector3d(0.1, -0.2, 0.05)), Eigen::Vector3d(-0.1, 0.02, 0.03));
  const Eigen::Vector3d x(0.2, -0.1, 1.0), centre2 = T.inverse().t;
  const double expected = std::acos(x.normalized().dot((x - centre2).normalized()));
  EXPECT_NEAR(parallax_angle(T, ray(x), ray(T * x)), expected, 1e-9);
}

}  // namespace
}  // namespace parallax
