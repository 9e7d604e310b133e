// Pictures of sessions, to scale: from above, from the side (MS Fig. 12), or obliquely with the elevation growing with
// session time (Fig. 10e). Each session in its colour, links in two more, ellipses that hold 95 % of a keyframe's
// possible places, a grid, points and a floor plan under it. Sessions that have not met are drawn in plots of their
// own.
//
// Map coordinates: the global frame turned upright (core/point_cloud.h), metres. Plain functions, safe from any thread.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "app/eval_canvas.h"
#include "app/map_picture.h"
#include "app/session_view_scene.h"

namespace parallax {

enum class SessionPictureView { from_above, from_the_side, elevation };

struct SessionPictureOptions {
  SessionPictureView view = SessionPictureView::from_above;
  Eigen::Vector3d up{0, -1, 0};  // of the global frame: the default is that of one that began as a level camera
  int width_px = 1400;
  int most_plot_height_px = 900;
  double point_strength = 0.4;    // of the points' ink against paper, 0..1; textured ones have all of it
  double most_above_way_m = 0.5;  // from above: points that are higher over the nearest way are left out (ceilings)
  bool ellipses = true;           // not in the elevation picture
  std::string title;
  std::optional<FloorPlan> floor_plan;  // from above, under the component of the earliest session
};

// Where a plot puts a place, told to whoever wants to know (tests, the report).
struct SessionPlotPlace {
  int component = 0;
  double px_per_m = 1;
  CanvasPoint corner;  // on the sheet, of the plot's upper left corner
  int width_px = 0, height_px = 0;
  // A place of the component's global frame, `seconds` of session time into session `id`.
  std::function<CanvasPoint(const Eigen::Vector3d& place, int id, double seconds)> at;
};

// `sheet` is called once, with the size of the sheet to draw on. Throws RunError when no session has a pose.
std::vector<SessionPlotPlace> draw_sessions(const SessionScene& scene, const SessionPictureOptions& options,
                                            const std::function<Canvas*(int width_px, int height_px)>& sheet);

// The path ends in .png or .svg (InputError). Throws RunError when it cannot be written, or there is nothing to draw.
void write_session_picture(const SessionScene& scene, const SessionPictureOptions& options, const std::string& path);

}  // namespace parallax
