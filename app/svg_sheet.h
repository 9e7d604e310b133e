// Drawings as SVG: well-formed XML with all text escaped, in a file or inside a page.
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

enum class SvgWidth { fixed, of_page };  // of_page: as wide as the page lets it be

// A sheet that becomes an <svg> element, in a page or in a file of its own.
class SvgSheet : public Canvas {
 public:
  // `label` is read out where nobody sees the picture. `attributes` stands in the element, after a space each:
  // ` data-plot="window"`.
  SvgSheet(int width_px, int height_px, SvgWidth width, const std::string& label = "",
           const std::string& attributes = "");

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

}  // namespace parallax
