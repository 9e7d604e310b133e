#include "app/session_view_drawing.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "app/map_picture.h"

namespace parallax {
namespace {

using Eigen::Vector3d;

constexpr double kStageGapM = 3;          // between sessions that have not met
constexpr double kStageLift = 0.6;        // of the plan's extent, that all of session time is lifted by
constexpr double kStagePause = 0.06;      // of session time, between one session and the next
constexpr double kCameraSizeM = 0.35;     // of the frustum
constexpr double kFitRadii = 2.6;         // distance to look from, in radii of what is to be seen
constexpr std::size_t kMostLines = 6000;  // of a session's way; more are drawn thinner
constexpr DrawColour kStageGrid{0.30f, 0.31f, 0.34f, 1};

DrawColour on_dark(CanvasColour colour) {
  const auto lighter = [](int c) { return static_cast<float>(60 + c * 195 / 255) / 255.0f; };
  return {lighter(colour.red), lighter(colour.green), lighter(colour.blue), 1};
}

void add_camera(const SessionStage& stage, const SceneTail& tail, double seconds, const DrawColour& colour,
                DrawList* out) {
  const Vector3d eye = stage.at(tail.global_from_camera.t, tail.session, seconds);
  const Eigen::Matrix3d drawing_from_camera = stage.upright() * tail.global_from_camera.R;
  std::array<Eigen::Vector3f, 4> corner;
  for (std::size_t i = 0; i < 4; ++i) {
    const Vector3d ray((i == 0 || i == 3) ? -0.7 : 0.7, i < 2 ? -0.5 : 0.5, 1);
    corner[i] = (eye + kCameraSizeM * (drawing_from_camera * ray)).cast<float>();
  }
  for (std::size_t i = 0; i < 4; ++i) {
    out->world_lines.push_back({eye.cast<float>(), corner[i], colour, 1.5f});
    out->world_lines.push_back({corner[i], corner[(i + 1) % 4], colour, 1.5f});
  }
}

void add_ellipse(const SessionStage& stage, const SceneSpread& spread, const Vector3d& middle, const DrawColour& colour,
                 DrawList* out) {
  const Eigen::Matrix<double, 2, 3> plan = stage.upright().topRows<2>();
  const Eigen::Matrix2d axes = ellipse_95(plan * spread.covariance * plan.transpose());
  constexpr int kPieces = 24;
  Vector3d before = middle;
  for (int i = 0; i <= kPieces; ++i) {
    const double a = 2 * M_PI * i / kPieces;
    const Eigen::Vector2d p = axes * Eigen::Vector2d(std::cos(a), std::sin(a));
    const Vector3d here = middle + Vector3d(p.x(), p.y(), 0);
    if (i > 0) out->world_lines.push_back({before.cast<float>(), here.cast<float>(), colour, 1.2f});
    before = here;
  }
}

void add_ground(const SessionStage& stage, DrawList* out) {
  const double step = map_grid_step(std::max(stage.high().x() - stage.low().x(), stage.high().y() - stage.low().y()));
  const double z = stage.low().z() - 0.5;
  const auto floor_of = [&](double v) { return std::floor(v / step) * step; };
  const double x0 = floor_of(stage.low().x()), x1 = floor_of(stage.high().x()) + step, y0 = floor_of(stage.low().y()),
               y1 = floor_of(stage.high().y()) + step;
  const auto line = [&](double ax, double ay, double bx, double by) {
    out->world_lines.push_back({Vector3d(ax, ay, z).cast<float>(), Vector3d(bx, by, z).cast<float>(), kStageGrid, 1});
  };
  for (double x = x0; x <= x1 + 1e-6; x += step) line(x, y0, x, y1);
  for (double y = y0; y <= y1 + 1e-6; y += step) line(x0, y, x1, y);
}

}  // namespace

SessionStage::SessionStage(const SessionViewSnapshot& snapshot, bool elevation)
    : upright_(upright_from_world({0, -1, 0})), elevation_(elevation) {
  std::map<int, std::pair<double, double>> extent_x;  // by component
  std::map<int, int> component_of;
  double total = 0, widest = 1;
  Vector3d low = Vector3d::Constant(std::numeric_limits<double>::max()), high = -low;
  const auto take = [&](int component, const Vector3d& global) {
    const Vector3d p = upright_ * global;
    auto& [left, right] = extent_x.try_emplace(component, p.x(), p.x()).first->second;
    left = std::min(left, p.x());
    right = std::max(right, p.x());
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  };
  for (const SceneSession& session : snapshot.scene.sessions) {
    component_of[session.id] = session.component;
    for (const ScenePose& pose : session.poses) take(session.component, pose.global_from_camera.t);
    places_[session.id].base_seconds = total;
    total += session.seconds();
  }
  for (const SceneTail& tail : snapshot.tails)
    for (const Vector3d& place : tail.places) take(component_of[tail.session], place);
  if (extent_x.empty()) return;
  components_ = static_cast<int>(extent_x.size());
  std::map<int, double> shift;
  double next = extent_x.begin()->second.first;
  low.x() = next;
  for (const auto& [component, range] : extent_x) {
    shift[component] = next - range.first;
    widest = std::max(widest, range.second - range.first);
    next += range.second - range.first + kStageGapM;
  }
  high.x() = next - kStageGapM;
  widest = std::max(widest, high.y() - low.y());
  double pause = 0;
  for (auto& [id, place] : places_) {
    place.shift_x = shift[component_of[id]];
    place.base_seconds += pause;
    pause += kStagePause * total;
  }
  if (elevation_) {
    lift_per_second_ = kStageLift * widest / std::max(total, 1e-3);
    low.z() = 0;
    high.z() = lift_per_second_ * (total + pause);
  }
  low_ = low;
  high_ = high;
}

Vector3d SessionStage::at(const Vector3d& global, int id, double seconds) const {
  const auto found = places_.find(id);
  const Place place = found == places_.end() ? Place{} : found->second;
  Vector3d p = upright_ * global;
  p.x() += place.shift_x;
  if (elevation_) p.z() = lift_per_second_ * (place.base_seconds + seconds);
  return p;
}

DrawList session_view_list(const SessionViewSnapshot& snapshot, const SessionViewSettings& settings,
                           const OrbitCamera& camera, int width, int height) {
  DrawList out;
  out.camera = orbit_lens(width, height);
  out.camera_from_world = camera.camera_from_world();
  const SessionStage stage(snapshot, settings.elevation);
  add_ground(stage, &out);
  const SessionScene& scene = snapshot.scene;
  for (const SceneSession& session : scene.sessions) {
    const DrawColour colour = on_dark(session.colour);
    const std::size_t step = session.poses.size() / kMostLines + 1;
    for (std::size_t i = step; i < session.poses.size(); i += step) {
      const ScenePose &a = session.poses[i - step], &b = session.poses[i];
      DrawColour faint = colour;
      if (b.after_failure) faint.a = 0.3f;
      out.world_lines.push_back({stage.at(a.global_from_camera.t, session.id, a.seconds).cast<float>(),
                                 stage.at(b.global_from_camera.t, session.id, b.seconds).cast<float>(), faint, 2.5f});
    }
    if (settings.points && !settings.elevation)
      for (const ColouredPoint& point : session.points)
        out.world_points.push_back({stage.at(point.position.cast<double>(), session.id, 0).cast<float>(),
                                    {colour.r * 0.55f, colour.g * 0.55f, colour.b * 0.55f, 1},
                                    2});
  }
  for (const SceneTail& tail : snapshot.tails) {
    const SceneSession* session = scene.session(tail.session);
    if (session == nullptr) continue;
    const DrawColour colour = on_dark(session->colour);
    for (std::size_t i = 1; i < tail.places.size(); ++i)
      out.world_lines.push_back({stage.at(tail.places[i - 1], tail.session, session->seconds()).cast<float>(),
                                 stage.at(tail.places[i], tail.session, session->seconds()).cast<float>(), colour,
                                 1.2f});
    add_camera(stage, tail, session->seconds(), colour, &out);
  }
  if (settings.links)
    for (const SceneLink& link : scene.links) {
      const ScenePose &a = *scene.pose(link.found), &b = *scene.pose(link.query);
      out.world_lines.push_back({stage.at(a.global_from_camera.t, link.found.session, a.seconds).cast<float>(),
                                 stage.at(b.global_from_camera.t, link.query.session, b.seconds).cast<float>(),
                                 on_dark(link.within_session() ? kWithinSessionColour : kBetweenSessionsColour), 1.2f});
    }
  if (settings.ellipses)
    for (const SceneSpread& spread : scene.spreads) {
      const SceneSession& session = *scene.session(spread.key.session);
      const ScenePose& pose = *scene.pose(spread.key);
      add_ellipse(stage, spread, stage.at(pose.global_from_camera.t, session.id, pose.seconds), on_dark(session.colour),
                  &out);
    }
  return out;
}

OrbitCamera fit_to_sessions(const SessionStage& stage, OrbitCamera camera) {
  camera.target = 0.5 * (stage.low() + stage.high());
  camera.distance = std::max(2.0, 0.5 * kFitRadii * (stage.high() - stage.low()).norm());
  return camera;
}

}  // namespace parallax
