// Pictures of a textured map, drawn to scale: from above or from the side, with a grid, the ways of the camera and,
// under it, a floor plan (MS Fig. 7, 10, 12). PNG, or SVG with the points as one picture in it.
//
// Map coordinates: the world turned upright (core/point_cloud.h), metres; x to the right, y up the page, z to the
// viewer.
#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "app/eval_canvas.h"
#include "core/point_cloud.h"

namespace parallax {

// An image of the floor to scale, as map servers of robots keep it.
struct FloorPlan {
  cv::Mat3b image;
  double metres_per_px = 0.05;
  Eigen::Vector2d corner_m{0, 0};  // of the image's lower left corner, in map coordinates
  double turn_rad = 0;             // of the image about that corner, anticlockwise
};

// A YAML file with `image` (PNG or JPEG, beside the file), `resolution` (metres a pixel) and `origin: [x, y, yaw]`, as
// of ROS' map_server; other keys are passed over. Throws InputError.
FloorPlan read_floor_plan(const std::string& path);

struct MapPath {
  std::vector<Eigen::Vector3d> places;  // world, in order
  CanvasColour colour{20, 90, 200};
  std::string name;  // for the legend; may be empty
};

enum class MapPictureView { from_above, from_the_side };  // the side shows the longer way across

struct MapPictureOptions {
  MapPictureView view = MapPictureView::from_above;
  Eigen::Vector3d up{0, -1, 0};  // of the world: the default is that of a world that began as a level camera
  int width_px = 1400;
  int most_height_px = 1400;
  // From above: points higher than this over the nearest place of a way are left out, or ceilings would hide the rooms.
  double most_above_path_m = 0.5;
  std::string title;
  std::optional<FloorPlan> floor_plan;  // from above only
};

// The path ends in .png or .svg (InputError). Throws RunError when it cannot be written, or there is nothing to draw.
void draw_map_picture(const std::vector<ColouredPoint>& points, const std::vector<MapPath>& paths,
                      const MapPictureOptions& options, const std::string& path);

// Metres between the grid's lines for so many metres across: 1, 2, 5, 10...
double map_grid_step(double extent_m);

}  // namespace parallax
