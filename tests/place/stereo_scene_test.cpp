#include "place/stereo_scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "render/synthetic_stereo_source.h"

namespace parallax {
namespace {

StereoCamera camera_of(const StereoCalibration& rig) {
  StereoCamera camera;
  camera.width = rig.left.width();
  camera.height = rig.left.height();
  camera.focal_px = rig.left.focal_px();
  camera.centre_px = rig.left.centre_px();
  camera.baseline_m = rig.baseline_m();
  return camera;
}

Vocabulary vocabulary_of(const StereoScene& scene) {
  VocabularyOptions options;
  options.levels = 2;
  const std::vector<std::vector<BinaryDescriptor>> images(2, descriptors_of(scene.features));
  return Vocabulary::train(images, options);
}

TEST(StereoScene, DisparitiesAreThoseOfTheDrawnDepth) {
  const auto source = open_synthetic_stereo_source("synthetic:building?seed=3");
  const StereoCamera camera = camera_of(*source->calibration());
  const StereoFrame pair = source->frame(500);
  const cv::Mat1f depth = source->depth(500);
  StereoScene scene;
  extract_stereo_features(camera, pair.left.grey, pair.right.grey, {}, &scene);
  build_scene_trees(camera, {}, &scene);
  ASSERT_EQ(scene.right_px.size(), scene.features.size());
  EXPECT_EQ(scene.near_tree.size() + scene.far_tree.size(), static_cast<int>(scene.features.size()));
  EXPECT_GT(scene.near_tree.size(), 200);
  std::vector<double> errors;
  for (const std::int32_t i : scene.near_tree.feature) {
    const auto row = static_cast<std::size_t>(i);
    const PlaceFeature& feature = scene.features[row];
    const Eigen::Vector2i px = feature.pixel.array().round().cast<int>();
    const double z = static_cast<double>(depth(px.y(), px.x()));
    if (z <= 0) continue;
    const double disparity = static_cast<double>(feature.pixel.x() - scene.right_px[row]);
    errors.push_back(std::abs(disparity - camera.disparity_px(z)) / level_scale(feature.level));
    EXPECT_NEAR(static_cast<double>(scene.points[row].z()), camera.depth_m(disparity), 1e-3);
    EXPECT_TRUE(scene.is_near(row));
  }
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.15);
  EXPECT_LT(errors[errors.size() * 9 / 10], 0.7);  // what stands before something else has two depths
}

TEST(StereoScene, StoredFeaturesGiveTheSameSceneAgain) {
  const auto source = open_synthetic_stereo_source("synthetic:building?seed=3");
  const StereoCamera camera = camera_of(*source->calibration());
  const StereoFrame pair = source->frame(40);
  StereoScene features;
  extract_stereo_features(camera, pair.left.grey, pair.right.grey, {}, &features);
  const Vocabulary vocabulary = vocabulary_of(features);
  const StereoScene made = make_stereo_scene(camera, pair.left.grey, pair.right.grey, vocabulary);
  StereoScene again;
  again.features = made.features;
  again.right_px = made.right_px;
  EXPECT_FALSE(again.is_complete());
  complete_stereo_scene(camera, vocabulary, {}, &again);
  EXPECT_TRUE(again.is_complete());
  EXPECT_EQ(again.bag, made.bag);
  EXPECT_EQ(again.near_tree.feature, made.near_tree.feature);
  EXPECT_EQ(again.near_tree.parent, made.near_tree.parent);
  EXPECT_EQ(again.far_tree.feature, made.far_tree.feature);
  // Without a right image all is far.
  const StereoScene one = make_stereo_scene(camera, pair.left.grey, {}, vocabulary);
  EXPECT_EQ(one.near_tree.size(), 0);
  EXPECT_EQ(one.far_tree.size(), static_cast<int>(one.features.size()));
  StereoSceneOptions wrong;
  wrong.near_disparity_px = 0;
  EXPECT_THROW(make_stereo_scene(camera, pair.left.grey, {}, vocabulary, wrong), InputError);
}

}  // namespace
}  // namespace parallax
