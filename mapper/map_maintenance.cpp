#include "mapper/map_maintenance.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "map/source_patch.h"

namespace parallax {
namespace {

// Two measurements this close (pixels of the finer level) may be one point...
constexpr double kMergeDistance_px = 1.25;
// ...when their depths differ by less than this part.
constexpr double kMergeDepth = 0.01;
// Observers that make a measurement redundant.
constexpr int kRedundantObservers = 3;

// Another observer becomes the source: the one that sees the patch largest. False when there is none.
bool give_new_source(Map* map, const CameraModel& camera, MapPoint* point, KeyframeId leaving) {
  const Keyframe* best = nullptr;
  const Measurement* measurement = nullptr;
  for (KeyframeId id : point->observers) {
    if (id == leaving) continue;
    const Keyframe& kf = map->keyframes.at(id);
    const Measurement* m = kf.find(point->id);
    if (!measurement || m->level < measurement->level) {
      best = &kf;
      measurement = m;
    }
  }
  if (!best) return false;
  const Eigen::Vector2d pixel = level0_to_level(measurement->pixel, measurement->level);
  return set_source(point, best->id, measurement->level, pixel, camera);
}

void remove_one(Map* map, const CameraModel& camera, KeyframeId id) {
  std::vector<PointId> doomed;
  for (MapPoint& p : map->points) {
    const bool observed = std::binary_search(p.observers.begin(), p.observers.end(), id);
    const bool is_source = p.source == id;
    if (!observed && !is_source) continue;
    if (p.observers.size() - (observed ? 1 : 0) < 2 || (is_source && !give_new_source(map, camera, &p, id)))
      doomed.push_back(p.id);
  }
  for (PointId p : doomed) map->erase_point(p);
  map->erase_keyframe(id);
}

}  // namespace

int apply_counts(SharedMap* map, const MapperOptions& options, const PointCounts& counts) {
  return map->write([&](Map& m) {
    int erased = 0;
    for (const PointCount& c : counts.counts) {
      MapPoint* p = m.points.find(c.point);
      if (!p) continue;
      p->searched += c.searched;
      p->found += c.found;
      p->pose_outliers += c.outliers;
      const bool outlier = p->pose_outliers > options.bad_after_outliers && 2 * p->pose_outliers > p->found;
      const bool never_found = p->searched > options.bad_after_searches && p->found < options.min_found_part * p->searched;
      if (outlier || never_found) {
        m.erase_point(c.point);
        ++erased;
      }
    }
    return erased;
  });
}

void remove_keyframes(SharedMap* map, const CameraModel& camera, const std::vector<KeyframeId>& keyframes) {
  map->write([&](Map& m) {
    for (KeyframeId id : keyframes) {
      const Keyframe* kf = m.keyframes.find(id);
      if (kf && !kf->fixed) remove_one(&m, camera, id);
    }
  });
}

bool cull_redundant_keyframe(SharedMap* map, const CameraModel& camera, const MapperOptions& options, KeyframeId newest) {
  const KeyframeId victim = map->read([&](const Map& m) {
    KeyframeId worst;
    double worst_part = options.redundant_part;
    if (m.keyframes.size() <= options.cull_above_keyframes) return worst;
    for (const Keyframe& kf : m.keyframes) {
      if (kf.fixed || kf.id == newest || kf.measurements.empty()) continue;
      int redundant = 0;
      for (const Measurement& x : kf.measurements) {
        int others = 0;
        for (KeyframeId id : m.points.at(x.point).observers) {
          if (id == kf.id) continue;
          if (m.keyframes.at(id).find(x.point)->level <= x.level && ++others >= kRedundantObservers) break;
        }
        if (others >= kRedundantObservers) ++redundant;
      }
      const double part = static_cast<double>(redundant) / static_cast<double>(kf.measurements.size());
      if (part > worst_part) {
        worst_part = part;
        worst = kf.id;
      }
    }
    return worst;
  });
  if (!victim.valid()) return false;
  remove_keyframes(map, camera, {victim});
  return true;
}

int merge_duplicates(SharedMap* map, const CameraModel& camera, const MapperOptions& options, KeyframeId keyframe) {
  (void)camera;
  (void)options;
  struct Pair {
    PointId keep, drop;
  };
  const std::vector<Pair> pairs = map->read([&](const Map& m) {
    std::vector<Pair> out;
    const Keyframe* kf = m.keyframes.find(keyframe);
    if (!kf) return out;
    std::map<std::pair<int, int>, std::vector<const Measurement*>> cells;
    constexpr double kCell_px = 8;
    for (const Measurement& x : kf->measurements)
      cells[{static_cast<int>(x.pixel.x() / kCell_px), static_cast<int>(x.pixel.y() / kCell_px)}].push_back(&x);
    std::vector<PointId> used;
    for (const auto& [cell, members] : cells) {
      for (std::size_t i = 0; i < members.size(); ++i) {
        for (std::size_t j = i + 1; j < members.size(); ++j) {
          const Measurement &a = *members[i], &b = *members[j];
          if (a.level != b.level) continue;
          if ((a.pixel - b.pixel).norm() > kMergeDistance_px * level_scale(a.level)) continue;
          const MapPoint &pa = m.points.at(a.point), &pb = m.points.at(b.point);
          const double za = (kf->camera_from_world * pa.position).z(), zb = (kf->camera_from_world * pb.position).z();
          if (std::abs(za - zb) > kMergeDepth * std::min(za, zb)) continue;
          const bool a_better = pa.observers.size() != pb.observers.size() ? pa.observers.size() > pb.observers.size() : pa.id < pb.id;
          const Pair pair = a_better ? Pair{pa.id, pb.id} : Pair{pb.id, pa.id};
          if (std::find(used.begin(), used.end(), pa.id) != used.end() || std::find(used.begin(), used.end(), pb.id) != used.end())
            continue;
          used.push_back(pa.id);
          used.push_back(pb.id);
          out.push_back(pair);
        }
      }
    }
    return out;
  });
  if (pairs.empty()) return 0;
  return map->write([&](Map& m) {
    int merged = 0;
    for (const Pair& p : pairs) {
      if (!m.points.contains(p.keep) || !m.points.contains(p.drop)) continue;
      m.merge_points(p.keep, p.drop);
      ++merged;
    }
    return merged;
  });
}

}  // namespace parallax
