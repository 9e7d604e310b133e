// A small sound map made by hand: three keyframes in a row, looking at a plane one metre away.
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

#include "map/map.h"
#include "map/source_patch.h"

namespace parallax::test {

inline const CameraModel& flat_camera() {
  static const CameraModel c(CameraModelKind::pinhole, 320, 240, {300, 310}, {159.5, 119.5});
  return c;
}

inline std::shared_ptr<const FrameImages> noise_images(int width, int height, int seed) {
  GreyImage grey(height, width);
  cv::RNG rng(static_cast<std::uint64_t>(seed));
  rng.fill(grey, cv::RNG::UNIFORM, 0, 256);
  auto images = std::make_shared<FrameImages>();
  build_pyramid(grey, &images->pyramid);
  images->small = make_small_blurry_image(images->pyramid);
  return images;
}

struct FabricatedMap {
  Map map;
  std::vector<KeyframeId> keyframes;
  std::vector<PointId> points;
};

// Every point is measured where it projects to in all three keyframes; its source is the first. The last point has the
// second keyframe for its source.
inline FabricatedMap fabricate_map(int n_points = 12) {
  FabricatedMap f;
  for (int i = 0; i < 3; ++i) {
    Keyframe kf;
    kf.frame = 10 * i;
    kf.camera_from_world = RigidTransform(exp_so3({0.01 * i, -0.02 * i, 0.03 * i}), Eigen::Vector3d(-0.05 * i, 0, 0));
    kf.images = noise_images(320, 240, i + 1);
    kf.fixed = i == 0;
    f.keyframes.push_back(f.map.keyframes.insert(std::move(kf)));
  }
  for (int k = 0; k < n_points; ++k) {
    MapPoint p;
    p.position = Eigen::Vector3d(-0.2 + 0.08 * (k % 6), -0.2 + 0.08 * (k / 6), 1.0 + 0.01 * k);
    p.normal = Eigen::Vector3d(0.1, -0.1, -1).normalized();
    const KeyframeId source = k + 1 == n_points ? f.keyframes[1] : f.keyframes[0];
    Eigen::Vector2d px;
    flat_camera().project(f.map.keyframes.at(source).camera_from_world * p.position, &px);
    set_source(&p, source, 0, px, flat_camera());
    const PointId id = f.map.points.insert(p);
    f.points.push_back(id);
    for (KeyframeId kf : f.keyframes) {
      flat_camera().project(f.map.keyframes.at(kf).camera_from_world * p.position, &px);
      f.map.add_measurement(kf, {id, px, 1.0F, 0, kf == source ? MeasurementSource::root : MeasurementSource::tracker});
    }
  }
  for (Keyframe& kf : f.map.keyframes) f.map.update_depth(&kf);
  Plane plane;
  plane.world_from_plane = RigidTransform(exp_so3({3.1, 0.1, 0}), Eigen::Vector3d(0, 0, 1));
  f.map.plane = plane;
  return f;
}

}  // namespace parallax::test
