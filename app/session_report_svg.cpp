#include "app/session_report_svg.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <iomanip>
#include <opencv2/imgcodecs.hpp>

#include "app/base64.h"
#include "core/error.h"
#include "core/file_io.h"

namespace parallax {
namespace {

constexpr const char* kReplacement = "\xEF\xBF\xBD";  // U+FFFD
constexpr std::size_t kMostLinePoints = 2000;
constexpr int kLeftPx = 62, kTopPx = 48, kRightPx = 16, kBottomPx = 44;
constexpr double kAxisTextPx = 12;
constexpr CanvasColour kAxisInk{50, 50, 50}, kAxisGrid{225, 225, 225};

// Bytes of the UTF-8 letter at `at` that XML may hold; 0: none.
std::size_t letter_length(const std::string& text, std::size_t at) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned first = byte(at);
  if (first < 0x80) return first >= 0x20 || first == '\n' || first == '\t' ? 1 : 0;
  const std::size_t length = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (first < 0xC2 || first > 0xF4 || at + length > text.size()) return 0;
  std::uint32_t letter = first & (0xFFU >> (length + 1));
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(at + i) & 0xC0) != 0x80) return 0;
    letter = (letter << 6) | (byte(at + i) & 0x3FU);
  }
  constexpr std::array<std::uint32_t, 5> least{0, 0, 0x80, 0x800, 0x10000};
  if (letter < least[length] || letter > 0x10FFFF || (letter >= 0xD800 && letter <= 0xDFFF)) return 0;
  return letter == 0xFFFE || letter == 0xFFFF ? 0 : length;
}

std::string colour_text(CanvasColour c) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), "#%02x%02x%02x", static_cast<unsigned>(c.red) & 255U,
                static_cast<unsigned>(c.green) & 255U, static_cast<unsigned>(c.blue) & 255U);
  return text.data();
}

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

std::string markup_text(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = letter_length(text, i);
    if (length != 1) {
      out += length == 0 ? kReplacement : text.substr(i, length);
      i += std::max<std::size_t>(length, 1);
      continue;
    }
    switch (text[i]) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += text[i];
    }
    ++i;
  }
  return out;
}

SvgSheet::SvgSheet(int width_px, int height_px, const std::string& label, const std::string& attributes) {
  out_ << "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " << width_px << ' ' << height_px
       << "\" style=\"width:100%;max-width:" << width_px << "px;height:auto\" font-family=\"sans-serif\" role=\"img\""
       << " aria-label=\"" << markup_text(label) << "\"" << attributes << ">\n"
       << "<rect width=\"" << width_px << "\" height=\"" << height_px << "\" fill=\"#ffffff\"/>\n"
       << std::fixed << std::setprecision(2);
}

void SvgSheet::polyline(const std::vector<CanvasPoint>& points, CanvasColour colour, double width_px) {
  if (points.size() < 2) return;
  out_ << "<polyline fill=\"none\" stroke=\"" << colour_text(colour) << "\" stroke-width=\"" << width_px
       << "\" stroke-linejoin=\"round\"";
  if (dashes_px_ > 0) out_ << " stroke-dasharray=\"" << dashes_px_ << "\"";
  out_ << " points=\"";
  for (const CanvasPoint& p : points) out_ << p.x << ',' << p.y << ' ';
  out_ << "\"/>\n";
}

void SvgSheet::text(CanvasPoint at, const std::string& text, double size_px, TextAnchor anchor, CanvasColour colour) {
  constexpr const char* anchors[] = {"start", "middle", "end"};
  out_ << "<text x=\"" << at.x << "\" y=\"" << at.y << "\" font-size=\"" << size_px << "\" fill=\""
       << colour_text(colour) << "\" text-anchor=\"" << anchors[static_cast<int>(anchor)] << "\">" << markup_text(text)
       << "</text>\n";
}

void SvgSheet::image(CanvasPoint top_left, const cv::Mat3b& picture) {
  if (picture.empty()) return;
  std::vector<unsigned char> bytes;
  if (!cv::imencode(".png", picture, bytes)) throw RunError("the report's picture: cannot be encoded as PNG");
  out_ << "<image x=\"" << top_left.x << "\" y=\"" << top_left.y << "\" width=\"" << picture.cols << "\" height=\""
       << picture.rows << "\" href=\"data:image/png;base64," << to_base64(bytes) << "\"/>\n";
}

void SvgSheet::dots(const std::vector<CanvasPoint>& points, CanvasColour colour, double diameter_px) {
  if (points.empty()) return;
  out_ << "<path fill=\"none\" stroke=\"" << colour_text(colour) << "\" stroke-width=\"" << diameter_px
       << "\" stroke-linecap=\"round\" d=\"";
  for (const CanvasPoint& p : points) out_ << 'M' << p.x << ',' << p.y << "h0";
  out_ << "\"/>\n";
}

void SvgSheet::begin_group(const std::string& name) { out_ << "<g data-series=\"" << markup_text(name) << "\">\n"; }

void SvgSheet::end_group() { out_ << "</g>\n"; }

void SvgSheet::save(const std::string& path) const {
  write_file_atomically(path, [&](std::ostream& file) { file << element(); });
}

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
  SvgSheet sheet(axes.width_px, axes.height_px, axes.title, attributes.str());
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
