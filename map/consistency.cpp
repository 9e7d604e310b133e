#include <algorithm>
#include <cmath>
#include <sstream>

#include "map/map.h"

namespace parallax {
namespace {

constexpr std::size_t kMaxReports = 20;

class Reports {
 public:
  template <class... Parts>
  void add(const Parts&... parts) {
    if (lines_.size() >= kMaxReports) return;
    std::ostringstream text;
    (text << ... << parts);
    lines_.push_back(text.str());
  }
  std::vector<std::string> take() { return std::move(lines_); }

 private:
  std::vector<std::string> lines_;
};

bool proper_rotation(const Eigen::Matrix3d& R) {
  return R.allFinite() && (R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-6 && R.determinant() > 0;
}

template <class T>
bool strictly_sorted(const std::vector<T>& list) {
  return std::adjacent_find(list.begin(), list.end(), [](const T& a, const T& b) { return !(a < b); }) == list.end();
}

void check_keyframe(const Map& map, const CameraModel& camera, const Keyframe& kf, Reports* out) {
  const int i = kf.id.index;
  if (!proper_rotation(kf.camera_from_world.R) || !kf.camera_from_world.t.allFinite())
    out->add("keyframe ", i, ": pose is not a rigid transform");
  if (!kf.images || kf.images->pyramid.width() != camera.width() || kf.images->pyramid.height() != camera.height())
    out->add("keyframe ", i, ": images missing or of the wrong size");
  if (!(kf.mean_depth > 0) || !(kf.depth_sigma >= 0)) out->add("keyframe ", i, ": depth ", kf.mean_depth);
  for (std::size_t k = 0; k < kf.measurements.size(); ++k) {
    const Measurement& m = kf.measurements[k];
    if (k > 0 && !(kf.measurements[k - 1].point < m.point)) out->add("keyframe ", i, ": measurements not sorted");
    const MapPoint* point = map.points.find(m.point);
    if (!point) {
      out->add("keyframe ", i, " measures point ", m.point.index, ", which is not there");
      continue;
    }
    if (!std::binary_search(point->observers.begin(), point->observers.end(), kf.id))
      out->add("keyframe ", i, " measures point ", m.point.index, ", which does not list it");
    if (m.level < 0 || m.level >= kPyramidLevels || !(m.sigma_px > 0) || !m.pixel.allFinite() ||
        !camera.in_image(m.pixel, -1.0))
      out->add("keyframe ", i, ": measurement of point ", m.point.index, " is out of range");
  }
}

void check_point(const Map& map, const MapPoint& p, Reports* out) {
  const int i = p.id.index;
  if (!p.position.allFinite()) out->add("point ", i, ": position is not finite");
  if (!(std::abs(p.normal.norm() - 1.0) <= 1e-6)) out->add("point ", i, ": normal is not a unit vector");
  if (!strictly_sorted(p.observers) || !strictly_sorted(p.failed)) out->add("point ", i, ": lists not sorted");
  for (KeyframeId id : p.observers) {
    const Keyframe* kf = map.keyframes.find(id);
    if (!kf)
      out->add("point ", i, " lists keyframe ", id.index, ", which is not there");
    else if (!kf->find(p.id))
      out->add("point ", i, " lists keyframe ", id.index, ", which does not measure it");
    if (std::binary_search(p.failed.begin(), p.failed.end(), id))
      out->add("point ", i, " is both measured and failed in keyframe ", id.index);
  }
  for (KeyframeId id : p.failed) {
    if (!map.keyframes.contains(id)) out->add("point ", i, " failed in keyframe ", id.index, ", which is not there");
  }
  const Keyframe* source = map.keyframes.find(p.source);
  if (!source) {
    out->add("point ", i, ": source keyframe ", p.source.index, " is not there");
    return;
  }
  if (p.source_level < 0 || p.source_level >= kPyramidLevels) {
    out->add("point ", i, ": source level ", p.source_level);
    return;
  }
  if (!source->images) return;  // reported with the keyframe
  const GreyImage& image = source->images->pyramid.level[p.source_level];
  const Eigen::Vector2d& px = p.source_pixel;
  if (!(px.x() >= 0 && px.y() >= 0 && px.x() <= image.cols - 1 && px.y() <= image.rows - 1))
    out->add("point ", i, ": source pixel outside its image");
  if (!((source->camera_from_world * p.position).z() > 0)) out->add("point ", i, " lies behind its source keyframe");
}

}  // namespace

std::vector<std::string> check_consistency(const Map& map, const CameraModel& camera) {
  Reports out;
  for (const Keyframe& kf : map.keyframes) check_keyframe(map, camera, kf, &out);
  for (const MapPoint& p : map.points) check_point(map, p, &out);
  if (map.plane) {
    const RigidTransform& pose = map.plane->world_from_plane;
    if (!proper_rotation(pose.R) || !pose.t.allFinite()) out.add("plane: not a rigid transform");
    if (!(map.plane->extent_m > 0)) out.add("plane: extent ", map.plane->extent_m);
  }
  return out.take();
}

}  // namespace parallax
