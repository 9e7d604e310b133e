#include "app/augmented_view.h"

#include <cmath>

#include "app/content_drawing.h"
#include "app/level_colours.h"
#include "core/check.h"
#include "map/hit_test.h"

namespace parallax {
namespace {

constexpr DrawColour kDark{0.06f, 0.06f, 0.06f, 0.85f};
constexpr DrawColour kTrailTail{240 / 255.0f, 228 / 255.0f, 66 / 255.0f, 0.8f};
constexpr DrawColour kTrailHead{213 / 255.0f, 94 / 255.0f, 0, 1};
constexpr DrawColour kOtherPlane{0.8f, 0.6f, 0.95f, 0.7f};
constexpr DrawColour kAim{1, 1, 1, 0.9f};
constexpr DrawColour kPicked{1.0f, 0.35f, 0.75f, 1};
constexpr double kDimmed = 0.35;  // of the light that is left while lost
constexpr int kGridCells = 10, kOtherCells = 6;

void add_points(const std::vector<TrackedPoint>& points, const AugmentedSettings& settings, DrawList* out) {
  for (const TrackedPoint& p : points) {
    if (!p.pixel.allFinite()) continue;
    const float size = 3.5f + static_cast<float>(p.level);
    DrawColour colour = level_colour(p.level);
    if (p.found && settings.points) {
      out->screen_points.push_back({p.pixel, kDark, size + 1.5f, false});
      out->screen_points.push_back({p.pixel, colour, size, false});
    } else if (!p.found && settings.missed_points) {
      colour.a = 0.45f;
      out->screen_points.push_back({p.pixel, colour, size + 1, true});
    }
  }
}

void add_trails(const TrackingResult& tracked, DrawList* out) {
  for (const auto& t : tracked.trails) {
    if (!t[0].allFinite() || !t[1].allFinite()) continue;
    out->screen_lines.push_back({t[0], t[1], kTrailTail, 1.2f});
    out->screen_points.push_back({t[1], kTrailHead, 4, false});
  }
}

// A cross with an open middle.
void add_crosshair(const Eigen::Vector2f& at, const CameraModel& camera, DrawList* out) {
  const float unit = static_cast<float>(camera.height()) / 480;
  for (const auto& [dx, dy] : {std::pair{1.0f, 0.0f}, {-1.0f, 0.0f}, {0.0f, 1.0f}, {0.0f, -1.0f}}) {
    const Eigen::Vector2f d(dx, dy);
    out->screen_lines.push_back({at + 5 * unit * d, at + 16 * unit * d, kDark, 3.5f * unit});
    out->screen_lines.push_back({at + 5 * unit * d, at + 16 * unit * d, kAim, 1.5f * unit});
  }
}

void add_aim(const CameraModel& camera, const RigidTransform& camera_from_world, const AugmentedInput& input,
             const Eigen::Vector2d& at, DrawList* out) {
  const auto hit = hit_test(camera, camera_from_world, at, *input.map);
  if (!hit) return;
  // As large on the screen wherever it is.
  const double radius = 14 * hit->distance_m / camera.mean_focal_px() * camera.height() / 480;
  add_ring(frame_on_surface(hit->position, hit->normal), radius, kAim, 1.5f, out);
  out->world_lines.push_back({hit->position.cast<float>(), (hit->position + radius * hit->normal).cast<float>(), kAim});
}

}  // namespace

DrawColour grid_colour(bool coarse_stage) {
  return coarse_stage ? DrawColour{0.94f, 0.94f, 0.94f, 0.9f} : DrawColour{0.16f, 0.75f, 0.9f, 0.9f};
}

DrawList augmented_view(const CameraModel& camera, const AugmentedInput& input, const AugmentedSettings& settings) {
  PARALLAX_CHECK(input.frame != nullptr, "an AR view needs a frame");
  DrawList out;
  out.background = input.frame->colour.empty() ? cv::Mat(input.frame->grey) : cv::Mat(input.frame->colour);
  out.camera = camera;
  out.ambient_light = input.ambient_light;
  Eigen::Vector2d middle = camera.centre_px();
  camera.project(Eigen::Vector3d::UnitZ(), &middle);

  const TrackingResult* tracked = input.tracked;
  if (tracked != nullptr) {
    if (tracked->state == TrackingState::lost && settings.dim_when_lost) {
      cv::Mat dimmed;
      out.background.convertTo(dimmed, -1, kDimmed);
      out.background = dimmed;
    }
    if (settings.trails) add_trails(*tracked, &out);
    if (tracked->camera_from_world) {
      out.camera_from_world = tracked->camera_from_world;
      add_points(tracked->points, settings, &out);
      if (input.map != nullptr) {
        const std::vector<Plane> planes = planes_of(*input.map);
        for (std::size_t i = 0; i < planes.size(); ++i) {
          if (i == 0 ? settings.grid : settings.other_planes)
            out.grids.push_back({planes[i].world_from_plane, planes[i].extent_m, i == 0 ? kGridCells : kOtherCells,
                                 i == 0 ? grid_colour(tracked->coarse_stage) : kOtherPlane});
        }
        if (!planes.empty()) out.shadow_plane = planes.front().world_from_plane;
        if (input.cursor_px) add_aim(camera, *out.camera_from_world, input, *input.cursor_px, &out);
        if (settings.crosshair) add_aim(camera, *out.camera_from_world, input, middle, &out);
      }
      if (settings.content && input.content != nullptr) draw_content(*input.content, input.selected, &out);
      for (const Eigen::Vector3d& p : input.picked_points) {
        out.world_points.push_back({p.cast<float>(), kDark, 10});
        out.world_points.push_back({p.cast<float>(), kPicked, 7});
      }
      if (input.picked_points.size() == 2)
        out.world_lines.push_back(
            {input.picked_points[0].cast<float>(), input.picked_points[1].cast<float>(), kPicked, 2});
    }
  }
  if (settings.crosshair) add_crosshair(middle.cast<float>(), camera, &out);
  return out;
}

}  // namespace parallax
