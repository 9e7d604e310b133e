// How a picture of sessions lies on its sheet: from the global frame to a page in metres (x right, y up), and from the
// page to the pixels of a plot (x right, y down).
//
// Plain values and pure functions, safe from any thread.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <map>
#include <vector>

#include "app/session_picture.h"

namespace parallax {

struct PlotBox {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::max()), high = -low;
  void take(const Eigen::Vector2d& p) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  bool empty() const { return !(low.x() <= high.x()); }
};

// From the global frame to the page; linear in place and lift.
struct Projection {
  Eigen::Matrix<double, 2, 3> page_from_upright;
  Eigen::Vector2d page_from_lift{0, 0};
  Eigen::Matrix3d upright;
  double lift_per_second = 0;          // metres
  std::map<int, double> base_seconds;  // at which a session begins

  Eigen::Vector2d page(const Eigen::Vector3d& place, double lift_m = 0) const {
    return page_from_upright * (upright * place) + page_from_lift * lift_m;
  }
  double lift(int session, double seconds) const;
};

// The scene has a pose.
Projection make_projection(const SessionScene& scene, const SessionPictureOptions& options);

// The part of the page that a plot shows, and where on the sheet.
struct PlotSection {
  Eigen::Vector2d low{0, 0};  // of the page, at the plot's lower left corner
  double px_per_m = 1, grid_step_m = 1;
  int width_px = 0, height_px = 0;
  CanvasPoint corner;  // on the sheet, of the plot's upper left corner

  CanvasPoint on_sheet(const Eigen::Vector2d& page) const {
    return {corner.x + (page.x() - low.x()) * px_per_m, corner.y + height_px - (page.y() - low.y()) * px_per_m};
  }
  // Of a picture that fills the plot: the centre of its top-left pixel is (0, 0).
  Eigen::Vector2d pixel(const Eigen::Vector2d& page) const {
    return {(page.x() - low.x()) * px_per_m - 0.5, height_px - 0.5 - (page.y() - low.y()) * px_per_m};
  }
  // Page coordinates of the grid's lines, across (0) or up (1).
  std::vector<double> grid_lines(int axis) const;
};

}  // namespace parallax
