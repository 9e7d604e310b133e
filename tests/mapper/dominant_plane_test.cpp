#include "mapper/dominant_plane.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <random>

namespace parallax {
namespace {

class DominantPlaneTest : public ::testing::Test {
 protected:
  double uniform(double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(rng_); }
  double gauss(double sigma) { return std::normal_distribution<double>(0, sigma)(rng_); }

  // Points on a patch of the plane through `centre` with the given unit normal.
  void add_patch(int n, const Eigen::Vector3d& centre, const Eigen::Vector3d& normal, double noise) {
    const Eigen::Vector3d u = normal.unitOrthogonal(), v = normal.cross(u);
    for (int i = 0; i < n; ++i)
      points_.push_back(centre + uniform(-0.5, 0.5) * u + uniform(-0.4, 0.4) * v + gauss(noise) * normal);
  }
  void add_clutter(int n) {
    for (int i = 0; i < n; ++i) points_.emplace_back(uniform(-0.6, 0.6), uniform(-0.6, 0.6), uniform(0.4, 1.6));
  }
  std::optional<DominantPlane> find() {
    std::mt19937_64 generator(3);
    return find_dominant_plane(points_, viewer_, right_, options_, &generator);
  }

  std::vector<Eigen::Vector3d> points_;
  Eigen::Vector3d viewer_ = Eigen::Vector3d::Zero(), right_ = Eigen::Vector3d::UnitX();
  PlaneOptions options_;
  std::mt19937_64 rng_{9};
};

double angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

TEST_F(DominantPlaneTest, ExactPlaneIsFoundExactlyAndOriented) {
  for (int draw = 0; draw < 100; ++draw) {
    points_.clear();
    // The desk below and ahead: the normal that faces the viewer has a negative component along the view.
    const Eigen::Vector3d normal = Eigen::Vector3d(uniform(-0.7, 0.7), uniform(-0.7, 0.7), -1).normalized();
    const Eigen::Vector3d centre(uniform(-0.1, 0.1), uniform(-0.1, 0.1), 1.0);
    add_patch(200, centre, normal, 0);
    const auto plane = find();
    ASSERT_TRUE(plane);
    const Eigen::Matrix3d& R = plane->world_from_plane.R;
    EXPECT_NEAR(R.determinant(), 1.0, 1e-9);
    EXPECT_LT((R.transpose() * R - Eigen::Matrix3d::Identity()).norm(), 1e-9);
    EXPECT_LT(angle(R.col(2), normal), 1e-7);
    EXPECT_GT(R.col(2).dot(viewer_ - plane->world_from_plane.t), 0);
    EXPECT_GT(R.col(0).dot(right_), 0);
    EXPECT_NEAR(R.col(1).dot(right_), 0.0, 1e-9);  // x is the viewer's right projected into the plane
    EXPECT_EQ(plane->inliers, 200);
    EXPECT_LT(plane->rms_m, 1e-9);
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const auto& p : points_) mean += p / 200.0;
    EXPECT_LT((plane->world_from_plane.t - mean).norm(), 1e-9);
    for (const auto& p : points_) EXPECT_NEAR((plane->world_from_plane.inverse() * p).z(), 0.0, 1e-9);
  }
}

TEST_F(DominantPlaneTest, NormalPointsToTheViewerFromEitherSide) {
  add_patch(100, Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0, 0, 1), 0);
  ASSERT_TRUE(find());
  EXPECT_LT(find()->world_from_plane.R(2, 2), 0);
  viewer_ = Eigen::Vector3d(0, 0, 2);
  ASSERT_TRUE(find());
  EXPECT_GT(find()->world_from_plane.R(2, 2), 0);
}

TEST_F(DominantPlaneTest, NoiseAndHalfOutliers) {
  int good = 0;
  for (int draw = 0; draw < 100; ++draw) {
    points_.clear();
    const Eigen::Vector3d normal = Eigen::Vector3d(uniform(-0.7, 0.7), uniform(-0.7, 0.7), -1).normalized();
    add_patch(200, Eigen::Vector3d(0, 0, 1), normal, 0.004);
    add_clutter(200);
    const auto plane = find();
    ASSERT_TRUE(plane);
    good += angle(plane->world_from_plane.R.col(2), normal) < 1.0 * M_PI / 180 ? 1 : 0;
    int kept = 0;
    for (std::size_t i = 0; i < 200; ++i) kept += plane->inlier[i];
    EXPECT_GE(kept, 190);
    EXPECT_GT(plane->rms_m, 0.003);
    EXPECT_LT(plane->rms_m, 0.009);
    int counted = 0;
    for (const auto flag : plane->inlier) counted += flag;
    EXPECT_EQ(counted, plane->inliers);
  }
  EXPECT_GE(good, 99);
}

TEST_F(DominantPlaneTest, TheBiggerOfTwoPlanesWins) {
  for (int draw = 0; draw < 50; ++draw) {
    points_.clear();
    const Eigen::Vector3d desk(0, -0.8, -0.6), wall(0, 0, -1);
    add_patch(120, Eigen::Vector3d(0, 0.2, 1), desk, 0.003);
    add_patch(80, Eigen::Vector3d(0, -0.3, 1.5), wall, 0.003);
    const auto plane = find();
    ASSERT_TRUE(plane);
    EXPECT_LT(angle(plane->world_from_plane.R.col(2), desk), 0.03);
  }
}

TEST_F(DominantPlaneTest, NothingWithoutAPlane) {
  EXPECT_FALSE(find());
  points_ = {{0, 0, 1}, {0.1, 0, 1}};
  EXPECT_FALSE(find());
  points_.clear();
  for (int i = 0; i < 100; ++i) points_.emplace_back(0.01 * i, 0.005 * i, 1 + 0.002 * i);
  EXPECT_FALSE(find()) << "a line has no plane";
  points_.assign(50, Eigen::Vector3d(0.1, 0.2, 1));
  EXPECT_FALSE(find()) << "one point has no plane";
  points_.clear();
  for (int i = 0; i < 600; ++i) points_.emplace_back(uniform(-1, 1), uniform(-1, 1), uniform(0.2, 2.2));
  EXPECT_FALSE(find()) << "a cloud has no dominant plane";
}

TEST_F(DominantPlaneTest, NonFinitePointsAreNeverInliers) {
  add_patch(100, Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0, 0, -1), 0.001);
  points_.emplace_back(NAN, 0, 1);
  const auto plane = find();
  ASSERT_TRUE(plane);
  EXPECT_EQ(plane->inlier.back(), 0);
  EXPECT_EQ(plane->inliers, 100);
}

TEST_F(DominantPlaneTest, SameSeedSameAnswer) {
  add_patch(100, Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0, 0.6, -0.8), 0.004);
  add_clutter(80);
  const auto a = find(), b = find();
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->world_from_plane.R, b->world_from_plane.R);
  EXPECT_EQ(a->inlier, b->inlier);
}

}  // namespace
}  // namespace parallax
