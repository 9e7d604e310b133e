// Plots inside a page (app/svg_sheet.h).
//
// Plain values; used from one thread.
#pragma once

#include <string>
#include <vector>

#include "app/svg_sheet.h"

namespace parallax {

struct PlotSeries {
  std::string name;
  CanvasColour colour;
  bool line = false;  // else a dot each
  bool dashed = false;
  std::vector<CanvasPoint> points;
};

struct PlotAxes {
  std::string id;  // data-plot of the element
  std::string title, x_label, y_label;
  int width_px = 760, height_px = 300;
  SvgWidth width = SvgWidth::of_page;
};

// Both axes begin at 0 and reach as far as the points do. The element carries data-left, data-top, data-width,
// data-height (pixels of the frame), data-x (what its width stands for) and data-y; each series is a group with its
// name in data-series. Lines of more than 2000 points are thinned. No points at all: an empty text.
std::string plot_element(const std::vector<PlotSeries>& series, const PlotAxes& axes);

}  // namespace parallax
