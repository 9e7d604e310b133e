#include "mapper/map_maintenance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "map/source_patch.h"

namespace parallax {
namespace {

// Two measurements this close (pixels of the finer level) may be one point...
constexpr double kMergeDistance_px = 1.25;
// ...when their depths differ by less than this part.
constexpr double kMergeDepth = 0.01;
// Observers that make a measurement redundant.
constexpr int kRedundantObservers = 3;
// A point of the map that is this far (pixels of the level) from its measurement may still centre a new source patch.
constexpr double kSourceShift_px = 1.0;
// Less than this, cosine, and a normal that was not estimated turns to the new source.
constexpr double kSidewaysCosine = 0.5;
// Searches that count: all counts are halved beyond, so that a point that has changed is not kept for its past.
constexpr int kCountMemory = 1000;
// Searches of earlier days that count.
constexpr int kEarlierDays = 10;
// What has to be redundant of a keyframe of a map that is as large as it may be.
constexpr double kLeastRedundantPart = 0.3;
// Hidden: most of at least so many points around it (tangent of the angle) in a keyframe that looked for it in vain are
// nearer by this part.
constexpr int kOccluderPoints = 3;
constexpr double kOccluderRadius = 0.035;
constexpr double kOccluderDepth = 0.93;
constexpr std::size_t kOccluderKeyframes = 3;

// Whether something nearer stood in front of the point in the newest keyframes that could not measure it.
bool occluded(const Map& map, const MapPoint& point) {
  const std::size_t looks = std::min(kOccluderKeyframes, point.failed.size());
  for (std::size_t i = 0; i < looks; ++i) {
    const Keyframe& kf = map.keyframes.at(point.failed[point.failed.size() - 1 - i]);
    const Eigen::Vector3d p = kf.camera_from_world * point.position;
    if (!(p.z() > 0)) continue;
    int near = 0, in_front = 0;
    for (const Measurement& x : kf.measurements) {
      const Eigen::Vector3d q = kf.camera_from_world * map.points.at(x.point).position;
      if (!(q.z() > 0)) continue;
      const Eigen::Vector2d apart = q.head<2>() / q.z() - p.head<2>() / p.z();
      if (apart.squaredNorm() > kOccluderRadius * kOccluderRadius) continue;
      ++near;
      if (q.z() < kOccluderDepth * p.z()) ++in_front;
    }
    if (in_front >= kOccluderPoints && 2 * in_front > near) return true;
  }
  return false;
}

// Another observer becomes the source: the one that sees the patch largest, and of several such the one that sees it
// most from the front. The patch's centre is where the point, known from all its measurements, is seen there: the one
// measurement's own error would shift the patch against what the other keyframes measured. False when there is none.
bool give_new_source(Map* map, const CameraModel& camera, MapPoint* point, KeyframeId leaving) {
  Keyframe* best = nullptr;
  Measurement* measurement = nullptr;
  double best_cosine = 0;
  for (KeyframeId id : point->observers) {
    if (id == leaving) continue;
    Keyframe& kf = map->keyframes.at(id);
    Measurement* m = kf.find(point->id);
    const double cosine = (kf.centre() - point->position).normalized().dot(point->normal);
    if (measurement && (m->level > measurement->level || (m->level == measurement->level && cosine <= best_cosine)))
      continue;
    best = &kf;
    measurement = m;
    best_cosine = cosine;
  }
  if (!best) return false;
  Eigen::Vector2d pixel = measurement->pixel;
  Eigen::Vector2d projected;
  if (camera.project(best->camera_from_world * point->position, &projected) &&
      (projected - pixel).norm() < kSourceShift_px * level_scale(measurement->level))
    pixel = projected;
  if (!set_source(point, best->id, measurement->level, level0_to_level(pixel, measurement->level), camera))
    return false;
  measurement->source = MeasurementSource::root;
  // A normal that was only a guess would be seen from the side.
  if (!point->normal_estimated && best_cosine < kSidewaysCosine)
    point->normal = (best->centre() - point->position).normalized();
  return true;
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

// How redundant a keyframe must be to go from a map of this size.
double redundant_enough(const MapperOptions& options, int keyframes) {
  if (options.max_keyframes == 0) return options.redundant_part;
  if (keyframes > options.max_keyframes) return -1;
  const double full = static_cast<double>(keyframes - options.cull_above_keyframes) /
                      (options.max_keyframes - options.cull_above_keyframes);
  return options.redundant_part +
         full * (std::min(options.redundant_part, kLeastRedundantPart) - options.redundant_part);
}

}  // namespace

void age_counts(Map* map) {
  for (MapPoint& p : map->points) {
    if (p.searched <= kEarlierDays) continue;
    const double keep = static_cast<double>(kEarlierDays) / p.searched;
    p.found = static_cast<int>(std::lround(p.found * keep));
    p.pose_outliers = static_cast<int>(std::lround(p.pose_outliers * keep));
    p.searched = kEarlierDays;
  }
}

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
      const bool never_found =
          p->searched > options.bad_after_searches && p->found < options.min_found_part * p->searched;
      if (!outlier && never_found && occluded(m, *p)) {
        p->searched = p->found = p->pose_outliers = 0;
        continue;
      }
      if (p->searched > kCountMemory) {
        p->searched /= 2;
        p->found /= 2;
        p->pose_outliers /= 2;
      }
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

bool cull_redundant_keyframe(SharedMap* map, const CameraModel& camera, const MapperOptions& options,
                             KeyframeId newest) {
  const KeyframeId victim = map->read([&](const Map& m) {
    KeyframeId worst;
    if (m.keyframes.size() <= options.cull_above_keyframes) return worst;
    double worst_part = redundant_enough(options, m.keyframes.size());
    // By point, how many keyframes measure it at each level or a finer one.
    std::vector<std::array<std::uint16_t, kPyramidLevels>> measured(static_cast<std::size_t>(m.points.capacity()));
    for (const Keyframe& kf : m.keyframes) {
      for (const Measurement& x : kf.measurements) {
        auto& levels = measured[static_cast<std::size_t>(x.point.index)];
        for (int level = x.level; level < kPyramidLevels; ++level) ++levels[static_cast<std::size_t>(level)];
      }
    }
    for (const Keyframe& kf : m.keyframes) {
      if (kf.fixed || kf.id == newest || kf.measurements.empty()) continue;
      int redundant = 0;
      for (const Measurement& x : kf.measurements) {
        const auto& levels = measured[static_cast<std::size_t>(x.point.index)];
        // Its own is one of them.
        if (levels[static_cast<std::size_t>(x.level)] > kRedundantObservers) ++redundant;
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

int retire_keyframes(SharedMap* map, const CameraModel& camera, const MapperOptions& options, KeyframeId newest) {
  const auto is_empty = [&](const Keyframe& kf) {
    return kf.id != newest && static_cast<int>(kf.measurements.size()) < options.min_keyframe_measurements;
  };
  const bool any = map->read([&](const Map& m) {
    if (m.keyframes.size() <= 2) return false;
    for (const Keyframe& kf : m.keyframes)
      if (is_empty(kf)) return true;
    return false;
  });
  if (!any) return 0;
  return map->write([&](Map& m) {
    std::vector<KeyframeId> gone;
    Keyframe* largest = nullptr;
    for (Keyframe& kf : m.keyframes) {
      if (is_empty(kf)) gone.push_back(kf.id);
      if (!largest || kf.measurements.size() > largest->measurements.size()) largest = &kf;
    }
    const KeyframeId stays = largest->id;
    int count = 0;
    for (KeyframeId id : gone) {
      if (id == stays || m.keyframes.size() <= 2) continue;
      if (m.keyframes.at(id).fixed) m.keyframes.at(stays).fixed = true;
      remove_one(&m, camera, id);
      ++count;
    }
    return count;
  });
}

int merge_duplicates(SharedMap* map, KeyframeId keyframe) {
  struct Pair {
    PointId keep, drop;
  };
  const std::vector<Pair> pairs = map->read([&](const Map& m) {
    std::vector<Pair> out;
    const Keyframe* kf = m.keyframes.find(keyframe);
    if (!kf) return out;
    // Sorted by column; of the few within reach to the right, those near enough.
    std::vector<const Measurement*> sorted;
    sorted.reserve(kf->measurements.size());
    for (const Measurement& x : kf->measurements) sorted.push_back(&x);
    std::sort(sorted.begin(), sorted.end(), [](const Measurement* a, const Measurement* b) {
      return a->pixel.x() != b->pixel.x() ? a->pixel.x() < b->pixel.x() : a->point < b->point;
    });
    std::vector<std::uint8_t> used(sorted.size(), 0);
    constexpr double kReach_px = kMergeDistance_px * (1 << (kPyramidLevels - 1));
    for (std::size_t i = 0; i < sorted.size(); ++i) {
      const Measurement& a = *sorted[i];
      for (std::size_t j = i + 1; j < sorted.size() && !used[i]; ++j) {
        const Measurement& b = *sorted[j];
        if (b.pixel.x() - a.pixel.x() > kReach_px) break;
        // Patches of different levels show different detail, and each level is searched on its own: they stay.
        if (used[j] || a.level != b.level) continue;
        if ((a.pixel - b.pixel).norm() > kMergeDistance_px * level_scale(a.level)) continue;
        const MapPoint &pa = m.points.at(a.point), &pb = m.points.at(b.point);
        const double za = (kf->camera_from_world * pa.position).z(), zb = (kf->camera_from_world * pb.position).z();
        if (std::abs(za - zb) > kMergeDepth * std::min(za, zb)) continue;
        const bool a_better =
            pa.observers.size() != pb.observers.size() ? pa.observers.size() > pb.observers.size() : pa.id < pb.id;
        out.push_back(a_better ? Pair{pa.id, pb.id} : Pair{pb.id, pa.id});
        used[i] = used[j] = 1;
      }
    }
    return out;
  });
  if (pairs.empty()) return 0;
  return map->write([&](Map& m) {
    int merged = 0;
    for (const Pair& p : pairs) {
      if (!m.points.contains(p.keep) || !m.points.contains(p.drop)) continue;
      // What measured the other patch, centred up to a pixel beside, would be off: the point is looked for there
      // instead.
      const std::vector<KeyframeId> observers = m.points.at(p.drop).observers;
      for (KeyframeId id : observers)
        if (!m.keyframes.at(id).find(p.keep)) m.remove_measurement(id, p.drop);
      m.merge_points(p.keep, p.drop);
      m.points.at(p.keep).refined_everywhere = false;
      ++merged;
    }
    return merged;
  });
}

}  // namespace parallax
