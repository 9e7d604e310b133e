// The AR view as a picture to be drawn: the camera's image with points coloured by level, the dominant plane's grid
// (PTAM §6.1 and Figure 1), trails while initialising, and what the user has placed. The same for the window and for
// `run --video`.
//
// Pure functions on values; thread-safe. Screen positions are pixels of level 0, world is metres.
#pragma once

#include <optional>

#include "core/frame.h"
#include "map/content.h"
#include "map/tracking_snapshot.h"
#include "render/draw_list.h"
#include "tracker/tracking_types.h"

namespace parallax {

struct AugmentedSettings {
  bool points = true;          // found map points
  bool missed_points = false;  // points looked for and not found, as faint rings
  bool grid = true;            // the dominant plane
  bool other_planes = true;
  bool trails = true;
  bool content = true;
  bool crosshair = false;  // at the optical axis
  bool dim_when_lost = true;
};

struct AugmentedInput {
  const Frame* frame = nullptr;             // required
  const TrackingResult* tracked = nullptr;  // null: the bare image (no session yet)
  const TrackingSnapshot* map = nullptr;    // as the tracker saw it; null: no planes
  const Content* content = nullptr;         // in the world of `map`; null: nothing is placed
  Eigen::Vector3f ambient_light = Eigen::Vector3f::Constant(1);
  std::optional<Eigen::Vector2d> cursor_px;    // a hit mark is drawn where it meets a plane or point
  std::optional<int> selected;                 // the item of the content that is highlighted
  std::vector<Eigen::Vector3d> picked_points;  // world: marked (two points picked to set the scale)
};

// The image is shared with the frame, not copied, except when it is dimmed.
DrawList augmented_view(const CameraModel& camera, const AugmentedInput& input, const AugmentedSettings& settings = {});

// The colour of the grid: changed when the coarse stage was not run (PTAM §5.4 and its video).
DrawColour grid_colour(bool coarse_stage);

}  // namespace parallax
