#include "map/tracking_snapshot.h"

#include <algorithm>

#include "map/source_patch.h"

namespace parallax {

std::shared_ptr<const TrackingSnapshot> make_snapshot(const Map& map) {
  auto out = std::make_shared<TrackingSnapshot>();
  std::vector<std::int32_t> row(static_cast<std::size_t>(map.keyframes.capacity()), -1);
  for (const Keyframe& kf : map.keyframes) {
    row[kf.id.index] = static_cast<std::int32_t>(out->keyframes.size());
    out->keyframes.push_back({kf.id, kf.camera_from_world, kf.centre(), kf.images, kf.mean_depth});
  }
  const auto n = static_cast<std::size_t>(map.points.size());
  for (auto* v : {&out->x, &out->y, &out->z, &out->nx, &out->ny, &out->nz}) v->reserve(n);
  out->id.reserve(n);
  out->position.reserve(n);
  out->axes.reserve(n);
  out->source.reserve(n);
  out->source_level.reserve(n);
  out->source_pixel.reserve(n);
  out->quality.reserve(n);
  for (const MapPoint& p : map.points) {
    out->id.push_back(p.id);
    out->position.push_back(p.position);
    out->x.push_back(static_cast<float>(p.position.x()));
    out->y.push_back(static_cast<float>(p.position.y()));
    out->z.push_back(static_cast<float>(p.position.z()));
    out->nx.push_back(static_cast<float>(p.normal.x()));
    out->ny.push_back(static_cast<float>(p.normal.y()));
    out->nz.push_back(static_cast<float>(p.normal.z()));
    const std::int32_t source_row = row[p.source.index];
    Eigen::Matrix<double, 3, 2> axes;
    if (!patch_axes(p, out->keyframes[source_row].camera_from_world, &axes)) axes.setZero();
    out->axes.push_back(axes.cast<float>());
    out->source.push_back(source_row);
    out->source_level.push_back(static_cast<std::uint8_t>(p.source_level));
    out->source_pixel.push_back(p.source_pixel.cast<float>());
    out->quality.push_back(static_cast<std::uint8_t>(std::min<std::size_t>(p.observers.size(), 255)));
  }
  out->plane = map.plane;
  out->planes = map.planes;
  return out;
}

}  // namespace parallax
