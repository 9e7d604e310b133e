// Views of a synthetic scene with everything known: poses, and for any pixel the place it shows and the surface's
// normal.
#pragma once

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/fast.h"
#include "core/small_blurry_image.h"
#include "map/map.h"
#include "map/source_patch.h"
#include "render/synthetic_path.h"
#include "render/synthetic_source.h"

namespace parallax::test {

inline const CameraModel& small_camera() {
  static const CameraModel c(CameraModelKind::pinhole, 320, 240, {200, 200.5}, {160.2, 119.1});
  return c;
}

// Features as the tracker computes them, with a fixed threshold.
inline std::shared_ptr<const FrameImages> features_of(const GreyImage& grey, int threshold = 8) {
  auto images = std::make_shared<FrameImages>();
  build_pyramid(grey, &images->pyramid);
  for (int l = 0; l < kPyramidLevels; ++l) fast_corners(images->pyramid.level[l], threshold, &images->corners[l]);
  images->small = make_small_blurry_image(images->pyramid);
  return images;
}

// Above the synthetic desk, looking at it; x is the place along the table in metres.
inline RigidTransform above_desk(double x, double turn = 0, double distance = 0.68) {
  const Eigen::Vector3d target(x, 0.06, 0.0);
  const double elevation = 0.76;
  const Eigen::Vector3d eye =
      target + distance * Eigen::Vector3d(std::sin(turn) * std::cos(elevation), -std::cos(turn) * std::cos(elevation),
                                          std::sin(elevation));
  return look_at(eye, target);
}

// `n` views along the table, `step` metres apart.
inline std::vector<RigidTransform> slide(int n, double step, double start = -0.05) {
  std::vector<RigidTransform> out;
  for (int i = 0; i < n; ++i) out.push_back(above_desk(start + i * step));
  return out;
}

class RenderedViews {
 public:
  explicit RenderedViews(std::vector<RigidTransform> world_from_camera, const std::string& scene = "desk",
                         double noise = 1.0, const CameraModel& camera = small_camera(), double light = 1)
      : poses_(std::move(world_from_camera)) {
    SyntheticOptions options;
    options.scene = scene;
    options.frames = static_cast<int>(poses_.size());
    options.camera = camera;
    options.exposure_s = 0;
    options.noise = noise;
    options.light = light;
    options.vignetting = 0;
    SyntheticMotion motion;
    motion.world_from_camera = [poses = poses_](int frame, double) {
      return poses.at(static_cast<std::size_t>(frame));
    };
    motion.label = [](int) { return FrameLabel{}; };
    motion.gain = [](int) { return 1.0; };
    motion.cover = [](int) { return 0.0; };
    source_ = std::make_unique<SyntheticSource>("views", options, motion);
  }

  int size() const { return static_cast<int>(poses_.size()); }
  const CameraModel& camera() const { return source_->options().camera; }
  RigidTransform camera_from_world(int i) const { return poses_.at(static_cast<std::size_t>(i)).inverse(); }
  Frame frame(int i) { return source_->frame(i); }
  Timestamp time_of(int i) const { return source_->time(i); }

  const std::shared_ptr<const FrameImages>& images(int i) {
    auto& kept = images_[i];
    if (!kept) kept = features_of(frame(i).grey);
    return kept;
  }

  // The place a level-0 pixel of a view shows.
  std::optional<Eigen::Vector3d> seen(int i, const Eigen::Vector2d& pixel) const {
    Eigen::Vector3d ray;
    if (!camera().unproject(pixel, &ray)) return std::nullopt;
    const RigidTransform& pose = poses_.at(static_cast<std::size_t>(i));
    const auto hit = source_->scene().cast(pose.t, pose.R * ray);
    if (!hit) return std::nullopt;
    return pose.t + hit->distance * (pose.R * ray);
  }
  double depth(int i, const Eigen::Vector2d& pixel) const {
    const auto p = seen(i, pixel);
    return p ? (camera_from_world(i) * *p).z() : 0.0;
  }

  // Where a place is seen in a view, when nothing stands before it.
  std::optional<Eigen::Vector2d> project_visible(int i, const Eigen::Vector3d& place, double border_px = 6) const {
    Eigen::Vector2d pixel;
    if (!camera().project(camera_from_world(i) * place, &pixel) || !camera().in_image(pixel, border_px))
      return std::nullopt;
    const Eigen::Vector3d from = poses_.at(static_cast<std::size_t>(i)).t;
    const auto hit = source_->scene().cast(from, place - from);
    if (!hit || std::abs(hit->distance - 1) > 0.005) return std::nullopt;
    return pixel;
  }

  // Surface normal where the surface is smooth within `reach` pixels, towards the camera.
  std::optional<Eigen::Vector3d> normal(int i, const Eigen::Vector2d& pixel, double reach) const {
    const auto c = seen(i, pixel), r = seen(i, pixel + Eigen::Vector2d(reach, 0)),
               l = seen(i, pixel - Eigen::Vector2d(reach, 0)), d = seen(i, pixel + Eigen::Vector2d(0, reach)),
               u = seen(i, pixel - Eigen::Vector2d(0, reach));
    if (!c || !r || !l || !d || !u) return std::nullopt;
    Eigen::Vector3d n = (*r - *l).cross(*d - *u).normalized();
    const Eigen::Vector3d to_camera = poses_.at(static_cast<std::size_t>(i)).t - *c;
    if (n.dot(to_camera) < 0) n = -n;
    if (n.dot(to_camera.normalized()) < 0.25) return std::nullopt;
    // All on one plane, to a small part of the distance.
    for (const auto& p : {r, l, d, u})
      if (std::abs(n.dot(*p - *c)) > 0.004 * to_camera.norm()) return std::nullopt;
    return n;
  }

 private:
  std::vector<RigidTransform> poses_;
  std::unique_ptr<SyntheticSource> source_;
  std::map<int, std::shared_ptr<const FrameImages>> images_;
};

// A map with true poses and points: each of the views becomes a keyframe, salient corners of each that lie on smooth
// surfaces become points, measured where they are truly seen in every keyframe that sees them.
inline Map true_map(RenderedViews* views, const std::vector<int>& keyframes, int points_per_level = 150) {
  Map map;
  const CameraModel& camera = views->camera();
  std::vector<KeyframeId> ids;
  for (int v : keyframes) {
    Keyframe kf;
    kf.frame = v;
    kf.time = from_seconds(v / 30.0);
    kf.camera_from_world = views->camera_from_world(v);
    kf.images = views->images(v);
    kf.fixed = ids.empty();
    ids.push_back(map.keyframes.insert(std::move(kf)));
  }
  for (std::size_t k = 0; k < ids.size(); ++k) {
    const int v = keyframes[k];
    const FrameImages& images = *views->images(v);
    for (int level = 0; level < kPyramidLevels; ++level) {
      const GreyImage& image = images.pyramid.level[level];
      std::vector<std::pair<double, Corner>> scored;
      for (const Corner& c : maximal_corners(image, images.corners[level]))
        if (c.x >= 8 && c.y >= 8 && c.x < image.cols - 8 && c.y < image.rows - 8)
          scored.emplace_back(-shi_tomasi_score(image, c.x, c.y), c);
      std::stable_sort(scored.begin(), scored.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
      int made = 0;
      std::vector<Eigen::Vector2d> taken;
      for (const Measurement& m : map.keyframes.at(ids[k]).measurements)
        if (m.level == level) taken.push_back(level0_to_level(m.pixel, level));
      for (const auto& [score, c] : scored) {
        if (made >= points_per_level || score > -20) break;
        const Eigen::Vector2d at(c.x, c.y);
        if (std::any_of(taken.begin(), taken.end(), [&](const Eigen::Vector2d& t) { return (t - at).norm() < 4; }))
          continue;
        const Eigen::Vector2d pixel = level_to_level0(at, level);
        const auto n = views->normal(v, pixel, 4 * level_scale(level));
        const auto place = views->seen(v, pixel);
        MapPoint p;
        if (!n || !place || !set_source(&p, ids[k], level, at, camera)) continue;
        p.position = *place;
        p.normal = *n;
        const PointId id = map.points.insert(p);
        taken.push_back(at);
        ++made;
        for (std::size_t j = 0; j < ids.size(); ++j) {
          const auto seen = views->project_visible(keyframes[j], *place, 4 * level_scale(level));
          if (!seen && j != k) continue;
          map.add_measurement(
              ids[j], {id, seen.value_or(pixel), static_cast<float>(level_scale(level)),
                       static_cast<std::int8_t>(level), j == k ? MeasurementSource::root : MeasurementSource::refind});
        }
      }
    }
  }
  // As in any map: a point that one view alone sees is none.
  std::vector<PointId> single;
  for (const MapPoint& p : map.points)
    if (keyframes.size() > 1 && p.observers.size() < 2) single.push_back(p.id);
  for (PointId id : single) map.erase_point(id);
  for (Keyframe& kf : map.keyframes) map.update_depth(&kf);
  return map;
}

// The camera's displacement in metres and turn in radians between two poses.
inline double centre_distance(const RigidTransform& a, const RigidTransform& b) {
  return (a.inverse().t - b.inverse().t).norm();
}
inline double turn_between(const RigidTransform& a, const RigidTransform& b) { return (a * b.inverse()).angle(); }

}  // namespace parallax::test
