// A sheet to draw a plot on, written as SVG or PNG by the file's extension. Coordinates are pixels, x right, y down,
// origin in the top-left corner. Used from one thread.
#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

namespace parallax {

struct CanvasPoint {
  double x = 0, y = 0;
};

struct CanvasColour {
  int red = 0, green = 0, blue = 0;
};

enum class TextAnchor { left, middle, right };

class Canvas {
 public:
  virtual ~Canvas() = default;
  virtual void polyline(const std::vector<CanvasPoint>& points, CanvasColour colour, double width_px) = 0;
  // `at` is the left end, middle or right end of the base line. Letters outside ASCII may show as '?' in PNG.
  virtual void text(CanvasPoint at, const std::string& text, double size_px, TextAnchor anchor,
                    CanvasColour colour) = 0;
  // A picture, BGR, pixel by pixel; what is outside the sheet is cut off.
  virtual void image(CanvasPoint top_left, const cv::Mat3b& picture) = 0;
  // Whole or not at all; throws RunError.
  virtual void save(const std::string& path) const = 0;
};

// Throws InputError unless the path ends in .svg or .png.
void check_canvas_path(const std::string& path);
std::unique_ptr<Canvas> make_canvas(const std::string& path, int width_px, int height_px);

}  // namespace parallax
