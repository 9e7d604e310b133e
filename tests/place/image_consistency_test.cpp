#include "place/image_consistency.h"

#include <gtest/gtest.h>

#include "place/place_memory.h"
#include "render/synthetic_source.h"

namespace parallax {
namespace {

std::vector<PlaceFeature> features_of(const Frame& frame) {
  ImagePyramid pyramid;
  build_pyramid(frame.grey, &pyramid);
  return extract_place_features(pyramid);
}

Eigen::Matrix3d cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

TEST(ImageConsistency, EightPointsGiveTheTrueEpipolarGeometry) {
  std::mt19937_64 rng(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  const RigidTransform b_from_a(exp_so3(Eigen::Vector3d(0.1, -0.2, 0.3)), {0.4, 0.1, -0.2});
  Eigen::Matrix3d K;
  K << 500, 0, 320, 0, 510, 240, 0, 0, 1;
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> pairs;
  for (int i = 0; i < 40; ++i) {
    const Eigen::Vector3d p(unit(rng), unit(rng), 3 + unit(rng));
    pairs.emplace_back((K * p).hnormalized(), (K * (b_from_a * p)).hnormalized());
  }
  Eigen::Matrix3d F, truth = K.inverse().transpose() * cross(b_from_a.t) * b_from_a.R * K.inverse();
  ASSERT_TRUE(solve_fundamental(pairs, &F));
  F /= F.norm();
  truth /= truth.norm();
  EXPECT_LT(std::min((F - truth).norm(), (F + truth).norm()), 1e-9);
  EXPECT_NEAR(F.determinant(), 0, 1e-15);
  pairs.resize(7);
  EXPECT_FALSE(solve_fundamental(pairs, &F));
  pairs.assign(20, pairs[0]);
  EXPECT_FALSE(solve_fundamental(pairs, &F)) << "one point twenty times";
}

TEST(ImageConsistency, OneDeskFromTwoPlacesAndTwoDesks) {
  auto desk = open_synthetic_source("synthetic:desk?seed=4"), other = open_synthetic_source("synthetic:desk?seed=5");
  const std::vector<PlaceFeature> a = features_of(desk->frame(130)), b = features_of(desk->frame(160)),
                                  c = features_of(other->frame(160));
  ImageConsistencyOptions options;
  std::mt19937_64 rng(1);
  const ImageConsistency same = check_image_consistency(a, b, options, &rng);
  const ImageConsistency different = check_image_consistency(a, c, options, &rng);
  EXPECT_GE(same.inliers, 60);
  EXPECT_GE(same.inliers, 0.7 * same.matches);
  EXPECT_LE(different.inliers, same.inliers / 3);

  // The matches are the same things: each feature of a, carried over with the true depth and motion, is where its
  // match is.
  const CameraModel camera = *desk->calibration();
  const cv::Mat1f depth = desk->depth(130);
  const RigidTransform b_from_a = desk->world_from_camera(160).inverse() * desk->world_from_camera(130);
  int right = 0, all = 0;
  for (const auto& [i, j] : match_place_features(a, b, options)) {
    const PlaceFeature &fa = a[static_cast<std::size_t>(i)], &fb = b[static_cast<std::size_t>(j)];
    const float z = depth(static_cast<int>(fa.pixel.y()), static_cast<int>(fa.pixel.x()));
    Eigen::Vector3d ray;
    Eigen::Vector2d there;
    if (z <= 0 || !camera.unproject(fa.pixel.cast<double>(), &ray)) continue;
    ++all;
    right += camera.project(b_from_a * (ray * (z / ray.z())), &there) &&
             (there - fb.pixel.cast<double>()).norm() < 4 * level_scale(std::max(fa.level, fb.level));
  }
  ASSERT_GE(all, 80);
  EXPECT_GE(right, 0.8 * all);
}

TEST(ImageConsistency, NothingToMatchIsNoPlace) {
  const ImageConsistencyOptions options;
  std::mt19937_64 rng(1);
  const std::vector<PlaceFeature> none, some = features_of(open_synthetic_source("synthetic:desk")->frame(0));
  EXPECT_EQ(check_image_consistency(none, some, options, &rng).matches, 0);
  EXPECT_EQ(check_image_consistency(some, none, options, &rng).inliers, 0);
  const std::vector<PlaceFeature> few(some.begin(), some.begin() + 5);
  EXPECT_EQ(check_image_consistency(few, few, options, &rng).inliers, 0);
}

}  // namespace
}  // namespace parallax
