#include "calib/target_pdf.h"

#include <cairo/cairo-pdf.h>
#include <cairo/cairo.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <sstream>

#include "core/error.h"
#include "core/file_io.h"

namespace parallax {
namespace {

constexpr double points_per_metre = 72 / 0.0254;
constexpr double margin_m = 0.008;   // printers leave some millimetres white
constexpr double caption_m = 0.016;  // below the target: text and ruler

struct Sheet {
  double width = 0, height = 0;  // metres, landscape
};

Sheet sheet_of(Paper paper) { return paper == Paper::a4 ? Sheet{0.297, 0.210} : Sheet{0.2794, 0.2159}; }

// Room for the target on the sheet, landscape or turned; a quarter of a square of white around the target is kept.
bool fits(const CalibrationTarget& target, Sheet sheet, bool turned) {
  if (turned) std::swap(sheet.width, sheet.height);
  const TargetExtent extent = target_extent(target);
  const double white = 0.25 * target.square_m;
  return extent.width() + 2 * (margin_m + white) <= sheet.width &&
         extent.height() + 2 * (margin_m + white) + caption_m <= sheet.height;
}

std::string millimetres(double metres) {
  std::ostringstream text;
  text << std::round(metres * 1e5) / 100 << " mm";
  return text.str();
}

void rectangle(cairo_t* cr, double x, double y, double width, double height) {
  cairo_rectangle(cr, x, y, width, height);
  cairo_fill(cr);
}

void draw_chessboard(cairo_t* cr, const CalibrationTarget& target) {
  const double s = target.square_m;
  for (int row = 0; row <= target.rows; ++row)
    for (int column = 0; column <= target.columns; ++column)
      if ((row + column) % 2 == 0) rectangle(cr, (column - 1) * s, (row - 1) * s, s, s);
}

void draw_markers(cairo_t* cr, const CalibrationTarget& target) {
  const double cell = target.detail() / 7;
  for (int marker = 0; marker < charuco_marker_count(target); ++marker) {
    Eigen::Vector2i square;
    const Eigen::Vector2d corner = charuco_marker(target, marker, &square)[0];
    const auto cells = charuco_marker_cells(marker);
    // Runs of cells in one piece, one path for the whole marker: no hairlines between them.
    for (std::size_t row = 0; row < 7; ++row) {
      for (std::size_t column = 0; column < 7;) {
        std::size_t end = column;
        while (end < 7 && cells[row][end] == cells[row][column]) ++end;
        if (cells[row][column])
          cairo_rectangle(cr, corner.x() + static_cast<double>(column) * cell,
                          corner.y() + static_cast<double>(row) * cell, static_cast<double>(end - column) * cell, cell);
        column = end;
      }
    }
    cairo_fill(cr);
  }
}

void draw_discs(cairo_t* cr, const CalibrationTarget& target) {
  for (const auto& centre : target_points(target)) {
    cairo_new_path(cr);
    cairo_arc(cr, centre.x(), centre.y(), 0.5 * target.detail(), 0, 2 * std::numbers::pi);
    cairo_fill(cr);
  }
}

void draw_squares(cairo_t* cr, const CalibrationTarget& target) {
  const auto points = target_points(target);
  for (std::size_t i = 0; i < points.size(); i += 4)
    rectangle(cr, points[i].x(), points[i].y(), target.square_m, target.square_m);
}

void draw_target(cairo_t* cr, const CalibrationTarget& target) {
  switch (target.kind) {
    case TargetKind::chessboard:
      return draw_chessboard(cr, target);
    case TargetKind::charuco:
      draw_chessboard(cr, target);
      return draw_markers(cr, target);
    case TargetKind::circles:
    case TargetKind::asymmetric_circles:
      return draw_discs(cr, target);
    case TargetKind::squares:
      return draw_squares(cr, target);
  }
}

std::string caption(const CalibrationTarget& target) {
  std::ostringstream text;
  text << "parallax calibrate --target " << to_string(target.kind) << " --board " << target.columns << "x"
       << target.rows << " --square " << std::round(target.square_m * 1e6) / 1e6 << "   (side "
       << millimetres(target.square_m);
  if (target.kind == TargetKind::charuco) text << ", marker " << millimetres(target.detail());
  if (target.kind == TargetKind::circles || target.kind == TargetKind::asymmetric_circles)
    text << ", disc " << millimetres(target.detail());
  text << "). Print at 100 %; the ruler is 100 mm:";
  return text.str();
}

// Text and ruler with the top left at (x, y), metres.
void draw_caption(cairo_t* cr, const CalibrationTarget& target, double x, double y, double width) {
  cairo_select_font_face(cr, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  double size = 0.0027;
  cairo_set_font_size(cr, size);
  const std::string text = caption(target);
  cairo_text_extents_t measure;
  cairo_text_extents(cr, text.c_str(), &measure);
  if (measure.width > width) cairo_set_font_size(cr, size * width / measure.width);
  cairo_move_to(cr, x, y + 0.004);
  cairo_show_text(cr, text.c_str());
  cairo_set_line_width(cr, 0.0002);
  const double base = y + 0.012;
  cairo_move_to(cr, x, base);
  cairo_line_to(cr, x + 0.1, base);
  for (int mm = 0; mm <= 100; ++mm) {
    const double tick = mm % 10 == 0 ? 0.004 : mm % 5 == 0 ? 0.003 : 0.0015;
    cairo_move_to(cr, x + mm * 0.001, base);
    cairo_line_to(cr, x + mm * 0.001, base - tick);
  }
  cairo_stroke(cr);
}

cairo_status_t append(void* closure, const unsigned char* data, unsigned int length) {
  static_cast<std::string*>(closure)->append(reinterpret_cast<const char*>(data), length);
  return CAIRO_STATUS_SUCCESS;
}

}  // namespace

Paper paper(const std::string& name) {
  if (name == "a4") return Paper::a4;
  if (name == "letter") return Paper::letter;
  throw InputError("paper: found '" + name + "', expected a4 or letter");
}

double fitting_square_m(const CalibrationTarget& target, Paper paper) {
  CalibrationTarget scaled = target;
  for (int mm = 100; mm > 2; --mm) {
    scaled.square_m = mm * 1e-3;
    if (target.detail_m > 0) scaled.detail_m = target.detail_m / target.square_m * scaled.square_m;
    if (fits(scaled, sheet_of(paper), false) || fits(scaled, sheet_of(paper), true)) return scaled.square_m;
  }
  return 0.002;
}

void write_target_pdf(const CalibrationTarget& target, Paper paper, const std::string& path) {
  target.validate();
  Sheet sheet = sheet_of(paper);
  const bool turned = !fits(target, sheet, false) && fits(target, sheet, true);
  if (!turned && !fits(target, sheet, false))
    throw InputError("square: found " + millimetres(target.square_m) +
                     ", with which the target is larger than the sheet, expected at most " +
                     millimetres(fitting_square_m(target, paper)));
  if (turned) std::swap(sheet.width, sheet.height);

  std::string bytes;
  {
    const std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)> surface(
        cairo_pdf_surface_create_for_stream(append, &bytes, sheet.width * points_per_metre,
                                            sheet.height * points_per_metre),
        &cairo_surface_destroy);
    cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_TITLE, "Parallax calibration target");
    const std::unique_ptr<cairo_t, decltype(&cairo_destroy)> cr(cairo_create(surface.get()), &cairo_destroy);
    cairo_scale(cr.get(), points_per_metre, points_per_metre);
    const TargetExtent extent = target_extent(target);
    const double left = 0.5 * (sheet.width - extent.width()), top = 0.5 * (sheet.height - caption_m - extent.height());
    draw_caption(cr.get(), target, margin_m + 0.004, sheet.height - margin_m - caption_m + 0.002,
                 sheet.width - 2 * margin_m - 0.008);
    cairo_translate(cr.get(), left - extent.left, top - extent.top);
    draw_target(cr.get(), target);
    cairo_show_page(cr.get());
    cairo_surface_finish(surface.get());
    if (cairo_surface_status(surface.get()) != CAIRO_STATUS_SUCCESS) throw RunError(path + ": the PDF cannot be made");
  }
  write_file_atomically(path, [&](std::ostream& out) { out << bytes; });
}

}  // namespace parallax
