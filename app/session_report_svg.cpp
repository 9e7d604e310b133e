#include "app/session_report_svg.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iomanip>

namespace parallax {
namespace {

constexpr std::size_t kMostLinePoints = 2000;
constexpr int kLeftPx = 62, kTopPx = 48, kRightPx = 16, kBottomPx = 44;
constexpr double kAxisTextPx = 12;
constexpr CanvasColour kAxisInk{50, 50, 50}, kAxisGrid{225, 225, 225};

// A round number of which some `count` make up the extent.
double round_step(double extent, double count) {
  const double raw = extent / count, power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (raw <= factor * power) return factor * power;
  return 10 * power;
}

std::string axis_number(double value) {
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), "%.6g", value);
  return text.data();
}

std::vector<CanvasPoint> thinned(const std::vector<CanvasPoint>& points) {
  if (points.size() <= kMostLinePoints) return points;
  std::vector<CanvasPoint> out;
  for (std::size_t i = 0; i < kMostLinePoints; ++i)
    out.push_back(points[i * (points.size() - 1) / (kMostLinePoints - 1)]);
  return out;
}

}  // namespace

std::string plot_element(const std::vector<PlotSeries>& series, const PlotAxes& axes) {
  double x_high = 0, y_high = 0;
  bool any = false;
  for (const PlotSeries& s : series)
    for (const CanvasPoint& p : s.points) {
      x_high = std::max(x_high, p.x);
      y_high = std::max(y_high, p.y);
      any = true;
    }
  if (!any) return {};
  x_high = x_high > 0 ? x_high * 1.02 : 1;
  y_high = y_high > 0 ? y_high * 1.06 : 1;
  const double width = axes.width_px - kLeftPx - kRightPx, height = axes.height_px - kTopPx - kBottomPx;
  std::ostringstream attributes;
  attributes << std::setprecision(12) << " data-plot=\"" << markup_text(axes.id) << "\" data-left=\"" << kLeftPx
             << "\" data-top=\"" << kTopPx << "\" data-width=\"" << width << "\" data-height=\"" << height
             << "\" data-x=\"" << x_high << "\" data-y=\"" << y_high << "\"";
  SvgSheet sheet(axes.width_px, axes.height_px, axes.width, axes.title, attributes.str());
  const auto at = [&](double x, double y) {
    return CanvasPoint{kLeftPx + x / x_high * width, kTopPx + (1 - y / y_high) * height};
  };
  const double x_step = round_step(x_high, 8), y_step = round_step(y_high, 5);
  for (double v = 0; v <= x_high; v += x_step) {
    sheet.polyline({at(v, 0), at(v, y_high)}, kAxisGrid, 1);
    sheet.text({at(v, 0).x, kTopPx + height + 16}, axis_number(v), kAxisTextPx, TextAnchor::middle, kAxisInk);
  }
  for (double v = 0; v <= y_high; v += y_step) {
    sheet.polyline({at(0, v), at(x_high, v)}, kAxisGrid, 1);
    sheet.text({kLeftPx - 6.0, at(0, v).y + 4}, axis_number(v), kAxisTextPx, TextAnchor::right, kAxisInk);
  }
  sheet.polyline({at(0, y_high), at(0, 0), at(x_high, 0)}, kAxisInk, 1);
  sheet.text({kLeftPx, 18}, axes.title, 15, TextAnchor::left, kAxisInk);
  sheet.text({kLeftPx - 6.0, kTopPx - 8.0}, axes.y_label, kAxisTextPx, TextAnchor::right, kAxisInk);
  sheet.text({kLeftPx + width, kTopPx + height + 34}, axes.x_label, kAxisTextPx, TextAnchor::right, kAxisInk);
  double legend_x = kLeftPx + 8;
  for (const PlotSeries& s : series) {
    if (s.points.empty()) continue;
    std::vector<CanvasPoint> points;
    for (const CanvasPoint& p : s.line ? thinned(s.points) : s.points) points.push_back(at(p.x, p.y));
    sheet.set_dashes(s.dashed ? 6 : 0);
    sheet.begin_group(s.name);
    if (s.line)
      sheet.polyline(points, s.colour, 1.8);
    else
      sheet.dots(points, s.colour, s.points.size() > 3000 ? 2.5 : 4);
    sheet.end_group();
    sheet.set_dashes(0);
    const double entry_px = 44 + 6.6 * static_cast<double>(s.name.size());
    if (legend_x + entry_px > axes.width_px) continue;  // colours are told on the maps too
    sheet.set_dashes(s.dashed ? 6 : 0);
    if (s.line)
      sheet.polyline({{legend_x, kTopPx - 12.0}, {legend_x + 22, kTopPx - 12.0}}, s.colour, 2.5);
    else
      sheet.dots({{legend_x + 11, kTopPx - 12.0}}, s.colour, 7);
    sheet.set_dashes(0);
    sheet.text({legend_x + 27, kTopPx - 8.0}, s.name, kAxisTextPx, TextAnchor::left, kAxisInk);
    legend_x += entry_px;
  }
  return sheet.element();
}

}  // namespace parallax
