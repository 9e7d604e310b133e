#include "mapper/five_point.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>
#include <random>

#include "mapper/triangulation.h"

namespace parallax {
namespace {

enum class Scene { general, planar, forward, sideways, near_plane_parallel };

struct Problem {
  std::array<Eigen::Vector3d, 5> rays1, rays2;
  RigidTransform pose;
};

class Generator {
 public:
  explicit Generator(std::uint64_t seed) : rng_(seed) {}
  double uniform(double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(rng_); }
  Eigen::Vector3d vector(double size) { return {uniform(-size, size), uniform(-size, size), uniform(-size, size)}; }

  Problem draw(Scene scene) {
    Problem p;
    const double angle = scene == Scene::sideways ? 0.0 : 0.3;
    p.pose.R = exp_so3(vector(angle));
    p.pose.t = vector(1.0).normalized();
    if (scene == Scene::forward) p.pose.t = Eigen::Vector3d(0, 0, -1);
    if (scene == Scene::sideways || scene == Scene::near_plane_parallel) p.pose.t = Eigen::Vector3d(-1, 0, 0);
    Eigen::Vector3d normal(uniform(-0.5, 0.5), uniform(-0.5, 0.5), 1);
    if (scene == Scene::near_plane_parallel) normal = Eigen::Vector3d::UnitZ();
    for (std::size_t i = 0; i < 5;) {
      p.rays1[i] = Eigen::Vector3d(uniform(-1, 1), uniform(-0.75, 0.75), 1);
      double depth = uniform(3, 10);
      if (scene == Scene::planar || scene == Scene::near_plane_parallel) depth = 6.0 / normal.dot(p.rays1[i]);
      const Eigen::Vector3d second = p.pose * (depth * p.rays1[i]);
      if (!(depth > 0) || second.z() < 0.5) continue;
      p.rays2[i] = second / second.z();
      ++i;
    }
    return p;
  }

 private:
  std::mt19937_64 rng_;
};

double difference(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  const Eigen::Matrix3d x = a / a.norm(), y = b / b.norm();
  return std::min((x - y).norm(), (x + y).norm());
}

class FivePointScenes : public ::testing::TestWithParam<Scene> {};

TEST_P(FivePointScenes, TruthIsAmongTheSolutions) {
  constexpr int kDraws = 4000;
  Generator generator(7);
  int found = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    const Problem p = generator.draw(GetParam());
    FivePointSolutions solutions;
    solve_five_point(p.rays1, p.rays2, &solutions);
    const Eigen::Matrix3d truth = essential_of_pose(p.pose);
    double best = 1;
    for (int s = 0; s < solutions.count; ++s)
      best = std::min(best, difference(truth, solutions.essential[static_cast<std::size_t>(s)]));
    found += best < 1e-6 ? 1 : 0;
  }
  EXPECT_GE(found, kDraws * 995 / 1000);
  RecordProperty("found", found);
}

TEST_P(FivePointScenes, EverySolutionIsEssentialAndFitsTheRays) {
  Generator generator(11);
  int count = 0;
  for (int draw = 0; draw < 500; ++draw) {
    const Problem p = generator.draw(GetParam());
    FivePointSolutions solutions;
    solve_five_point(p.rays1, p.rays2, &solutions);
    ASSERT_LE(solutions.count, 10);
    for (int s = 0; s < solutions.count; ++s, ++count) {
      const Eigen::Matrix3d& E = solutions.essential[static_cast<std::size_t>(s)];
      EXPECT_NEAR(E.norm(), 1.0, 1e-9);
      const Eigen::Vector3d singular = Eigen::JacobiSVD<Eigen::Matrix3d>(E).singularValues();
      EXPECT_NEAR(singular(0), singular(1), 1e-6);
      EXPECT_NEAR(singular(2), 0.0, 1e-7);
      for (std::size_t i = 0; i < 5; ++i) EXPECT_NEAR(p.rays2[i].dot(E * p.rays1[i]), 0.0, 1e-9);
    }
  }
  EXPECT_GT(count, 500);
}

INSTANTIATE_TEST_SUITE_P(Scenes, FivePointScenes,
                         ::testing::Values(Scene::general, Scene::planar, Scene::forward, Scene::sideways,
                                           Scene::near_plane_parallel));

TEST(FivePoint, RandomRaysGiveDistinctSolutions) {
  Generator generator(3);
  int total = 0;
  for (int draw = 0; draw < 500; ++draw) {
    std::array<Eigen::Vector3d, 5> a, b;
    for (std::size_t i = 0; i < 5; ++i) {
      a[i] = generator.vector(1.0);
      b[i] = generator.vector(1.0);
    }
    FivePointSolutions solutions;
    solve_five_point(a, b, &solutions);
    total += solutions.count;
    for (int s = 0; s < solutions.count; ++s)
      for (int k = 0; k < s; ++k)
        EXPECT_GT(difference(solutions.essential[static_cast<std::size_t>(s)],
                             solutions.essential[static_cast<std::size_t>(k)]),
                  1e-7);
  }
  EXPECT_GT(total, 1000);  // 4 on average for random rays
}

TEST(FivePoint, DegenerateInputDoesNotGiveNonsense) {
  FivePointSolutions solutions;
  std::array<Eigen::Vector3d, 5> same;
  same.fill(Eigen::Vector3d(0.1, 0.2, 1));
  solve_five_point(same, same, &solutions);
  for (int s = 0; s < solutions.count; ++s) EXPECT_TRUE(solutions.essential[static_cast<std::size_t>(s)].allFinite());
  std::array<Eigen::Vector3d, 5> zero;
  zero.fill(Eigen::Vector3d::Zero());
  solve_five_point(zero, zero, &solutions);
  for (int s = 0; s < solutions.count; ++s) EXPECT_TRUE(solutions.essential[static_cast<std::size_t>(s)].allFinite());
}

TEST(EssentialDecomposition, ContainsTheTruePoseAndOnlyProperRotations) {
  Generator generator(5);
  for (int draw = 0; draw < 1000; ++draw) {
    const Problem p = generator.draw(draw % 2 == 0 ? Scene::general : Scene::sideways);
    const Eigen::Matrix3d E = essential_of_pose(p.pose) * generator.uniform(-3, 3);
    double best = 10;
    int in_front = 0;
    for (const RigidTransform& pose : poses_of_essential(E)) {
      EXPECT_NEAR(pose.R.determinant(), 1.0, 1e-9);
      EXPECT_NEAR((pose.R * pose.R.transpose() - Eigen::Matrix3d::Identity()).norm(), 0.0, 1e-9);
      EXPECT_NEAR(pose.t.norm(), 1.0, 1e-9);
      EXPECT_LT(difference(essential_of_pose(pose), E), 1e-9);
      best = std::min(best, (pose.R - p.pose.R).norm() + (pose.t - p.pose.t).norm());
      bool all = true;
      for (std::size_t i = 0; i < 5; ++i) {
        double z1 = 0, z2 = 0;
        all = all && ray_depths(pose, p.rays1[i], p.rays2[i], &z1, &z2) && z1 > 0 && z2 > 0;
      }
      in_front += all ? 1 : 0;
    }
    EXPECT_LT(best, 1e-8);
    EXPECT_EQ(in_front, 1);
  }
}

}  // namespace
}  // namespace parallax
