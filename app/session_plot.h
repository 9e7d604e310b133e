// The plot of one component of sessions (app/session_picture.h): where it lies, and its drawing on a canvas.
//
// First fit(), which tells how large it is, then draw(), then place(). Used from one thread.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "app/session_paper.h"

namespace parallax {

inline constexpr CanvasColour kPlotInk{40, 40, 40};
inline constexpr double kPlotTextPx = 13;
inline constexpr int kPlotLinePx = 20;  // from one line of text to the next

class SessionPlot {
 public:
  // `scene`: of one component. The options must outlive the plot. `first`: that of the earliest session, which a floor
  // plan lies under.
  SessionPlot(SessionScene scene, const SessionPictureOptions& options, bool first);

  // The plot is at most so large; its scale follows.
  void fit(double width_px, double most_height_px);
  int width_px() const { return section_.width_px; }
  int height_px() const;  // with legend and axis

  // `corner`: the upper left one, of the legend.
  void draw(CanvasPoint corner, Canvas* canvas);
  SessionPlotPlace place() const;

 private:
  struct LegendEntry {
    std::string text;
    CanvasColour colour;
    CanvasPoint at{};
  };

  bool is_elevation() const { return options_.view == SessionPictureView::elevation; }
  bool shows_ellipses() const { return options_.ellipses && !is_elevation() && !scene_.spreads.empty(); }
  std::size_t longest_name() const;
  // Obliquely too many links would be a curtain before the ways; from above they lie on them.
  int link_step(int count) const;
  std::array<Eigen::Vector2d, 4> corners() const;
  // Of a place on the plan, at session time zero.
  Eigen::Vector2d ground(const Eigen::Vector2d& plan, double lift_m = 0) const;
  Eigen::Vector2d way_page(const SceneSession& session, const ScenePose& pose) const;
  CanvasPoint on_sheet(const Eigen::Vector2d& page) const { return section_.on_sheet(page); }

  void fit_ground();
  void fill_legend(double width_px);
  void draw_ground(Canvas* canvas) const;
  void draw_links(bool within, Canvas* canvas) const;
  void draw_way(const SceneSession& session, Canvas* canvas) const;
  void draw_ellipses(Canvas* canvas) const;
  void draw_frame(Canvas* canvas) const;

  SessionScene scene_;
  const SessionPictureOptions& options_;
  bool first_;
  Projection projection_;
  PlotBox box_, plan_;
  Eigen::Vector2d time_corner_{0, 0};  // of the ground, farthest left: where session time is told
  std::vector<PaperPoint> points_;
  std::vector<LegendEntry> legend_;
  int legend_lines_ = 1;
  PlotSection section_;
};

}  // namespace parallax
