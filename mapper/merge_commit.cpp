#include "mapper/merge_commit.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "map/shared_map.h"
#include "mapper/loop_detection.h"
#include "mapper/map_join.h"
#include "mapper/map_maintenance.h"

namespace parallax {
namespace {

// Fewer points than this say nothing about how the scale has changed at a keyframe.
constexpr std::size_t kScalePoints = 5;
// Of the present keyframes, that must be in the merged map.
constexpr double kMinStandingPart = 0.5;
// A point is measured by so many keyframes, or goes.
constexpr std::size_t kFewestObservers = 2;

class MergeRebase {
 public:
  MergeRebase(const Map& present, const Map& base, const Map& merged)
      : present_(present),
        base_(base),
        merged_(merged),
        keyframe_shift_(present.keyframes.capacity() - base.keyframes.capacity()),
        point_shift_(present.points.capacity() - base.points.capacity()) {}

  bool stands() const;
  void find_motions();
  std::shared_ptr<const WorldWarp> warp(const SimilarityTransform& world_from_first) const;
  void put_together(const CameraModel& camera, MergeCommit* out);

 private:
  bool is_new(KeyframeId id) const { return id.index >= base_.keyframes.capacity(); }
  bool is_new(PointId id) const { return id.index >= base_.points.capacity(); }
  // Identifiers of the merged map to those of the one that is made: those of the other map make room for what has come
  // to the present map. The order stays.
  KeyframeId shifted(KeyframeId id) const {
    return is_new(id) ? KeyframeId{id.session, id.index + keyframe_shift_} : id;
  }
  PointId shifted(PointId id) const { return is_new(id) ? PointId{id.session, id.index + point_shift_} : id; }
  const SimilarityTransform& motion(KeyframeId id) const { return *motion_[static_cast<std::size_t>(id.index)]; }

  SimilarityTransform motion_of(const Keyframe& now, const Keyframe& then) const;
  void put_keyframes(Map* map) const;
  void put_points(Map* map) const;
  void put_measurements(Map* map) const;
  void take_out_what_has_gone(const CameraModel& camera, Map* map) const;
  void drop_weak_points(Map* map) const;
  void follow_planes(Map* map) const;

  const Map& present_;
  const Map& base_;
  const Map& merged_;
  std::int32_t keyframe_shift_, point_shift_;
  std::vector<std::optional<SimilarityTransform>> motion_;  // new_from_old, by index of a present keyframe
};

// Whether enough of the present map is in the merged one.
bool MergeRebase::stands() const {
  int standing = 0;
  for (const Keyframe& kf : present_.keyframes) standing += !is_new(kf.id) && merged_.keyframes.contains(kf.id);
  return standing > 0 && standing >= kMinStandingPart * present_.keyframes.size();
}

// Takes the camera exactly to where it stands in the merged map, and its points as nearly as one scale allows.
SimilarityTransform MergeRebase::motion_of(const Keyframe& now, const Keyframe& then) const {
  std::vector<double> factors;
  for (const Measurement& m : now.measurements) {
    const MapPoint *before = present_.points.find(m.point), *after = nullptr;
    if (before && !is_new(m.point)) after = merged_.points.find(m.point);
    if (!after) continue;
    const double old_depth = (now.camera_from_world * before->position).z();
    const double new_depth = (then.camera_from_world * after->position).z();
    if (old_depth > 0 && new_depth > 0) factors.push_back(new_depth / old_depth);
  }
  SimilarityTransform scale;
  if (factors.size() >= kScalePoints) {
    const auto middle = factors.begin() + static_cast<std::ptrdiff_t>(factors.size() / 2);
    std::nth_element(factors.begin(), middle, factors.end());
    scale.s = *middle;
  } else {
    scale.s = then.mean_depth / now.mean_depth;
  }
  return SimilarityTransform(then.camera_from_world.inverse()) * scale * SimilarityTransform(now.camera_from_world);
}

// What is not in the merged map moves as the keyframe it shares the most points with; what shares none as the one
// before it in age.
void MergeRebase::find_motions() {
  motion_.assign(static_cast<std::size_t>(present_.keyframes.capacity()), std::nullopt);
  std::vector<KeyframeId> missing;
  for (const Keyframe& kf : present_.keyframes) {
    const Keyframe* then = is_new(kf.id) ? nullptr : merged_.keyframes.find(kf.id);
    if (then)
      motion_[static_cast<std::size_t>(kf.id.index)] = motion_of(kf, *then);
    else
      missing.push_back(kf.id);
  }
  for (KeyframeId id : missing) {
    const std::vector<int> shared = shared_points(present_, id);
    KeyframeId best;
    int most = -1;
    for (const Keyframe& kf : present_.keyframes) {
      if (!motion_[static_cast<std::size_t>(kf.id.index)]) continue;
      const int common = shared[static_cast<std::size_t>(kf.id.index)];
      if (common < most || (common == most && common == 0 && id < kf.id)) continue;
      most = common;
      best = kf.id;
    }
    motion_[static_cast<std::size_t>(id.index)] = motion(best);
  }
}

std::shared_ptr<const WorldWarp> MergeRebase::warp(const SimilarityTransform& world_from_first) const {
  std::vector<WarpNode> nodes;
  for (const Keyframe& kf : present_.keyframes)
    nodes.push_back(warp_node(kf.id, kf.camera_from_world, kf.mean_depth, motion(kf.id), world_from_first));
  return std::make_shared<const WorldWarp>(std::move(nodes));
}

void MergeRebase::put_keyframes(Map* map) const {
  const auto put = [&](const Keyframe& kf, KeyframeId id) {
    Keyframe copy = kf;
    copy.measurements.clear();
    map->keyframes.restore(std::move(copy), id);
  };
  for (const Keyframe& kf : merged_.keyframes)
    if (!is_new(kf.id)) put(kf, kf.id);
  for (const Keyframe& kf : present_.keyframes) {
    if (!is_new(kf.id)) continue;
    put(kf, kf.id);
    Keyframe& moved = map->keyframes.at(kf.id);
    moved.camera_from_world = motion(kf.id).rebase(kf.camera_from_world);
    moved.camera_from_world.orthonormalise();
  }
  for (const Keyframe& kf : merged_.keyframes)
    if (is_new(kf.id)) put(kf, shifted(kf.id));
}

void MergeRebase::put_points(Map* map) const {
  const bool more_keyframes = keyframe_shift_ > 0;
  const auto put_merged = [&](const MapPoint& p) {
    MapPoint copy = p;
    copy.source = shifted(p.source);
    copy.observers.clear();
    for (KeyframeId& id : copy.failed) id = shifted(id);
    if (more_keyframes) copy.refined_everywhere = false;
    // What the tracker has seen of it meanwhile.
    if (const MapPoint* now = is_new(p.id) ? nullptr : present_.points.find(p.id)) {
      copy.searched = now->searched;
      copy.found = now->found;
      copy.pose_outliers = now->pose_outliers;
    }
    map->points.restore(std::move(copy), shifted(p.id));
  };
  for (const MapPoint& p : merged_.points)
    if (!is_new(p.id)) put_merged(p);
  for (const MapPoint& p : present_.points) {
    if (!is_new(p.id) || !map->keyframes.contains(p.source)) continue;
    MapPoint copy = p;
    const SimilarityTransform& change = motion(p.source);
    copy.position = change * p.position;
    copy.normal = (change.R * p.normal).normalized();
    copy.observers.clear();
    std::erase_if(copy.failed, [&](KeyframeId id) { return !map->keyframes.contains(id); });
    copy.refined_everywhere = false;
    map->points.restore(std::move(copy), p.id);
  }
  for (const MapPoint& p : merged_.points)
    if (is_new(p.id)) put_merged(p);
}

// All of the merged map; of the present one what has a new keyframe or a new point.
void MergeRebase::put_measurements(Map* map) const {
  for (const Keyframe& kf : merged_.keyframes)
    for (Measurement m : kf.measurements) {
      m.point = shifted(m.point);
      map->add_measurement(shifted(kf.id), m);
    }
  for (const Keyframe& kf : present_.keyframes) {
    if (!map->keyframes.contains(kf.id)) continue;
    for (const Measurement& m : kf.measurements)
      if ((is_new(kf.id) || is_new(m.point)) && map->points.contains(m.point)) map->add_measurement(kf.id, m);
    if (is_new(kf.id)) map->update_depth(&map->keyframes.at(kf.id));
  }
}

void MergeRebase::take_out_what_has_gone(const CameraModel& camera, Map* map) const {
  for (Keyframe& kf : map->keyframes) {
    const Keyframe* now = kf.id.index < present_.keyframes.capacity() ? present_.keyframes.find(kf.id) : nullptr;
    kf.fixed = now && now->fixed;
  }
  std::vector<PointId> points;
  for (const MapPoint& p : base_.points)
    if (!present_.points.contains(p.id) && map->points.contains(p.id)) points.push_back(p.id);
  for (PointId id : points) map->erase_point(id);
  std::vector<KeyframeId> keyframes;
  for (const Keyframe& kf : base_.keyframes)
    if (!present_.keyframes.contains(kf.id) && map->keyframes.contains(kf.id)) keyframes.push_back(kf.id);
  if (!keyframes.empty()) {
    SharedMap work;
    work.replace_map(std::move(*map));
    remove_keyframes(&work, camera, keyframes);
    *map = work.copy().map;
  }
  bool has_datum = false;
  for (const Keyframe& kf : map->keyframes) has_datum = has_datum || kf.fixed;
  if (!has_datum && !map->empty()) (*map->keyframes.begin()).fixed = true;
}

void MergeRebase::drop_weak_points(Map* map) const {
  std::vector<PointId> weak;
  for (const MapPoint& p : map->points) {
    const Keyframe* source = map->keyframes.find(p.source);
    if (p.observers.size() < kFewestObservers || !source || !((source->camera_from_world * p.position).z() > 0))
      weak.push_back(p.id);
  }
  for (PointId id : weak) map->erase_point(id);
}

// The present map's planes go with the points around them; the other's are where the merged map has them.
void MergeRebase::follow_planes(Map* map) const {
  SurfaceMotion motion;
  for (const MapPoint& p : present_.points) motion.add(p.id, p.position);
  const auto moved = [&](Plane plane) {
    const SimilarityTransform change = motion.at(*map, plane.world_from_plane.t);
    plane.world_from_plane = RigidTransform(change.R * plane.world_from_plane.R, change * plane.world_from_plane.t);
    plane.world_from_plane.orthonormalise();
    plane.extent_m *= change.s;
    return plane;
  };
  for (const Plane& plane : present_.planes) map->planes.push_back(moved(plane));
  for (std::size_t i = base_.planes.size(); i < merged_.planes.size(); ++i) map->planes.push_back(merged_.planes[i]);
  map->plane = present_.plane ? moved(*present_.plane) : merged_.plane;
}

void MergeRebase::put_together(const CameraModel& camera, MergeCommit* out) {
  Map& map = out->map;
  put_keyframes(&map);
  put_points(&map);
  put_measurements(&map);
  take_out_what_has_gone(camera, &map);
  drop_weak_points(&map);
  follow_planes(&map);
  out->keyframe_shift = keyframe_shift_;
  out->point_shift = point_shift_;
  for (const Keyframe& kf : present_.keyframes) {
    if (!map.keyframes.contains(kf.id)) continue;
    out->newest = kf.id;
    out->keyframes_taken_along += is_new(kf.id);
  }
  for (const MapPoint& p : present_.points) out->points_taken_along += is_new(p.id) && map.points.contains(p.id);
}

}  // namespace

MergeCommit rebase_merged(const Map& present, const SimilarityTransform& world_from_first, const CameraModel& camera,
                          const Map& base, const Map& merged) {
  MergeCommit out;
  MergeRebase rebase(present, base, merged);
  if (present.empty() || !rebase.stands()) {
    out.reason = "too much of the map has changed meanwhile";
    return out;
  }
  rebase.find_motions();
  out.warp = rebase.warp(world_from_first);
  rebase.put_together(camera, &out);
  const std::vector<std::string> problems = check_consistency(out.map, camera);
  if (!problems.empty()) {
    out.reason = "the merged map is not consistent: " + problems.front();
    out.map.clear();
  }
  return out;
}

}  // namespace parallax
