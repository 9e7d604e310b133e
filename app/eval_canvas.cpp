#include "app/eval_canvas.h"

#include <cmath>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "app/png_bytes.h"
#include "app/svg_sheet.h"
#include "core/error.h"
#include "core/file_io.h"

namespace parallax {
namespace {

class PngCanvas : public Canvas {
 public:
  PngCanvas(int width, int height) : image_(height, width, CV_8UC3, cv::Scalar(255, 255, 255)) {}

  void polyline(const std::vector<CanvasPoint>& points, CanvasColour colour, double width_px) override {
    if (points.size() < 2) return;
    constexpr int kFractionBits = 4;
    std::vector<cv::Point> fixed_point;
    for (const auto& p : points) {
      fixed_point.emplace_back(static_cast<int>(std::lround(p.x * (1 << kFractionBits))),
                               static_cast<int>(std::lround(p.y * (1 << kFractionBits))));
    }
    cv::polylines(image_, fixed_point, false, scalar(colour), std::max(1, static_cast<int>(std::lround(width_px))),
                  cv::LINE_AA, kFractionBits);
  }

  void text(CanvasPoint at, const std::string& text, double size_px, TextAnchor anchor, CanvasColour colour) override {
    constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
    constexpr double kFontHeightPx = 30;  // of this font at scale 1, ascenders and descenders
    const double scale = size_px / kFontHeightPx;
    int base_line = 0;
    const cv::Size size = cv::getTextSize(text, kFont, scale, 1, &base_line);
    const double shift = anchor == TextAnchor::left ? 0 : anchor == TextAnchor::middle ? 0.5 : 1.0;
    cv::putText(image_, text, cv::Point(cvRound(at.x - shift * size.width), cvRound(at.y)), kFont, scale,
                scalar(colour), 1, cv::LINE_AA);
  }

  void image(CanvasPoint top_left, const cv::Mat3b& picture) override {
    const cv::Point corner(cvRound(top_left.x), cvRound(top_left.y));
    const cv::Rect there = cv::Rect(corner, picture.size()) & cv::Rect({0, 0}, image_.size());
    if (!there.empty()) picture(there - corner).copyTo(image_(there));
  }

  void save(const std::string& path) const override { write_file_atomically(path, png_bytes(image_, path)); }

 private:
  static cv::Scalar scalar(CanvasColour c) { return {double(c.blue), double(c.green), double(c.red)}; }

  cv::Mat image_;
};

std::string extension(const std::string& path) { return std::filesystem::path(path).extension().string(); }

}  // namespace

void check_canvas_path(const std::string& path) {
  if (extension(path) == ".svg" || extension(path) == ".png") return;
  throw InputError(path + ": a plot is written as .svg or .png, found '" + extension(path) + "'");
}

std::unique_ptr<Canvas> make_canvas(const std::string& path, int width_px, int height_px) {
  check_canvas_path(path);
  if (extension(path) == ".svg") return std::make_unique<SvgSheet>(width_px, height_px, SvgWidth::fixed);
  return std::make_unique<PngCanvas>(width_px, height_px);
}

}  // namespace parallax
