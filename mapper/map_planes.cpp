#include "mapper/map_planes.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace parallax {
namespace {

// The plane that is drawn reaches this far beyond its points' spread.
constexpr double kPlaneExtent = 2.0;
constexpr double kDefaultExtent_m = 0.2;
// A map of so many keyframes knows its points to a few parts in a thousand of their distance.
constexpr int kMatureKeyframes = 6;
constexpr double kMatureThreshold = 0.25;  // of the consensus threshold
constexpr double kMatureInliers = 0.1;     // of the points, on a plane told apart from its neighbours
// A narrow band is met by fewer of the triples.
constexpr int kMatureHypotheses = 5;
// Points around a seed: the nearest so many, no further than this part of the distance they are seen from.
constexpr std::size_t kSeedPoints = 80;
constexpr std::size_t kLeastSeedPoints = 12;
constexpr double kSeedReach = 0.35;
// Of them on the plane at least; and the seed itself lies within so many consensus thresholds of it.
constexpr double kSeedInliers = 0.4;
constexpr double kSeedOffPlane = 3.0;
// Two planes whose normals differ by less than the angle and that pass each other's origins within the part of the
// viewing distance are one.
constexpr double kSameCosine = 0.985;
constexpr double kSameOffset = 0.03;

double extent_of(const std::vector<Eigen::Vector3d>& points, const DominantPlane& plane,
                 const RigidTransform& world_from_plane) {
  const RigidTransform plane_from_world = world_from_plane.inverse();
  double sum = 0;
  int n = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!plane.inlier[i]) continue;
    sum += (plane_from_world * points[i]).head<2>().squaredNorm();
    ++n;
  }
  return n > 0 ? kPlaneExtent * std::sqrt(0.5 * sum / n) : kDefaultExtent_m;
}

std::vector<Eigen::Vector3d> positions_of(const Map& map) {
  std::vector<Eigen::Vector3d> out;
  for (const MapPoint& p : map.points) out.push_back(p.position);
  return out;
}

bool same_plane(const Plane& a, const Plane& b, double distance) {
  const Eigen::Vector3d na = a.world_from_plane.R.col(2), nb = b.world_from_plane.R.col(2);
  return std::abs(na.dot(nb)) > kSameCosine &&
         std::abs(na.dot(b.world_from_plane.t - a.world_from_plane.t)) < kSameOffset * distance;
}

// Takes the dominant plane's place in the list.
void replace_dominant(Map* map, const Plane& plane) {
  const auto is_dominant = [&](const Plane& p) {
    return map->plane && p.world_from_plane.t == map->plane->world_from_plane.t &&
           p.world_from_plane.R == map->plane->world_from_plane.R;
  };
  const auto place = std::find_if(map->planes.begin(), map->planes.end(), is_dominant);
  if (place != map->planes.end()) {
    *place = plane;
  } else {
    map->planes.push_back(plane);
  }
  map->plane = plane;
}

}  // namespace

std::optional<DominantPlane> dominant_plane_of(const Map& map, const PlaneOptions& options, std::mt19937_64* rng) {
  if (map.empty()) return std::nullopt;
  const Keyframe& first = *map.keyframes.begin();
  return find_dominant_plane(positions_of(map), first.centre(), first.camera_from_world.R.transpose().col(0), options,
                             rng);
}

void set_dominant_plane(Map* map, const DominantPlane& plane, const RigidTransform& world_from_plane) {
  replace_dominant(map, {world_from_plane, extent_of(positions_of(*map), plane, world_from_plane)});
}

bool is_mature(const Map& map) { return map.keyframes.size() >= kMatureKeyframes; }

PlaneOptions plane_options_of(const Map& map, const MapperOptions& options) {
  PlaneOptions out = options.plane;
  if (!is_mature(map)) return out;
  out.threshold_over_depth *= kMatureThreshold;
  out.min_inlier_fraction = std::min(out.min_inlier_fraction, kMatureInliers);
  out.hypotheses *= kMatureHypotheses;
  out.close_fit = true;
  return out;
}

namespace {

// What finding the dominant plane takes, so that it is found outside the lock.
struct Cloud {
  std::vector<Eigen::Vector3d> points;
  Eigen::Vector3d viewer, right;
  PlaneOptions options;
  std::optional<Plane> plane;  // the one before
};

std::optional<Cloud> cloud_of(const SharedMap& map, const MapperOptions& options) {
  return map.read([&](const Map& m) -> std::optional<Cloud> {
    if (m.empty()) return std::nullopt;
    const Keyframe& first = *m.keyframes.begin();
    return Cloud{positions_of(m), first.centre(), first.camera_from_world.R.transpose().col(0),
                 plane_options_of(m, options), m.plane};
  });
}

}  // namespace

bool refine_dominant_plane(SharedMap* map, const MapperOptions& options, std::mt19937_64* rng) {
  const auto cloud = cloud_of(*map, options);
  if (!cloud) return false;
  const Eigen::Vector3d right = cloud->plane ? Eigen::Vector3d(cloud->plane->world_from_plane.R.col(0)) : cloud->right;
  const auto found = find_dominant_plane(cloud->points, cloud->viewer, right, cloud->options, rng);
  if (!found) return false;
  Plane plane{found->world_from_plane, 0};
  if (cloud->plane) {
    const Eigen::Vector3d normal = plane.world_from_plane.R.col(2), origin = cloud->plane->world_from_plane.t;
    plane.world_from_plane.t = origin - normal.dot(origin - plane.world_from_plane.t) * normal;
  }
  plane.extent_m = extent_of(cloud->points, *found, plane.world_from_plane);
  map->write([&](Map& m) { replace_dominant(&m, plane); });
  return true;
}

MapEditReply detect_plane(SharedMap* map, const MapperOptions& options, std::mt19937_64* rng) {
  const auto cloud = cloud_of(*map, options);
  if (!cloud) return {false, "there is no map yet"};
  const auto found = find_dominant_plane(cloud->points, cloud->viewer, cloud->right, cloud->options, rng);
  if (!found) return {false, "no plane holds enough of the points"};
  const Plane plane{found->world_from_plane, extent_of(cloud->points, *found, found->world_from_plane)};
  map->write([&](Map& m) { replace_dominant(&m, plane); });
  return {true, ""};
}

MapEditReply add_plane(SharedMap* map, const MapperOptions& options, const Eigen::Vector3d& seed,
                       std::mt19937_64* rng) {
  if (!seed.allFinite()) return {false, "that is no place in the map"};
  struct Extracted {
    std::vector<std::pair<double, Eigen::Vector3d>> points;  // with their squared distance from the seed
    Eigen::Vector3d viewer, right;
    PlaneOptions options;
  };
  auto extracted = map->read([&](const Map& m) -> std::optional<Extracted> {
    if (m.empty()) return std::nullopt;
    Extracted out;
    out.options = plane_options_of(m, options);
    double nearest = INFINITY;
    for (const Keyframe& kf : m.keyframes) {
      const double distance = (kf.centre() - seed).squaredNorm();
      if (!(distance < nearest)) continue;
      nearest = distance;
      out.viewer = kf.centre();
      out.right = kf.camera_from_world.R.transpose().col(0);
    }
    for (const MapPoint& p : m.points) {
      const double distance = (p.position - seed).squaredNorm();
      if (distance < kSeedReach * kSeedReach * nearest) out.points.emplace_back(distance, p.position);
    }
    return out;
  });
  if (!extracted) return {false, "there is no map yet"};
  auto& around = extracted->points;
  if (around.size() < kLeastSeedPoints) return {false, "too few points around there: choose a place with more texture"};
  std::stable_sort(around.begin(), around.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  around.resize(std::min(around.size(), kSeedPoints));
  std::vector<Eigen::Vector3d> points;
  for (const auto& [distance, position] : around) points.push_back(position);
  PlaneOptions plane_options = extracted->options;
  plane_options.min_inlier_fraction = kSeedInliers;
  const auto found = find_dominant_plane(points, extracted->viewer, extracted->right, plane_options, rng);
  const double distance = (extracted->viewer - seed).norm();
  if (!found) return {false, "the points around there lie on no plane"};
  Plane plane{found->world_from_plane, 0};
  const Eigen::Vector3d normal = plane.world_from_plane.R.col(2);
  const double off = normal.dot(seed - plane.world_from_plane.t);
  if (std::abs(off) > kSeedOffPlane * plane_options.threshold_over_depth * distance) {
    return {false, "the points around there lie on no plane through it"};
  }
  plane.world_from_plane.t = seed - off * normal;
  plane.extent_m = extent_of(points, *found, plane.world_from_plane);
  map->write([&](Map& m) {
    const auto same =
        std::find_if(m.planes.begin(), m.planes.end(), [&](const Plane& p) { return same_plane(p, plane, distance); });
    if (same != m.planes.end()) {
      *same = plane;
    } else {
      m.planes.push_back(plane);
    }
    m.plane = plane;
  });
  return {true, ""};
}

}  // namespace parallax
