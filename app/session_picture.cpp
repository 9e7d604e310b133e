#include "app/session_picture.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "app/session_plot.h"
#include "core/error.h"

namespace parallax {
namespace {

constexpr int kPlotMarginPx = 52, kPlotsAcross = 3, kMostPlots = 12, kHeadPx = 44;
constexpr double kHeadTextPx = 18;

}  // namespace

std::vector<SessionPlotPlace> draw_sessions(const SessionScene& scene, const SessionPictureOptions& options,
                                            const std::function<Canvas*(int width_px, int height_px)>& sheet) {
  std::vector<SessionScene> components = scene.components();
  if (components.empty()) throw RunError("sessions: cannot be drawn: no session has a pose");
  const std::size_t parts = components.size(), drawn = std::min<std::size_t>(parts, kMostPlots);
  const std::size_t across = std::min<std::size_t>(drawn, kPlotsAcross);
  std::vector<SessionPlot> plots;
  const double width = static_cast<double>(options.width_px) / static_cast<double>(across) - kPlotMarginPx;
  const double most_height =
      across == 1 ? options.most_plot_height_px : std::min<double>(options.most_plot_height_px, 1.4 * width);
  for (std::size_t i = 0; i < drawn; ++i) {
    plots.emplace_back(std::move(components[i]), options, i == 0);
    plots.back().fit(width - 10, most_height);
  }
  const int head = (options.title.empty() ? 16 : kHeadPx) + (parts > 1 ? kPlotLinePx : 0);
  std::vector<int> row_tops;
  int y = head;
  for (std::size_t i = 0; i < drawn; i += across) {
    row_tops.push_back(y);
    int tallest = 0;
    for (std::size_t j = i; j < std::min(i + across, drawn); ++j) tallest = std::max(tallest, plots[j].height_px());
    y += tallest + 16;
  }
  // One plot alone does not need all of the sheet.
  const int sheet_width = across > 1
                              ? options.width_px
                              : std::min(options.width_px, std::max(760, plots[0].width_px() + 2 * kPlotMarginPx));
  Canvas* canvas = sheet(sheet_width, y);
  if (!options.title.empty()) canvas->text({kPlotMarginPx, 28}, options.title, kHeadTextPx, TextAnchor::left, kPlotInk);
  if (parts > 1) {
    std::string text =
        "Not all sessions have met: " + std::to_string(parts) + " parts, each in a plot and a frame of its own";
    if (parts > drawn) text += "; the first " + std::to_string(drawn) + " are drawn";
    canvas->text({kPlotMarginPx, static_cast<double>(head - 8)}, text, kPlotTextPx, TextAnchor::left, kPlotInk);
  }
  std::vector<SessionPlotPlace> places;
  for (std::size_t i = 0; i < drawn; ++i) {
    const double x = kPlotMarginPx + static_cast<double>(i % across) * (width + kPlotMarginPx);
    plots[i].draw({x, static_cast<double>(row_tops[i / across])}, canvas);
    places.push_back(plots[i].place());
  }
  return places;
}

void write_session_picture(const SessionScene& scene, const SessionPictureOptions& options, const std::string& path) {
  check_canvas_path(path);
  std::unique_ptr<Canvas> canvas;
  try {
    draw_sessions(scene, options, [&](int width, int height) {
      canvas = make_canvas(path, width, height);
      return canvas.get();
    });
  } catch (const RunError& e) {
    throw RunError(path + ": cannot be written: " + e.what());
  }
  canvas->save(path);
}

}  // namespace parallax
