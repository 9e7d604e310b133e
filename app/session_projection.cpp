#include "app/session_projection.h"

#include <algorithm>
#include <cmath>

namespace parallax {
namespace {

using Eigen::Vector2d;

constexpr double kYawRad = -0.5, kTiltRad = 0.6;  // of the oblique view: turned, and seen from above the horizon
constexpr double kLiftShare = 0.75;               // of the plan's extent, that all of session time is lifted by
constexpr double kPauseShare = 0.06;              // of session time, between one session and the next above it

}  // namespace

double Projection::lift(int session, double seconds) const {
  const auto base = base_seconds.find(session);
  return base == base_seconds.end() ? 0 : lift_per_second * (base->second + seconds);
}

Projection make_projection(const SessionScene& scene, const SessionPictureOptions& options) {
  Projection out;
  out.upright = upright_from_world(options.up);
  PlotBox plan;
  for (const SceneSession& session : scene.sessions)
    for (const ScenePose& pose : session.poses) plan.take((out.upright * pose.global_from_camera.t).head<2>());
  const Vector2d extent = (plan.high - plan.low).cwiseMax(1.0);
  const bool turned = extent.y() > extent.x();  // the longer side goes across
  out.page_from_upright << 1, 0, 0, 0, 1, 0;
  if (options.view == SessionPictureView::from_above) return out;
  if (options.view == SessionPictureView::from_the_side) {
    if (turned)
      out.page_from_upright << 0, 1, 0, 0, 0, 1;
    else
      out.page_from_upright << 1, 0, 0, 0, 0, 1;
    return out;
  }
  const double yaw = kYawRad + (turned ? -0.5 * M_PI : 0.0), c = std::cos(yaw), s = std::sin(yaw),
               flat = std::sin(kTiltRad);
  out.page_from_upright << c, -s, 0, flat * s, flat * c, 0;
  out.page_from_lift = {0, std::cos(kTiltRad)};
  double total = 0;
  for (const SceneSession& session : scene.sessions) total += std::max(session.seconds(), 1e-3);
  double base = 0;
  for (const SceneSession& session : scene.sessions) {
    out.base_seconds[session.id] = base;
    base += session.seconds() + kPauseShare * total;
  }
  out.lift_per_second = kLiftShare * extent.maxCoeff() / total;
  return out;
}

std::vector<double> PlotSection::grid_lines(int axis) const {
  const double length = (axis == 0 ? width_px : height_px) / px_per_m;
  std::vector<double> out;
  for (double v = std::ceil(low[axis] / grid_step_m) * grid_step_m; v <= low[axis] + length; v += grid_step_m)
    out.push_back(v);
  return out;
}

}  // namespace parallax
