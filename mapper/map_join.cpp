#include "mapper/map_join.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace parallax {
namespace {

// Two planes whose normals differ by less than the angle and that pass each other's origins within the part of the
// viewing distance are one.
constexpr double kOnePlaneCosine = 0.985;
constexpr double kOnePlaneOffset = 0.03;
// Points that say how a place has moved.
constexpr std::size_t kNearPoints = 60;
// Points off by more than so many times the median are left out of a fit, in so many rounds.
constexpr double kFitOutlier = 3.0;
constexpr int kFitRounds = 4;

double viewing_distance(const Map& map) {
  double sum = 0;
  for (const Keyframe& kf : map.keyframes) sum += kf.mean_depth / map.keyframes.size();
  return sum;
}

bool one_plane(const Plane& p, const Plane& q, double distance) {
  const Eigen::Vector3d np = p.world_from_plane.R.col(2), nq = q.world_from_plane.R.col(2);
  const Eigen::Vector3d apart = q.world_from_plane.t - p.world_from_plane.t;
  return std::abs(np.dot(nq)) > kOnePlaneCosine && std::abs(np.dot(apart)) < kOnePlaneOffset * distance &&
         std::abs(nq.dot(apart)) < kOnePlaneOffset * distance;
}

void join_planes(const Map& b, Map* map) {
  const double distance = viewing_distance(*map);
  for (const Plane& plane : b.planes) {
    const bool known = std::any_of(map->planes.begin(), map->planes.end(),
                                   [&](const Plane& p) { return one_plane(p, plane, distance); });
    if (!known) map->planes.push_back(plane);
  }
  if (!map->plane) map->plane = b.plane;
}

}  // namespace

JoinedMaps join_maps(const Map& a, Map b, const SimilarityTransform& a_from_b) {
  JoinedMaps out;
  out.map = a;
  b.transform_world(a_from_b);
  out.keyframe_of_b.resize(static_cast<std::size_t>(b.keyframes.capacity()));
  out.point_of_b.resize(static_cast<std::size_t>(b.points.capacity()));
  for (const Keyframe& kf : b.keyframes) {
    Keyframe copy = kf;
    copy.fixed = false;
    copy.measurements.clear();
    out.keyframe_of_b[static_cast<std::size_t>(kf.id.index)] = out.map.keyframes.insert(std::move(copy));
  }
  const auto now = [&](KeyframeId id) { return out.keyframe_of_b[static_cast<std::size_t>(id.index)]; };
  for (const MapPoint& p : b.points) {
    MapPoint copy = p;
    copy.source = now(p.source);
    copy.observers.clear();
    // In the same order as before, since identifiers are given out in order.
    for (KeyframeId& id : copy.failed) id = now(id);
    const PointId id = out.map.points.insert(std::move(copy));
    out.point_of_b[static_cast<std::size_t>(p.id.index)] = id;
    for (KeyframeId observer : p.observers) {
      Measurement m = *b.keyframes.at(observer).find(p.id);
      m.point = id;
      out.map.add_measurement(now(observer), m);
    }
  }
  join_planes(b, &out.map);
  return out;
}

int fuse_points(JoinedMaps* joined, const std::vector<PointPair>& pairs) {
  int fused = 0;
  for (const PointPair& pair : pairs) {
    PointId& of_b = joined->point_of_b[static_cast<std::size_t>(pair.b.index)];
    if (of_b == pair.a || !joined->map.points.contains(pair.a) || !joined->map.points.contains(of_b)) continue;
    joined->map.merge_points(pair.a, of_b);
    of_b = pair.a;
    ++fused;
  }
  return fused;
}

SimilarityTransform fit_similarity(std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> from_to) {
  SimilarityTransform out;
  for (int round = 0; round < kFitRounds && from_to.size() >= 3; ++round) {
    Eigen::Matrix3Xd from(3, from_to.size()), to(3, from_to.size());
    for (std::size_t i = 0; i < from_to.size(); ++i) {
      from.col(static_cast<Eigen::Index>(i)) = from_to[i].first;
      to.col(static_cast<Eigen::Index>(i)) = from_to[i].second;
    }
    SimilarityTransform fit;
    if (!align_points(from, to, true, &fit)) return out;
    out = fit;
    std::vector<double> off;
    for (const auto& [before, after] : from_to) off.push_back((fit * before - after).norm());
    std::vector<double> sorted = off;
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    const double limit = kFitOutlier * *middle;
    std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> kept;
    for (std::size_t i = 0; i < from_to.size(); ++i)
      if (off[i] <= limit) kept.push_back(from_to[i]);
    if (kept.size() == from_to.size()) break;
    from_to = std::move(kept);
  }
  return out;
}

SimilarityTransform SurfaceMotion::at(const Map& now, const Eigen::Vector3d& place) const {
  std::vector<std::pair<double, std::size_t>> near;
  for (std::size_t i = 0; i < points_.size(); ++i)
    if (now.points.contains(points_[i].first)) near.emplace_back((points_[i].second - place).squaredNorm(), i);
  const std::size_t n = std::min(near.size(), kNearPoints);
  std::partial_sort(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(n), near.end());
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> from_to;
  for (std::size_t k = 0; k < n; ++k) {
    const auto& [id, position] = points_[near[k].second];
    from_to.emplace_back(position, now.points.at(id).position);
  }
  return fit_similarity(std::move(from_to));
}

}  // namespace parallax
