#include "mapper/textured_map.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/check.h"
#include "core/error.h"

namespace parallax {
namespace {

using Eigen::Vector3d;

constexpr double kVoxelGrowth = 1.5;
constexpr int kMostViews = 255;
constexpr int kVoxelBits = 21;  // an axis: 60 km of 3 cm

constexpr double kReaches = 2.5;  // keyframes farther apart than this often the farthest point share none

// A point is never surer than this share of its best measurement's variance: errors of neighbouring keyframes are
// alike.
constexpr double kLeastVarianceShare = 0.25;

std::array<std::uint8_t, 3> colour_at(const TexturedKeyframe& keyframe, int x, int y) {
  if (keyframe.colour.empty()) {
    const std::uint8_t grey = keyframe.left(y, x);
    return {grey, grey, grey};
  }
  const cv::Vec3b& bgr = keyframe.colour(y, x);
  return {bgr[2], bgr[1], bgr[0]};
}

}  // namespace

void TexturedMapOptions::validate() const {
  const auto need = [](bool good, const char* field, const char* expected) {
    if (!good) throw InputError(std::string("textured map: ") + field + ": expected " + expected);
  };
  need(voxel_m >= 0.001 && voxel_m <= 10, "voxel_m", "0.001 to 10");
  need(most_points >= 1000, "most_points", "1000 or more");
  need(disparity_sigma_px > 0 && disparity_sigma_px < 10, "disparity_sigma_px", "more than 0, less than 10");
  need(most_relative_sigma > 0 && most_relative_sigma <= 1, "most_relative_sigma", "more than 0, at most 1");
  need(step_px >= 1 && step_px <= 64, "step_px", "1 to 64");
  need(least_views >= 1 && least_views < kMostViews, "least_views", "1 to 254");
  need(agree_sigmas >= 1, "agree_sigmas", "1 or more");
  disparity.validate();
}

TexturedMap::TexturedMap(const StereoCamera& camera, const TexturedMapOptions& options)
    : camera_(camera), options_(options), matcher_(camera, options.disparity), voxel_m_(options.voxel_m) {
  options_.validate();
}

TexturedMap::Voxel TexturedMap::voxel_of(const Vector3d& world) const {
  Voxel key = 0;
  for (int i = 0; i < 3; ++i) {
    const auto cell =
        static_cast<std::int64_t>(std::floor(world[i] / voxel_m_)) + (std::int64_t{1} << (kVoxelBits - 1));
    key = (key << kVoxelBits) | (static_cast<Voxel>(cell) & ((Voxel{1} << kVoxelBits) - 1));
  }
  return key;
}

Vector3d TexturedMap::world_of(Place place) const {
  const Keyframe& keyframe = keyframes_[place.keyframe];
  return keyframe.world_from_camera * keyframe.points[place.point].place.cast<double>();
}

void TexturedMap::remove(Place place, Voxel voxel) {
  point_at(place).views = 0;
  --alive_;
  const auto at = voxels_.find(voxel);
  if (at != voxels_.end() && at->second.keyframe == place.keyframe && at->second.point == place.point)
    voxels_.erase(at);
}

bool TexturedMap::claim(Place place) {
  const auto [at, fresh] = voxels_.try_emplace(voxel_of(world_of(place)), place);
  if (fresh) return true;
  Point &here = point_at(at->second), &other = point_at(place);
  // What both have seen counts for the one that stays.
  const int views = std::min(kMostViews, here.views + other.views);
  Point& loser = other.variance < here.variance ? here : other;
  Point& winner = other.variance < here.variance ? other : here;
  winner.views = static_cast<std::uint8_t>(views);
  loser.views = 0;
  --alive_;
  if (&winner == &here) return false;
  at->second = place;
  return true;
}

void TexturedMap::add(const TexturedKeyframe& keyframe) {
  add(keyframe, matcher_.compute(keyframe.left, keyframe.right));
}

void TexturedMap::add(const TexturedKeyframe& keyframe, const cv::Mat1f& disparity) {
  PARALLAX_CHECK(by_number_.find(keyframe.keyframe) == by_number_.end(), "a keyframe that is new");
  PARALLAX_CHECK(disparity.cols == camera_.width && disparity.rows == camera_.height &&
                     keyframe.left.size() == disparity.size() &&
                     (keyframe.colour.empty() || keyframe.colour.size() == disparity.size()),
                 "images of the rectified camera's size");
  if (moved_) rebuild();
  const cv::Mat1b explained = compare_with(keyframe, disparity);
  insert(keyframe, disparity, explained);
  while (alive_ > options_.most_points) {
    voxel_m_ *= kVoxelGrowth;
    rebuild();
  }
}

cv::Mat1b TexturedMap::compare_with(const TexturedKeyframe& keyframe, const cv::Mat1f& disparity) {
  cv::Mat1b explained(disparity.size(), std::uint8_t{0});
  const double depth_factor = camera_.focal_px.x() * camera_.baseline_m;
  const double reach = depth_factor * options_.most_relative_sigma / options_.disparity_sigma_px;
  const RigidTransform camera_from_world = keyframe.world_from_camera.inverse();
  for (std::uint32_t k = 0; k < keyframes_.size(); ++k) {
    const RigidTransform& world_from_other = keyframes_[k].world_from_camera;
    if ((world_from_other.t - keyframe.world_from_camera.t).norm() > kReaches * reach) continue;
    const RigidTransform camera_from_other = camera_from_world * world_from_other;
    for (std::uint32_t i = 0; i < keyframes_[k].points.size(); ++i) {
      Point& point = keyframes_[k].points[i];
      if (point.views == 0) continue;
      const Vector3d here = camera_from_other * point.place.cast<double>();
      Vector3d pixel;
      if (here.z() > reach || !camera_.project(here, &pixel) || !camera_.in_image({pixel.x(), pixel.z()})) continue;
      const int x = static_cast<int>(std::lround(pixel.x())), y = static_cast<int>(std::lround(pixel.z()));
      const float measured = disparity(y, x);
      if (!(measured > 0)) continue;
      const double depth = depth_factor / measured;
      const double sigma = depth / measured * options_.disparity_sigma_px, variance = sigma * sigma;
      const double apart = depth - here.z();
      const double allowed = options_.agree_sigmas * std::sqrt(variance + point.variance) + voxel_m_;
      if (std::abs(apart) <= allowed) {
        const int half =
            std::max(options_.step_px - 1, static_cast<int>(0.5 * voxel_m_ * camera_.focal_px.x() / depth));
        cv::rectangle(explained, {x - half, y - half}, {x + half, y + half}, 255, cv::FILLED);
        if (here.z() < point.nearest_m) {
          point.nearest_m = static_cast<float>(here.z());
          point.rgb = colour_at(keyframe, x, y);
        }
        agree({k, i}, depth, variance, camera_from_other);
      } else if (apart > allowed) {  // this keyframe sees what is behind it
        ++point.through;
        if (point.through >= point.views) remove({k, i}, voxel_of(world_of({k, i})));
      }
    }
  }
  return explained;
}

void TexturedMap::agree(Place place, double depth, double variance, const RigidTransform& camera_from_other) {
  Point& point = point_at(place);
  const Voxel before = voxel_of(world_of(place));
  const Vector3d here = camera_from_other * point.place.cast<double>();
  const double gain = point.variance / (point.variance + variance);
  const Vector3d moved = here * (1 + gain * (depth / here.z() - 1));
  point.place = (camera_from_other.inverse() * moved).cast<float>();
  const double least = kLeastVarianceShare * std::min<double>(point.variance, variance);
  point.variance = static_cast<float>(std::max(least, (1 - gain) * point.variance));
  point.views = static_cast<std::uint8_t>(std::min(kMostViews, point.views + 1));
  if (voxel_of(world_of(place)) == before) return;
  const auto at = voxels_.find(before);
  if (at != voxels_.end() && at->second.keyframe == place.keyframe && at->second.point == place.point)
    voxels_.erase(at);
  (void)claim(place);
}

void TexturedMap::insert(const TexturedKeyframe& keyframe, const cv::Mat1f& disparity, const cv::Mat1b& explained) {
  const auto slot = static_cast<std::uint32_t>(keyframes_.size());
  by_number_[keyframe.keyframe] = slot;
  keyframes_.push_back({keyframe.keyframe, keyframe.world_from_camera, {}});
  std::vector<Point>& points = keyframes_.back().points;
  const double least = options_.disparity_sigma_px / options_.most_relative_sigma;
  for (int y = 0; y < disparity.rows; y += options_.step_px) {
    for (int x = 0; x < disparity.cols; x += options_.step_px) {
      const float d = disparity(y, x);
      if (!(d >= least) || explained(y, x) != 0) continue;
      const double depth = camera_.depth_m(d), sigma = depth / d * options_.disparity_sigma_px;
      Point point{};
      point.place = (depth * camera_.ray(Eigen::Vector2d(x, y))).cast<float>();
      point.variance = static_cast<float>(sigma * sigma);
      point.nearest_m = static_cast<float>(depth);
      point.views = 1;
      point.rgb = colour_at(keyframe, x, y);
      const Place place{slot, static_cast<std::uint32_t>(points.size())};
      const auto [at, fresh] =
          voxels_.try_emplace(voxel_of(keyframe.world_from_camera * point.place.cast<double>()), place);
      if (fresh) {
        ++alive_;
      } else {
        Point& other = point_at(at->second);
        if (other.variance <= point.variance) continue;
        point.views = other.views;  // pixels of one image that fall into one voxel are one view of it
        point.through = other.through;
        other.views = 0;
        at->second = place;
      }
      points.push_back(point);
    }
  }
}

void TexturedMap::move(int keyframe, const RigidTransform& world_from_camera) {
  const auto at = by_number_.find(keyframe);
  if (at == by_number_.end()) return;
  keyframes_[at->second].world_from_camera = world_from_camera;
  moved_ = true;
}

// The voxels anew, without what has been removed.
void TexturedMap::rebuild() {
  moved_ = false;
  voxels_.clear();
  alive_ = 0;
  for (std::uint32_t k = 0; k < keyframes_.size(); ++k) {
    std::vector<Point>& points = keyframes_[k].points;
    points.erase(std::remove_if(points.begin(), points.end(), [](const Point& p) { return p.views == 0; }),
                 points.end());
    points.shrink_to_fit();
    for (std::uint32_t i = 0; i < points.size(); ++i) {
      ++alive_;
      (void)claim({k, i});
    }
  }
}

std::vector<ColouredPoint> TexturedMap::points() {
  if (moved_) rebuild();
  std::vector<ColouredPoint> out;
  for (const Keyframe& keyframe : keyframes_)
    for (const Point& point : keyframe.points)
      if (point.views >= options_.least_views)
        out.push_back({(keyframe.world_from_camera * point.place.cast<double>()).cast<float>(), point.rgb,
                       std::sqrt(point.variance)});
  return out;
}

}  // namespace parallax
