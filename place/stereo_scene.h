// What a keyframe of a stereo session is recognised by (MS §4.1): features of the left image with their place in the
// right one, visual words, and two trees: of the near features (with a disparity; 3D metric) and of the far ones (image
// metric).
//
// Rectified pairs, pixels of level 0; points in metres in the frame of the left camera. Plain values; the functions are
// safe from any thread.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/image.h"
#include "core/stereo_camera.h"
#include "place/feature_tree.h"
#include "place/place_features.h"
#include "place/vocabulary.h"

namespace parallax {

struct StereoSceneOptions {
  PlaceFeatureOptions features = {.count = 400};
  double max_disparity_px = 128;       // searched for
  double near_disparity_px = 1.5;      // from here on a feature is near; with less it is one of the far ones
  double max_row_difference_px = 0.8;  // between left and right, pixels of the feature's level
  double disparity_sigma_px = 0.25;    // standard deviation, pixels of the feature's level

  void validate() const;  // throws InputError naming the field
};

struct StereoScene {
  std::vector<PlaceFeature> features;
  std::vector<float> right_px;  // u in the right image of each feature; NaN: not seen there
  // From here on all follows from the above (complete_stereo_scene).
  WordBag bag;
  std::vector<Eigen::Vector3f> points;  // of each feature, left camera's frame, metres; z NaN: far
  std::vector<float> depth_sigma;       // standard deviation of the point's z, metres; of near features
  std::vector<float> size;              // of what a feature shows: metres of near features, pixels of far ones
  FeatureTree near_tree, far_tree;

  bool is_near(std::size_t feature) const { return points[feature].z() > 0; }
  bool is_complete() const { return points.size() == features.size() && !bag.empty(); }
};

// `right` empty: one camera alone, all features are far. Corners are put at the point that their gradients agree on
// (Foerstner and Guelch 1987), and looked for along the row of the right image, to a fraction of a pixel.
StereoScene make_stereo_scene(const StereoCamera& camera, const GreyImage& left, const GreyImage& right,
                              const Vocabulary& vocabulary, const StereoSceneOptions& options = {});

// The parts of it: features and where the right image has them...
void extract_stereo_features(const StereoCamera& camera, const GreyImage& left, const GreyImage& right,
                             const StereoSceneOptions& options, StereoScene* scene);
// ... and what follows from them: bag, points and trees. The same features give the same scene. Features that are not
// finite, or a right_px of another length, are refused with PARALLAX_CHECK.
void complete_stereo_scene(const StereoCamera& camera, const Vocabulary& vocabulary, const StereoSceneOptions& options,
                           StereoScene* scene);
// The same without the bag.
void build_scene_trees(const StereoCamera& camera, const StereoSceneOptions& options, StereoScene* scene);

}  // namespace parallax
