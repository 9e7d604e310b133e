// A frame of the synthetic desk with an exactly true map, as the views get it from a session.
#pragma once

#include <memory>
#include <opencv2/imgproc.hpp>

#include "core/frame.h"
#include "map/tracking_snapshot.h"
#include "render/synthetic_source.h"
#include "tracker/tracking_types.h"

namespace parallax::testing {

class ViewScene {
 public:
  // 320x240, or another size of the same shape; no noise and no blur.
  explicit ViewScene(int width = 320) {
    const std::string size = std::to_string(width) + "x" + std::to_string(width * 3 / 4);
    SourceOptions options;
    options.colour = true;
    source_ = open_synthetic_source("synthetic:desk?noise=0&blur=0&size=" + size, options);
    Map map;
    for (const int index : {30, 75, 120, 200, 260}) {
      Keyframe kf;
      kf.frame = index;
      kf.camera_from_world = source_->world_from_camera(index).inverse();
      auto images = std::make_shared<FrameImages>();
      build_pyramid(source_->frame(index).grey, &images->pyramid);
      kf.images = std::move(images);
      kf.mean_depth = 0.6;
      map.keyframes.insert(std::move(kf));
    }
    map.plane = Plane{RigidTransform(), 0.25};
    map.planes = {*map.plane};
    snapshot_ = std::const_pointer_cast<TrackingSnapshot>(make_snapshot(map));
    add_points(75);
  }

  const CameraModel& camera() const { return source_->options().camera; }
  Frame frame(int index) { return source_->frame(index); }
  cv::Mat1f depth(int index) { return source_->depth(index); }
  RigidTransform pose(int index) const { return source_->world_from_camera(index).inverse(); }
  TrackingSnapshot& map() { return *snapshot_; }
  std::shared_ptr<const TrackingSnapshot> shared_map() const { return snapshot_; }

  // As the tracker would say it, every point in sight found.
  TrackingResult tracked(int index) const {
    TrackingResult out;
    out.frame = index;
    out.time = source_->time(index);
    out.state = TrackingState::tracking;
    out.quality = TrackingQuality::good;
    out.camera_from_world = pose(index);
    out.coarse_stage = true;
    out.map_points = snapshot_->size();
    out.map_keyframes = static_cast<int>(snapshot_->keyframes.size());
    for (int i = 0; i < snapshot_->size(); ++i) {
      const auto row = static_cast<std::size_t>(i);
      Eigen::Vector2d px;
      if (!camera().project(*out.camera_from_world * snapshot_->position[row], &px) || !camera().in_image(px)) continue;
      const auto level = static_cast<std::int8_t>(snapshot_->source_level[row]);
      const bool found = i % 7 != 3;
      out.points.push_back({px.cast<float>(), level, found});
      ++out.attempted[static_cast<std::size_t>(level)];
      out.found[static_cast<std::size_t>(level)] += found ? 1 : 0;
    }
    return out;
  }

  // Trails from one frame to another, of the points in sight in both.
  TrackingResult trailing(int from, int to) const {
    TrackingResult out;
    out.frame = to;
    out.time = source_->time(to);
    out.state = TrackingState::trailing;
    for (const auto& p : snapshot_->position) {
      Eigen::Vector2d a, b;
      if (camera().project(pose(from) * p, &a) && camera().project(pose(to) * p, &b) && camera().in_image(a) &&
          camera().in_image(b))
        out.trails.push_back({a.cast<float>(), b.cast<float>()});
    }
    return out;
  }

 private:
  // What a frame sees on a grid of pixels.
  void add_points(int index) {
    const cv::Mat1f depth = source_->depth(index);
    const RigidTransform world_from_camera = source_->world_from_camera(index);
    const int step = camera().width() / 20;
    int level = 0;
    for (int y = step / 2; y < depth.rows; y += step) {
      for (int x = step / 2; x < depth.cols; x += step) {
        Eigen::Vector3d ray;
        if (depth(y, x) <= 0 || !camera().unproject({1.0 * x, 1.0 * y}, &ray)) continue;
        const Eigen::Vector3d world = world_from_camera * (static_cast<double>(depth(y, x)) * ray);
        TrackingSnapshot& s = *snapshot_;
        s.id.push_back({0, s.size()});
        s.position.push_back(world);
        s.x.push_back(static_cast<float>(world.x()));
        s.y.push_back(static_cast<float>(world.y()));
        s.z.push_back(static_cast<float>(world.z()));
        s.nx.push_back(0);
        s.ny.push_back(0);
        s.nz.push_back(1);
        s.source.push_back(0);
        s.source_level.push_back(static_cast<std::uint8_t>(level++ * 7 % 10 / 3 % 4));
      }
    }
  }

  std::unique_ptr<SyntheticSource> source_;
  std::shared_ptr<TrackingSnapshot> snapshot_;
};

}  // namespace parallax::testing
