#include "app/calibrate_plots.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iomanip>
#include <numbers>
#include <sstream>

#include "app/eval_canvas.h"
#include "core/error.h"

namespace parallax {
namespace {

constexpr CanvasColour black{20, 20, 20}, grey{190, 190, 190}, blue{40, 90, 190}, red{200, 50, 40};

std::string rounded(double value, int digits) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(digits) << value;
  return text.str();
}

void cross(Canvas* canvas, double x, double y, CanvasColour colour) {
  canvas->polyline({{x - 2, y}, {x + 2, y}}, colour, 1);
  canvas->polyline({{x, y - 2}, {x, y + 2}}, colour, 1);
}

void frame(Canvas* canvas, double x, double y, double width, double height) {
  canvas->polyline({{x, y}, {x + width, y}, {x + width, y + height}, {x, y + height}, {x, y}}, black, 1);
}

void plot_scatter(const CameraCalibration& c, const std::string& path) {
  constexpr double size = 520, margin = 40;
  const auto canvas = make_canvas(path, static_cast<int>(size + 2 * margin), static_cast<int>(size + 2 * margin));
  const double reach = std::max(5 * c.noise_px, 1e-9), scale = 0.5 * size / reach, middle = margin + 0.5 * size;
  frame(canvas.get(), margin, margin, size, size);
  for (int k = 1; k <= 3; ++k) {
    std::vector<CanvasPoint> circle;
    for (int i = 0; i <= 72; ++i) {
      const double angle = 2 * std::numbers::pi * i / 72;
      circle.push_back(
          {middle + k * c.noise_px * scale * std::cos(angle), middle + k * c.noise_px * scale * std::sin(angle)});
    }
    canvas->polyline(circle, grey, 1);
  }
  for (const auto& view : c.views) {
    for (const auto& r : view.residuals) {
      const double x = middle + std::clamp(r.residual_px.x(), -reach, reach) * scale;
      const double y = middle + std::clamp(r.residual_px.y(), -reach, reach) * scale;
      cross(canvas.get(), x, y, r.used ? blue : red);
    }
  }
  canvas->text(
      {middle, margin - 12},
      "residuals, predicted less seen; circles: 1, 2, 3 standard deviations of " + rounded(c.noise_px, 3) + " px", 13,
      TextAnchor::middle, black);
  canvas->text({middle, margin + size + 24}, rounded(-reach, 2) + " px to " + rounded(reach, 2) + " px; red: outliers",
               13, TextAnchor::middle, black);
  canvas->save(path);
}

void plot_map(const CameraCalibration& c, const std::string& path) {
  constexpr double width = 800, margin = 40;
  const double scale = width / c.camera.width(), height = c.camera.height() * scale;
  const auto canvas = make_canvas(path, static_cast<int>(width + 2 * margin), static_cast<int>(height + 2 * margin));
  const double enlarge = c.noise_px > 0 ? 0.012 * c.camera.width() / c.noise_px : 1;
  frame(canvas.get(), margin, margin, width, height);
  for (const auto& view : c.views) {
    for (const auto& r : view.residuals) {
      const CanvasPoint from{margin + (r.px.x() + 0.5) * scale, margin + (r.px.y() + 0.5) * scale};
      Eigen::Vector2d arrow = r.residual_px * enlarge * scale;
      if (arrow.norm() > 60) arrow *= 60 / arrow.norm();
      canvas->polyline({from, {from.x + arrow.x(), from.y + arrow.y()}}, r.used ? blue : red, 1);
    }
  }
  canvas->text({margin + 0.5 * width, margin - 12},
               "residuals in the image, " + rounded(enlarge, 0) + " times enlarged; red: outliers", 13,
               TextAnchor::middle, black);
  canvas->save(path);
}

// From nearly white (none) over orange to red (the limit).
CanvasColour heat(double share) {
  const double s = 2 * std::clamp(share, 0.0, 1.0);
  const auto mix = [s](int a, int b, int c) {
    return static_cast<int>(std::lround(s < 1 ? a + s * (b - a) : b + (s - 1) * (c - b)));
  };
  return {mix(240, 255, 200), mix(246, 195, 40), mix(255, 90, 30)};
}

// A filled rectangle of thin lines, since lines are all that a canvas draws.
void fill(Canvas* canvas, double x, double y, double width, double height, CanvasColour colour) {
  constexpr double step = 2;
  for (double at = 0.5 * step; at < height; at += step)
    canvas->polyline({{x, y + at}, {x + width, y + at}}, colour, step + 0.5);
}

void plot_uncertainty(const CalibrateReport& report, const std::string& path) {
  constexpr double width = 800, margin = 40, legend = 40;
  const CameraModel& camera = report.outcome.calibration.camera;
  const double scale = width / camera.width(), height = camera.height() * scale;
  const auto canvas =
      make_canvas(path, static_cast<int>(width + 2 * margin), static_cast<int>(height + 2 * margin + legend));
  const UncertaintyMap& map = report.uncertainty;
  const double limit = std::max(map.max_px, 1e-9);
  const double cell_width = width / map.columns, cell_height = height / map.rows;
  for (int row = 0; row < map.rows; ++row) {
    for (int column = 0; column < map.columns; ++column) {
      fill(canvas.get(), margin + column * cell_width, margin + row * cell_height, cell_width, cell_height,
           heat(map.at(column, row) / limit));
    }
  }
  for (int row = 0; row < map.rows; row += 3)
    for (int column = 0; column < map.columns; column += 4)
      canvas->text({margin + (column + 0.5) * cell_width, margin + (row + 0.5) * cell_height + 4},
                   rounded(map.at(column, row), 2), 10, TextAnchor::middle, black);
  frame(canvas.get(), margin, margin, width, height);
  canvas->text({margin + 0.5 * width, margin - 12}, "projection uncertainty, one standard deviation in pixels", 13,
               TextAnchor::middle, black);
  for (int i = 0; i < 100; ++i) {
    fill(canvas.get(), margin + width * i / 100, margin + height + 14, width / 100, 12, heat(i / 99.0));
  }
  canvas->text({margin, margin + height + 46}, "0", 12, TextAnchor::left, black);
  canvas->text({margin + width, margin + height + 46}, rounded(limit, 3) + " px", 12, TextAnchor::right, black);
  canvas->save(path);
}

}  // namespace

void plot_calibration(const CalibrateReport& report, const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw RunError(folder + ": cannot be made: " + error.message());
  for (const char* extension : {".svg", ".png"}) {
    const auto path = [&](const char* name) {
      return (std::filesystem::path(folder) / (std::string(name) + extension)).string();
    };
    plot_scatter(report.outcome.calibration, path("residuals"));
    plot_map(report.outcome.calibration, path("residual_map"));
    plot_uncertainty(report, path("uncertainty"));
  }
}

}  // namespace parallax
