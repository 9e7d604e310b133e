#include "app/svg_sheet.h"

#include <array>
#include <cstdint>
#include <cstdio>
#include <iomanip>

#include "app/base64.h"
#include "app/png_bytes.h"
#include "core/file_io.h"

namespace parallax {
namespace {

constexpr const char* kReplacement = "\xEF\xBF\xBD";  // U+FFFD

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

SvgSheet::SvgSheet(int width_px, int height_px, SvgWidth width, const std::string& label,
                   const std::string& attributes) {
  out_ << "<svg xmlns=\"http://www.w3.org/2000/svg\" ";
  if (width == SvgWidth::fixed)
    out_ << "width=\"" << width_px << "\" height=\"" << height_px << "\"";
  else
    out_ << "style=\"width:100%;max-width:" << width_px << "px;height:auto\"";
  out_ << " viewBox=\"0 0 " << width_px << ' ' << height_px << "\" font-family=\"sans-serif\" role=\"img\"";
  if (!label.empty()) out_ << " aria-label=\"" << markup_text(label) << "\"";
  out_ << attributes << ">\n"
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
  out_ << "<image x=\"" << top_left.x << "\" y=\"" << top_left.y << "\" width=\"" << picture.cols << "\" height=\""
       << picture.rows << "\" href=\"data:image/png;base64," << to_base64(png_bytes(picture, "the picture"))
       << "\"/>\n";
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

}  // namespace parallax
