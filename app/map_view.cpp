#include "app/map_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "app/content_drawing.h"
#include "app/level_colours.h"
#include "core/check.h"
#include "map/hit_test.h"

namespace parallax {
namespace {

constexpr DrawColour kFrustum{0.55f, 0.6f, 0.7f, 0.9f};
constexpr DrawColour kSelected{1.0f, 0.6f, 0.1f, 1};
constexpr DrawColour kCamera{0.3f, 0.95f, 0.4f, 1};
constexpr DrawColour kPath{0.3f, 0.7f, 0.95f, 0.8f};
constexpr DrawColour kPlane{0.7f, 0.7f, 0.75f, 0.55f};
constexpr DrawColour kOtherPlane{0.8f, 0.6f, 0.95f, 0.5f};
// A frustum reaches this share of the depth of what it sees.
constexpr double kFrustumDepth = 0.12, kCameraDepth = 0.2;
// A wider lens than this is drawn no wider: tangent of the half angle.
constexpr double kWidest = 1.2;
constexpr float kPointSize_px = 3;
constexpr double kAxis_m = 0.05;
// The path is not made of places nearer to each other than this (in the first world, where 10 cm lie between the first
// two views).
constexpr double kPathStep_m = 1e-3;

// The ends of the frustum's edges, and the middle above its upper side, in the camera's frame at depth 1.
std::array<Eigen::Vector3d, 5> frustum_rays(const CameraModel* camera) {
  const CameraModel plain = orbit_lens(640, 480);
  const CameraModel& lens = camera != nullptr ? *camera : plain;
  const double w = lens.width() - 0.5, h = lens.height() - 0.5;
  const std::array<Eigen::Vector2d, 4> corners{Eigen::Vector2d(-0.5, -0.5), {w, -0.5}, {w, h}, {-0.5, h}};
  std::array<Eigen::Vector3d, 5> out;
  for (std::size_t i = 0; i < 4; ++i) {
    Eigen::Vector3d ray;
    if (!lens.unproject(corners[i], &ray)) {
      const Eigen::Vector2d side = corners[i] - lens.centre_px();
      ray = Eigen::Vector3d(side.x(), side.y(), 0).normalized() * 1e3;
    }
    const double wide = ray.head<2>().norm();
    out[i] = {ray.x(), ray.y(), 1};
    if (wide > kWidest) out[i].head<2>() *= kWidest / wide;
  }
  out[4] = 0.5 * (out[0] + out[1]) + 0.25 * (out[0] - out[3]);
  return out;
}

struct Edge {
  Eigen::Vector3d a, b;
};

// World.
std::vector<Edge> frustum_edges(const CameraModel* camera, const RigidTransform& camera_from_world, double depth) {
  const RigidTransform world_from_camera = camera_from_world.inverse();
  std::array<Eigen::Vector3d, 5> at = frustum_rays(camera);
  for (auto& p : at) p = world_from_camera * (depth * p);
  const Eigen::Vector3d& eye = world_from_camera.t;
  return {{eye, at[0]},   {eye, at[1]},   {eye, at[2]},   {eye, at[3]},   {at[0], at[1]},
          {at[1], at[2]}, {at[2], at[3]}, {at[3], at[0]}, {at[0], at[4]}, {at[4], at[1]}};
}

void add_frustum(const CameraModel* camera, const RigidTransform& pose, double depth, const DrawColour& colour,
                 float width_px, DrawList* out) {
  for (const Edge& e : frustum_edges(camera, pose, depth))
    out->world_lines.push_back({e.a.cast<float>(), e.b.cast<float>(), colour, width_px});
}

// Median depth of the keyframes' scenes, metres.
double scene_depth(const TrackingSnapshot& map) {
  std::vector<double> depths;
  for (const auto& kf : map.keyframes) depths.push_back(kf.mean_depth);
  if (depths.empty()) return 1;
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

void add_axes(DrawList* out) {
  for (int i = 0; i < 3; ++i) {
    const DrawColour colour{i == 0 ? 0.9f : 0.2f, i == 1 ? 0.8f : 0.25f, i == 2 ? 0.95f : 0.25f, 1};
    out->world_lines.push_back(
        {Eigen::Vector3f::Zero(), static_cast<float>(kAxis_m) * Eigen::Vector3f::Unit(i), colour, 2.5f});
  }
}

double distance_to_segment(const Eigen::Vector2d& p, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d d = b - a;
  const double s = d.squaredNorm() > 0 ? std::clamp((p - a).dot(d) / d.squaredNorm(), 0.0, 1.0) : 0.0;
  return (a + s * d - p).norm();
}

}  // namespace

CameraPath::CameraPath(int capacity) : capacity_(static_cast<std::size_t>(std::max(capacity, 2))) {}

void CameraPath::add(const TrackingResult& tracked) {
  if (!tracked.camera_from_world) {
    lost_ = true;
    return;
  }
  if (tracked.map_version != map_version_) {
    places_.clear();
    map_version_ = tracked.map_version;
    stride_ = 1;
    lost_ = true;
  }
  const Eigen::Vector3d at = tracked.world_from_first.inverse() * tracked.camera_from_world->inverse().t;
  if (!lost_) {
    if ((places_.back().in_first - at).norm() < kPathStep_m) return;
    if (++skipped_ < stride_) return;
  }
  skipped_ = 0;
  places_.push_back({at, lost_});
  lost_ = false;
  if (places_.size() >= capacity_) thin();
}

void CameraPath::thin() {
  std::vector<Place> kept;
  bool begins = false;
  for (std::size_t i = 0; i < places_.size(); ++i) {
    begins = begins || places_[i].begins;
    // The newest stays: the path goes on from there.
    if (i % 2 == 1 && i + 1 < places_.size()) continue;
    kept.push_back({places_[i].in_first, begins});
    begins = false;
  }
  places_ = std::move(kept);
  stride_ *= 2;
}

std::vector<std::vector<Eigen::Vector3d>> CameraPath::pieces(const SimilarityTransform& world_from_first) const {
  std::vector<std::vector<Eigen::Vector3d>> out;
  for (const Place& p : places_) {
    if (out.empty() || p.begins) out.emplace_back();
    out.back().push_back(world_from_first * p.in_first);
  }
  return out;
}

const SnapshotKeyframe* find_keyframe(const TrackingSnapshot& map, KeyframeId id) {
  const auto it = std::find_if(map.keyframes.begin(), map.keyframes.end(),
                               [id](const SnapshotKeyframe& kf) { return kf.id == id; });
  return it == map.keyframes.end() ? nullptr : &*it;
}

DrawList map_view(const MapViewInput& input, const OrbitCamera& camera, int width, int height) {
  PARALLAX_CHECK(input.map != nullptr, "a map view needs a map");
  const TrackingSnapshot& map = *input.map;
  DrawList out;
  out.camera = orbit_lens(width, height);
  out.camera_from_world = camera.camera_from_world();
  add_axes(&out);
  const std::vector<Plane> planes = planes_of(map);
  for (std::size_t i = 0; i < planes.size(); ++i)
    out.grids.push_back({planes[i].world_from_plane, planes[i].extent_m, 10, i == 0 ? kPlane : kOtherPlane});
  if (!planes.empty()) out.shadow_plane = planes.front().world_from_plane;

  out.world_points.reserve(map.position.size());
  for (std::size_t i = 0; i < map.position.size(); ++i)
    out.world_points.push_back({map.position[i].cast<float>(), level_colour(map.source_level[i]), kPointSize_px});

  if (input.path != nullptr) {
    for (const auto& piece : input.path->pieces(map.world_from_first))
      for (std::size_t i = 1; i < piece.size(); ++i)
        out.world_lines.push_back({piece[i - 1].cast<float>(), piece[i].cast<float>(), kPath, 1.5f});
  }
  const double depth = scene_depth(map);
  for (const SnapshotKeyframe& kf : map.keyframes) {
    const bool selected = input.selected && *input.selected == kf.id;
    add_frustum(input.camera, kf.camera_from_world, kFrustumDepth * depth, selected ? kSelected : kFrustum,
                selected ? 3.0f : 1.2f, &out);
  }
  if (input.tracked != nullptr && input.tracked->camera_from_world && input.tracked->map_version == map.map_version)
    add_frustum(input.camera, *input.tracked->camera_from_world, kCameraDepth * depth, kCamera, 2.5f, &out);
  if (input.content != nullptr) draw_content(*input.content, {}, &out);
  return out;
}

std::optional<KeyframeId> pick_keyframe(const MapViewInput& input, const OrbitCamera& camera, int width, int height,
                                        const Eigen::Vector2d& pixel, double radius_px) {
  PARALLAX_CHECK(input.map != nullptr, "a map view needs a map");
  const CameraModel lens = orbit_lens(width, height);
  const RigidTransform view = camera.camera_from_world();
  const double depth = kFrustumDepth * scene_depth(*input.map);
  std::optional<KeyframeId> best;
  double nearest = std::numeric_limits<double>::max();
  for (const SnapshotKeyframe& kf : input.map->keyframes) {
    double off = std::numeric_limits<double>::max();
    for (const Edge& e : frustum_edges(input.camera, kf.camera_from_world, depth)) {
      Eigen::Vector2d a, b;
      if (lens.project(view * e.a, &a) && lens.project(view * e.b, &b))
        off = std::min(off, distance_to_segment(pixel, a, b));
    }
    const double distance = (kf.centre - camera.eye()).norm();
    if (off <= radius_px && distance < nearest) {
      nearest = distance;
      best = kf.id;
    }
  }
  return best;
}

}  // namespace parallax
