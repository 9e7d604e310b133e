// The plain 2D overlay of `run --video`: map points coloured by pyramid level, the dominant plane's grid (PTAM §6.1,
// and Figure 1), trails while initialising, and a state line, drawn anti-aliased over the camera's image.
//
// Pure functions on plain values; thread-safe. Pixels are level 0, the centre of the top-left pixel is (0, 0).
#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "core/image.h"
#include "core/se3.h"

namespace parallax {

struct OverlayPoint {
  Eigen::Vector2f px;
  int level = 0;      // pyramid level it was measured at, 0..3
  bool found = true;  // searched for and found; false: drawn as a faint ring
};

// A patch followed since the first key press: where it was then and where it is now.
struct OverlayTrail {
  Eigen::Vector2f from_px, to_px;
};

// A square grid on the plane z = 0 of the plane's frame, centred on its origin.
struct OverlayGrid {
  RigidTransform world_from_plane;
  double half_extent = 0.2;  // metres
  int cells = 8;             // along each side
};

struct OverlayInput {
  cv::Mat background;  // CV_8UC3 BGR or CV_8UC1; not modified
  CameraModel camera;
  RigidTransform camera_from_world;
  bool tracked = false;      // points and grid are drawn only then
  bool coarse_stage = true;  // the grid's colour says when the coarse stage was skipped (PTAM §5.4)
  std::span<const OverlayPoint> points;
  std::span<const OverlayTrail> trails;
  std::optional<OverlayGrid> grid;
  std::string state_line;  // ASCII; cut to fit; empty: no strip
  bool legend = true;      // which colour is which level, in the strip's right end
};

// The four level colours (BGR), told apart by colour-blind people too (Okabe and Ito's set): yellow, sky blue, bluish
// green, and vermilion for the coarsest.
const std::array<cv::Vec3b, kPyramidLevels>& overlay_level_colours();

// The overlay as a picture of the background's size. Throws CheckFailure when the background is empty or of another
// type.
cv::Mat3b draw_overlay(const OverlayInput& input);

// The image curve of a straight line a..b in the camera frame, bent as the lens bends it: pixels in order, in one or
// more pieces, without what is behind the camera or outside the lens's domain. Neighbours are within about 8 px unless
// the line leaves the image. Exposed for tests.
std::vector<std::vector<Eigen::Vector2d>> project_segment(const CameraModel& camera, const Eigen::Vector3d& a,
                                                          const Eigen::Vector3d& b);

}  // namespace parallax
