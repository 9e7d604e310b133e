#include "mapper/place_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <unordered_set>
#include <utility>

namespace parallax {
namespace {

// Level-0 pixels to one side of which the lens is sampled.
constexpr double kLensStep_px = 1.0;

// Unit ray through a pixel and the pixels of the image that a radian is worth there.
bool look_through(const CameraModel& camera, PlacePoint* point) {
  Eigen::Vector3d ray, right, below;
  if (!camera.unproject(point->pixel, &ray) ||
      !camera.unproject(point->pixel + Eigen::Vector2d(kLensStep_px, 0), &right) ||
      !camera.unproject(point->pixel + Eigen::Vector2d(0, kLensStep_px), &below))
    return false;
  point->ray = ray.normalized();
  const double area =
      (right.normalized() - point->ray).cross(below.normalized() - point->ray).norm();  // steradians a pixel
  if (!(area > 0)) return false;
  point->pixels_per_radian = kLensStep_px / std::sqrt(area);
  return true;
}

}  // namespace

std::vector<KeyframeId> keyframes_around(const Map& map, KeyframeId keyframe, int neighbours) {
  std::map<KeyframeId, int> shared;
  for (const Measurement& m : map.keyframes.at(keyframe).measurements)
    for (KeyframeId id : map.points.at(m.point).observers)
      if (id != keyframe) ++shared[id];
  std::vector<std::pair<int, KeyframeId>> order;
  for (const auto& [id, n] : shared) order.emplace_back(-n, id);
  std::sort(order.begin(), order.end());
  std::vector<KeyframeId> out = {keyframe};
  for (const auto& [n, id] : order) {
    if (static_cast<int>(out.size()) > neighbours) break;
    out.push_back(id);
  }
  return out;
}

PlaceView view_of_place(const Map& map, KeyframeId keyframe, const CameraModel& camera, int neighbours, int max_points,
                        const std::vector<PointId>& left_out) {
  PlaceView out;
  std::unordered_set<std::int32_t> taken;
  for (KeyframeId id : keyframes_around(map, keyframe, neighbours)) {
    const Keyframe& kf = map.keyframes.at(id);
    const int view = static_cast<int>(out.cameras.size());
    out.cameras.push_back(kf.camera_from_world);
    std::array<GreyImage, kPyramidLevels> smooth;
    for (const Measurement& m : kf.measurements) {
      if (static_cast<int>(out.points.size()) >= max_points) return out;
      if (taken.contains(m.point.index) || std::binary_search(left_out.begin(), left_out.end(), m.point)) continue;
      const MapPoint& p = map.points.at(m.point);
      PlacePoint point;
      point.id = m.point;
      point.position = p.position;
      point.view = view;
      point.pixel = m.pixel;
      point.level = m.level;
      point.sigma_px = m.sigma_px;
      point.depth = (kf.camera_from_world * p.position).norm();
      if (!look_through(camera, &point)) continue;
      const auto level = static_cast<std::size_t>(m.level);
      const GreyImage& image = kf.images->pyramid.level[level];
      if (smooth[level].empty()) smooth[level] = smooth_for_descriptors(image);
      const Eigen::Vector2d at = level0_to_level(m.pixel, m.level);
      if (!describe_corner(image, smooth[level], static_cast<int>(std::lround(at.x())),
                           static_cast<int>(std::lround(at.y())), &point.descriptor))
        continue;
      taken.insert(m.point.index);
      out.points.push_back(point);
    }
  }
  return out;
}

}  // namespace parallax
