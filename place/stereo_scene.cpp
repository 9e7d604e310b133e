#include "place/stereo_scene.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "core/check.h"
#include "core/error.h"
#include "core/patch.h"

namespace parallax {
namespace {

constexpr int kCornerRadius = 4;          // of the window that says where a corner is, pixels of its level
constexpr double kMostCornerMove = 1.5;   // further is another corner
constexpr int kMostMeanSquare = 20 * 20;  // grey levels, a pixel of a block and its match
constexpr double kNextBest = 1.35;        // a place that is not beside the best one differs so much more
constexpr int kBesideBest_px = 2;
constexpr float kNotSeen = std::numeric_limits<float>::quiet_NaN();

// The point that lies nearest to the lines through the window's edges (Foerstner and Guelch 1987).
Eigen::Vector2d corner_point(const GreyImage& image, int x, int y) {
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d moment = Eigen::Vector2d::Zero();
  constexpr int r = kCornerRadius;
  if (x <= r || y <= r || x >= image.cols - r - 1 || y >= image.rows - r - 1) return {x, y};
  for (int dy = -r; dy <= r; ++dy) {
    const std::uint8_t* row = image.ptr<std::uint8_t>(y + dy) + x;
    const auto step = static_cast<std::ptrdiff_t>(image.step[0]);
    for (int dx = -r; dx <= r; ++dx) {
      const double gx = row[dx + 1] - row[dx - 1], gy = row[dx + step] - row[dx - step];
      const double w = 1.0 / (1.0 + (dx * dx + dy * dy) / 6.0);
      const double a = w * gx * gx, b = w * gx * gy, c = w * gy * gy;
      normal(0, 0) += a;
      normal(0, 1) += b;
      normal(1, 1) += c;
      moment += Eigen::Vector2d(a * dx + b * dy, b * dx + c * dy);
    }
  }
  normal(1, 0) = normal(0, 1);
  const double trace = normal.trace(), determinant = normal.determinant();
  if (!(determinant > 0.02 * trace * trace)) return {x, y};  // more of an edge
  const Eigen::Vector2d move = normal.inverse() * moment;
  if (!(move.cwiseAbs().maxCoeff() <= kMostCornerMove)) return {x, y};
  return Eigen::Vector2d(x, y) + move;
}

// Where the right image of one level has the feature at `at` of the left one; nothing when no place in its row, or more
// than one, looks like it.
std::optional<double> match_in_row(const GreyImage& left, const GreyImage& right, const Eigen::Vector2d& at,
                                   double max_disparity, double max_row_difference, std::vector<int>* scores) {
  const int x = static_cast<int>(std::lround(at.x())), y = static_cast<int>(std::lround(at.y()));
  PatchTemplate block;
  if (y < kPatchSize / 2 || y > right.rows - kPatchSize / 2 || !copy_patch(left, x, y, &block)) return std::nullopt;
  const int first = std::max(kPatchSize / 2, x - static_cast<int>(max_disparity));
  const int last = std::min(right.cols - kPatchSize / 2, x + 1);
  if (first > last) return std::nullopt;
  scores->clear();
  for (int u = first; u <= last; ++u) scores->push_back(zmssd(block, right, u, y));
  const auto best = std::min_element(scores->begin(), scores->end());
  if (*best > kMostMeanSquare * kPatchPixels) return std::nullopt;
  const int best_x = first + static_cast<int>(best - scores->begin());
  for (int u = first; u <= last; ++u)
    if (std::abs(u - best_x) > kBesideBest_px &&
        (*scores)[static_cast<std::size_t>(u - first)] < kNextBest * *best + kPatchPixels)
      return std::nullopt;
  AlignmentTemplate window;
  if (!warp_alignment_template(left, at, Eigen::Matrix2d::Identity(), &window) || !window.valid) return std::nullopt;
  const AlignmentResult found = align_patch(window, right, {best_x + at.x() - x, at.y()});
  if (!found.converged || std::abs(found.position.y() - at.y()) > max_row_difference) return std::nullopt;
  return found.position.x();
}

}  // namespace

void StereoSceneOptions::validate() const {
  if (features.count < 1 || features.count > 5000) throw InputError("scene: features.count: expected 1 to 5000");
  if (features.cell_px < 8) throw InputError("scene: features.cell_px: expected at least 8");
  if (!(max_disparity_px > 1)) throw InputError("scene: max_disparity_px: expected more than 1");
  if (!(near_disparity_px > 0)) throw InputError("scene: near_disparity_px: expected more than 0");
  if (!(max_row_difference_px > 0)) throw InputError("scene: max_row_difference_px: expected more than 0");
  if (!(disparity_sigma_px > 0)) throw InputError("scene: disparity_sigma_px: expected more than 0");
}

void extract_stereo_features(const StereoCamera& camera, const GreyImage& left, const GreyImage& right,
                             const StereoSceneOptions& options, StereoScene* scene) {
  options.validate();
  PARALLAX_CHECK(!left.empty() && left.cols == camera.width && left.rows == camera.height,
                 "a left image of the camera's size");
  PARALLAX_CHECK(right.empty() || right.size() == left.size(), "two images of one size");
  *scene = {};
  ImagePyramid left_pyramid, right_pyramid;
  build_pyramid(left, &left_pyramid);
  if (!right.empty()) build_pyramid(right, &right_pyramid);
  scene->features = extract_place_features(left_pyramid, options.features);
  scene->right_px.assign(scene->features.size(), kNotSeen);
  std::vector<int> scores;
  for (std::size_t i = 0; i < scene->features.size(); ++i) {
    PlaceFeature& feature = scene->features[i];
    const auto level = static_cast<std::size_t>(feature.level);
    const Eigen::Vector2d whole = level0_to_level(feature.pixel.cast<double>(), feature.level);
    const Eigen::Vector2d at = corner_point(left_pyramid.level[level], static_cast<int>(std::lround(whole.x())),
                                            static_cast<int>(std::lround(whole.y())));
    feature.pixel = level_to_level0(at, feature.level).cast<float>();
    if (right.empty()) continue;
    const double scale = level_scale(feature.level);
    const auto x = match_in_row(left_pyramid.level[level], right_pyramid.level[level], at,
                                options.max_disparity_px / scale, options.max_row_difference_px, &scores);
    if (x) scene->right_px[i] = static_cast<float>(level_to_level0({*x, at.y()}, feature.level).x());
  }
}

void build_scene_trees(const StereoCamera& camera, const StereoSceneOptions& options, StereoScene* scene) {
  const std::size_t n = scene->features.size();
  PARALLAX_CHECK(scene->right_px.size() == n, "a place in the right image, or none, of each feature");
  scene->points.assign(n, Eigen::Vector3f::Constant(kNotSeen));
  scene->depth_sigma.assign(n, kNotSeen);
  scene->size.assign(n, 0);
  std::array<std::vector<std::int32_t>, 2> rows;  // near, far
  std::array<std::vector<Eigen::Vector3f>, 2> positions;
  const double focal_baseline = camera.focal_px.x() * camera.baseline_m;
  for (std::size_t i = 0; i < n; ++i) {
    const PlaceFeature& feature = scene->features[i];
    PARALLAX_CHECK(feature.pixel.allFinite() && feature.level >= 0 && feature.level < kPyramidLevels,
                   "a feature of the image");
    const double scale = level_scale(feature.level);
    const double disparity = static_cast<double>(feature.pixel.x()) - static_cast<double>(scene->right_px[i]);
    const bool near = disparity >= options.near_disparity_px;  // false for NaN
    if (near) {
      const double z = focal_baseline / disparity;
      scene->points[i] = (z * camera.ray(feature.pixel.cast<double>())).cast<float>();
      scene->depth_sigma[i] = static_cast<float>(z * options.disparity_sigma_px * scale / disparity);
      scene->size[i] = static_cast<float>(scale * z / camera.focal_px.x());
      positions[0].push_back(scene->points[i]);
    } else {
      scene->size[i] = static_cast<float>(scale);
      positions[1].emplace_back(feature.pixel.x(), feature.pixel.y(), 0.0F);
    }
    rows[near ? 0 : 1].push_back(static_cast<std::int32_t>(i));
  }
  scene->near_tree = minimum_spanning_tree(rows[0], positions[0]);
  scene->far_tree = minimum_spanning_tree(rows[1], positions[1]);
}

void complete_stereo_scene(const StereoCamera& camera, const Vocabulary& vocabulary, const StereoSceneOptions& options,
                           StereoScene* scene) {
  scene->bag = vocabulary.bag_of(descriptors_of(scene->features));
  build_scene_trees(camera, options, scene);
}

StereoScene make_stereo_scene(const StereoCamera& camera, const GreyImage& left, const GreyImage& right,
                              const Vocabulary& vocabulary, const StereoSceneOptions& options) {
  StereoScene scene;
  extract_stereo_features(camera, left, right, options, &scene);
  complete_stereo_scene(camera, vocabulary, options, &scene);
  return scene;
}

}  // namespace parallax
