// What lies under the ways in a plot of sessions: floor plan, grid, and the points of the map, as pixels.
//
// `upright` is the global frame turned upright (core/point_cloud.h). Pure functions, safe from any thread.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "app/session_projection.h"

namespace parallax {

inline constexpr CanvasColour kPlotGrid{208, 208, 208};

struct PaperPoint {
  Eigen::Vector3d place;  // upright
  std::array<std::uint8_t, 3> rgb;
  bool textured;
};

// The scene's points; from above without those that hang high over the ways (ceilings).
std::vector<PaperPoint> choose_paper_points(const SessionScene& scene, const SessionPictureOptions& options,
                                            const Projection& projection);

// Where all but a few strays of them are on the page; empty for no points.
PlotBox box_of_most(const std::vector<PaperPoint>& points, const Projection& projection);

// `plan` may be null.
cv::Mat3b draw_paper(const std::vector<PaperPoint>& points, const FloorPlan* plan, const SessionPictureOptions& options,
                     const Projection& projection, const PlotSection& section);

}  // namespace parallax
