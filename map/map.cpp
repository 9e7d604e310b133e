#include "map/map.h"

#include <algorithm>
#include <cmath>

namespace parallax {
namespace {

void insert_sorted(std::vector<KeyframeId>* list, KeyframeId id) {
  const auto it = std::lower_bound(list->begin(), list->end(), id);
  if (it == list->end() || *it != id) list->insert(it, id);
}

void erase_sorted(std::vector<KeyframeId>* list, KeyframeId id) {
  const auto it = std::lower_bound(list->begin(), list->end(), id);
  if (it != list->end() && *it == id) list->erase(it);
}

template <class Measurements>
auto lower_bound_point(Measurements& measurements, PointId point) {
  return std::lower_bound(measurements.begin(), measurements.end(), point,
                          [](const Measurement& m, PointId p) { return m.point < p; });
}

}  // namespace

const Measurement* Keyframe::find(PointId point) const {
  const auto it = lower_bound_point(measurements, point);
  return it != measurements.end() && it->point == point ? &*it : nullptr;
}

Measurement* Keyframe::find(PointId point) {
  const auto it = lower_bound_point(measurements, point);
  return it != measurements.end() && it->point == point ? &*it : nullptr;
}

void Map::clear() {
  keyframes.clear();
  points.clear();
  plane.reset();
  planes.clear();
}

void Map::add_measurement(KeyframeId keyframe, const Measurement& measurement) {
  Keyframe& kf = keyframes.at(keyframe);
  MapPoint& point = points.at(measurement.point);
  const auto it = lower_bound_point(kf.measurements, measurement.point);
  if (it != kf.measurements.end() && it->point == measurement.point) {
    *it = measurement;
  } else {
    kf.measurements.insert(it, measurement);
    insert_sorted(&point.observers, keyframe);
  }
  erase_sorted(&point.failed, keyframe);
}

bool Map::remove_measurement(KeyframeId keyframe, PointId point) {
  Keyframe* kf = keyframes.find(keyframe);
  if (!kf) return false;
  const auto it = lower_bound_point(kf->measurements, point);
  if (it == kf->measurements.end() || it->point != point) return false;
  kf->measurements.erase(it);
  if (MapPoint* p = points.find(point)) erase_sorted(&p->observers, keyframe);
  return true;
}

void Map::mark_failed(KeyframeId keyframe, PointId point) { insert_sorted(&points.at(point).failed, keyframe); }

void Map::erase_point(PointId point) {
  MapPoint* p = points.find(point);
  if (!p) return;
  const std::vector<KeyframeId> observers = p->observers;
  for (KeyframeId kf : observers) remove_measurement(kf, point);
  points.erase(point);
}

void Map::erase_keyframe(KeyframeId keyframe) {
  Keyframe* kf = keyframes.find(keyframe);
  if (!kf) return;
  for (const Measurement& m : kf->measurements) {
    if (MapPoint* p = points.find(m.point)) erase_sorted(&p->observers, keyframe);
  }
  for (MapPoint& p : points) erase_sorted(&p.failed, keyframe);
  keyframes.erase(keyframe);
}

void Map::merge_points(PointId keep, PointId drop) {
  PARALLAX_CHECK(keep != drop, "a point cannot be merged with itself");
  const std::vector<KeyframeId> observers = points.at(drop).observers;
  for (KeyframeId id : observers) {
    Keyframe& kf = keyframes.at(id);
    if (kf.find(keep)) continue;
    Measurement moved = *kf.find(drop);
    moved.point = keep;
    if (moved.source == MeasurementSource::root) moved.source = MeasurementSource::refind;
    add_measurement(id, moved);
  }
  MapPoint& k = points.at(keep);
  const MapPoint& d = points.at(drop);
  k.searched += d.searched;
  k.found += d.found;
  erase_point(drop);
}

void Map::transform_world(const SimilarityTransform& new_from_old) {
  for (Keyframe& kf : keyframes) {
    kf.camera_from_world = new_from_old.rebase(kf.camera_from_world);
    kf.mean_depth *= new_from_old.s;
    kf.depth_sigma *= new_from_old.s;
  }
  for (MapPoint& p : points) {
    p.position = new_from_old * p.position;
    p.normal = new_from_old.R * p.normal;
  }
  const auto move = [&](Plane* moved) {
    moved->world_from_plane.R = new_from_old.R * moved->world_from_plane.R;
    moved->world_from_plane.t = new_from_old * moved->world_from_plane.t;
    moved->extent_m *= new_from_old.s;
  };
  if (plane) move(&*plane);
  for (Plane& p : planes) move(&p);
}

void Map::update_depth(Keyframe* keyframe) const {
  double sum = 0, sum2 = 0;
  int n = 0;
  for (const Measurement& m : keyframe->measurements) {
    const double z = (keyframe->camera_from_world * points.at(m.point).position).z();
    if (!(z > 0)) continue;
    sum += z;
    sum2 += z * z;
    ++n;
  }
  if (n < 2) return;
  keyframe->mean_depth = sum / n;
  keyframe->depth_sigma = std::sqrt(std::max(0.0, sum2 / n - keyframe->mean_depth * keyframe->mean_depth));
}

}  // namespace parallax
