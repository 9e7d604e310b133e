#include "app/game_field.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace parallax {
namespace {

// A point lies on the plane when it is this near, as a part of the distance it was seen from.
constexpr double kOnPlane = 0.015;
constexpr std::size_t kFewestPoints = 30;
// Points farther from the middle than so many times the distance that this part of them keeps are left out.
constexpr double kKeptPart = 0.9, kKeptReach = 1.5;
// A field is begun anew when the plane is another: turned by more (cosine), or moved by more of its radius.
constexpr double kSameCosine = 0.97, kSameShift = 0.5;
// A surface belongs to the field when its frame is turned by less (1 + 2 cosine: two degrees) and is as high, in radii.
constexpr double kSameFrameTrace = 2.9988, kSameHeight = 0.1;
// Smaller growth of the area is not worth a change.
constexpr double kGrowth = 1.05;

double area_of(const std::vector<Eigen::Vector2d>& outline) {
  double twice = 0;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2d &a = outline[i], &b = outline[(i + 1) % outline.size()];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return 0.5 * twice;
}

Eigen::Vector2d centroid_of(const std::vector<Eigen::Vector2d>& outline) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double twice = 0;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2d &a = outline[i], &b = outline[(i + 1) % outline.size()];
    const double cross = a.x() * b.y() - a.y() * b.x();
    twice += cross;
    sum += cross * (a + b);
  }
  return twice > 0 ? Eigen::Vector2d(sum / (3 * twice)) : outline.front();
}

// Counter-clockwise.
std::vector<Eigen::Vector2d> hull_of(const std::vector<Eigen::Vector2d>& points) {
  std::vector<cv::Point2f> in, out;
  in.reserve(points.size());
  for (const Eigen::Vector2d& p : points) in.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
  cv::convexHull(in, out);
  std::vector<Eigen::Vector2d> hull;
  for (const cv::Point2f& p : out) hull.emplace_back(p.x, p.y);
  if (area_of(hull) < 0) std::reverse(hull.begin(), hull.end());
  return hull;
}

double radius_of(const std::vector<Eigen::Vector2d>& outline) { return std::sqrt(area_of(outline) / M_PI); }

}  // namespace

std::vector<Eigen::Vector2d> mapped_outline(const TrackingSnapshot& map, const RigidTransform& world_from_plane) {
  const RigidTransform plane_from_world = world_from_plane.inverse();
  std::vector<Eigen::Vector2d> on_plane;
  for (int row = 0; row < map.size(); ++row) {
    const auto i = static_cast<std::size_t>(row);
    const SnapshotKeyframe& source = map.keyframes[static_cast<std::size_t>(map.source[i])];
    const Eigen::Vector3d p = plane_from_world * map.position[i];
    const double distance = (source.centre - map.position[i]).norm();
    if (std::abs(p.z()) < kOnPlane * distance) on_plane.push_back(p.head<2>());
  }
  if (on_plane.size() < kFewestPoints) return {};
  const auto median = [&](int axis) {
    std::vector<double> values;
    for (const Eigen::Vector2d& p : on_plane) values.push_back(p[axis]);
    std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
    return values[values.size() / 2];
  };
  const Eigen::Vector2d middle(median(0), median(1));
  std::vector<double> distances;
  for (const Eigen::Vector2d& p : on_plane) distances.push_back((p - middle).norm());
  std::vector<double> sorted = distances;
  const auto kept = static_cast<std::size_t>(kKeptPart * static_cast<double>(sorted.size()));
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(kept), sorted.end());
  const double reach = kKeptReach * sorted[kept];
  std::vector<Eigen::Vector2d> near;
  for (std::size_t i = 0; i < on_plane.size(); ++i)
    if (distances[i] <= reach) near.push_back(on_plane[i]);
  std::vector<Eigen::Vector2d> hull = hull_of(near);
  if (hull.size() < 3 || !(area_of(hull) > 0)) return {};
  return hull;
}

void GameField::begin(const TrackingSnapshot& map, const Plane& plane, const std::vector<Eigen::Vector2d>& outline) {
  const Eigen::Vector2d centre = centroid_of(outline);
  plane_from_field_ = RigidTransform();
  plane_from_field_.t.head<2>() = centre;
  PlayingField made;
  made.world_from_plane = plane.world_from_plane * plane_from_field_;
  for (const Eigen::Vector2d& corner : outline) made.outline_m.push_back(corner - centre);
  made.radius_m = radius_of(made.outline_m);
  made.number = ++begun_;
  field_ = std::move(made);
  world_from_plane_ = plane.world_from_plane;
  world_from_first_ = map.world_from_first;
  map_version_ = map.map_version;
}

bool GameField::update(const TrackingSnapshot& map) {
  if (map.map_version == map_version_ && map.version == version_) return false;
  version_ = map.version;
  const bool new_map = map.map_version != map_version_;
  if (new_map || !map.plane) {
    const bool had = field_.has_value();
    if (new_map) field_.reset();
    map_version_ = map.map_version;
    keyframes_ = 0;
    if (!map.plane) return had && new_map;
  }
  // The world may have been scaled: with it everything that is known of the field.
  const double scale = map.world_from_first.s / world_from_first_.s;
  bool changed = false;
  if (field_ && scale != 1.0) {
    for (Eigen::Vector2d& corner : field_->outline_m) corner *= scale;
    field_->radius_m *= scale;
    field_->scale *= scale;
    field_->surface.reset();  // of the old scale
    plane_from_field_.t *= scale;
    changed = true;
  }
  const Plane& plane = *map.plane;
  if (field_) {
    const SimilarityTransform moved = map.world_from_first * world_from_first_.inverse();
    const Eigen::Vector3d expected = moved * world_from_plane_.t;
    const double cosine = (moved.R * world_from_plane_.R.col(2)).dot(plane.world_from_plane.R.col(2));
    if (cosine < kSameCosine || (expected - plane.world_from_plane.t).norm() > kSameShift * field_->radius_m) {
      field_.reset();
      keyframes_ = 0;
    }
  }
  const bool grown = map.keyframes.size() != keyframes_;
  keyframes_ = map.keyframes.size();
  if (!field_) {
    const std::vector<Eigen::Vector2d> outline = mapped_outline(map, plane.world_from_plane);
    if (outline.empty()) {
      keyframes_ = 0;
      return changed;
    }
    begin(map, plane, outline);
    return true;
  }
  world_from_first_ = map.world_from_first;
  world_from_plane_ = plane.world_from_plane;
  const RigidTransform world_from_field = plane.world_from_plane * plane_from_field_;
  if ((world_from_field.t - field_->world_from_plane.t).norm() > 0 ||
      world_from_field.R != field_->world_from_plane.R) {
    field_->world_from_plane = world_from_field;
    changed = true;
  }
  if (grown) {
    // What was part of the field stays part of it.
    std::vector<Eigen::Vector2d> points = mapped_outline(map, field_->world_from_plane);
    points.insert(points.end(), field_->outline_m.begin(), field_->outline_m.end());
    std::vector<Eigen::Vector2d> hull = hull_of(points);
    if (area_of(hull) > kGrowth * area_of(field_->outline_m)) {
      field_->outline_m = std::move(hull);
      field_->radius_m = radius_of(field_->outline_m);
      changed = true;
    }
  }
  return changed;
}

// The surface is in the plane's frame as it was when it was made; the field is centred elsewhere on it.
void GameField::set_surface(const std::shared_ptr<const SceneSurface>& surface) {
  if (!field_) return;
  field_->surface.reset();
  if (!surface || surface->empty()) return;
  const RigidTransform field_from_surface = field_->world_from_plane.inverse() * surface->world_from_plane;
  const bool same_plane = field_from_surface.R.trace() > kSameFrameTrace &&
                          std::abs(field_from_surface.t.z()) < kSameHeight * field_->radius_m;
  if (!same_plane) return;
  auto moved = std::make_shared<SceneSurface>(*surface);
  moved->world_from_plane = field_->world_from_plane;
  moved->corner_m += field_from_surface.t.head<2>();
  field_->surface = std::move(moved);
}

}  // namespace parallax
