// Drawings and plots inside a page: SVG text that is well-formed XML, with all text escaped.
//
// Plain values; used from one thread.
#pragma once

#include <sstream>
#include <string>
#include <vector>

#include "app/eval_canvas.h"

namespace parallax {

// Text for a page or an attribute of it. What XML cannot hold (control letters, what is no UTF-8) becomes U+FFFD.
std::string markup_text(const std::string& text);

// A sheet that becomes an <svg> element, as wide as the page lets it be.
class SvgSheet : public Canvas {
 public:
  // `attributes` stands in the element, after a space each: ` data-plot="window"`.
  SvgSheet(int width_px, int height_px, const std::string& label, const std::string& attributes = "");

  void polyline(const std::vector<CanvasPoint>& points, CanvasColour colour, double width_px) override;
  void text(CanvasPoint at, const std::string& text, double size_px, TextAnchor anchor, CanvasColour colour) override;
  void image(CanvasPoint top_left, const cv::Mat3b& picture) override;
  void dots(const std::vector<CanvasPoint>& points, CanvasColour colour, double diameter_px);
  // Dashes of so many pixels for the lines that follow; 0: none.
  void set_dashes(double px) { dashes_px_ = px; }
  // What follows, up to end_group(), has this name.
  void begin_group(const std::string& name);
  void end_group();
  void save(const std::string& path) const override;

  std::string element() const { return out_.str() + "</svg>\n"; }

 private:
  std::ostringstream out_;
  double dashes_px_ = 0;
};

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
};

// Both axes begin at 0 and reach as far as the points do. The element carries data-left, data-top, data-width,
// data-height (pixels of the frame), data-x (what its width stands for) and data-y; each series is a group with its
// name in data-series. Lines of more than 2000 points are thinned. No points at all: an empty text.
std::string plot_element(const std::vector<PlotSeries>& series, const PlotAxes& axes);

}  // namespace parallax
