#include "app/session_paper.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "app/way_heights.h"

namespace parallax {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kPlanFade = 0.55;      // of a floor plan's ink that is taken away
constexpr double kStrayPoints = 0.002;  // share of the points at each end that does not widen the plot
constexpr double kPaperPointM = 0.03;   // side of a point on paper

void lay_plan(const FloorPlan& plan, const PlotSection& section, cv::Mat3b* paper) {
  cv::Mat3b faded;
  plan.image.convertTo(faded, CV_8U, 1 - kPlanFade, 255 * kPlanFade);
  const Eigen::Rotation2Dd turn(plan.turn_rad);
  const auto corner = [&](double u, double v) {
    const Vector2d p =
        section.pixel(plan.corner_m + turn * (plan.metres_per_px * Vector2d(u + 0.5, faded.rows - 0.5 - v)));
    return cv::Point2f(static_cast<float>(p.x()), static_cast<float>(p.y()));
  };
  const std::array<cv::Point2f, 3> from{cv::Point2f(0, 0), cv::Point2f(100, 0), cv::Point2f(0, 100)},
      to{corner(0, 0), corner(100, 0), corner(0, 100)};
  const double shrink = section.px_per_m * plan.metres_per_px;
  if (shrink < 1) cv::GaussianBlur(faded, faded, {0, 0}, 0.4 / shrink);  // thin lines stay between the pixels
  cv::warpAffine(faded, *paper, cv::getAffineTransform(from.data(), to.data()), paper->size(), cv::INTER_LINEAR,
                 cv::BORDER_TRANSPARENT);
}

// The point nearest to the viewer colours the pixel.
void lay_points(const std::vector<PaperPoint>& points, const SessionPictureOptions& options,
                const Projection& projection, const PlotSection& section, cv::Mat3b* paper) {
  Vector3d to_viewer(0, 0, 1);
  if (options.view == SessionPictureView::from_the_side)
    to_viewer = projection.page_from_upright.row(0).transpose().cross(projection.page_from_upright.row(1).transpose());
  cv::Mat1f nearest(paper->size(), std::numeric_limits<float>::lowest());
  const int side = std::max(1, static_cast<int>(std::ceil(kPaperPointM * section.px_per_m)));
  for (const PaperPoint& point : points) {
    const Vector2d p = section.pixel(projection.page_from_upright * point.place);
    if (!(p.cwiseAbs().maxCoeff() < 1e6)) continue;
    const cv::Rect there = cv::Rect(cvRound(p.x() - 0.5 * (side - 1)), cvRound(p.y() - 0.5 * (side - 1)), side, side) &
                           cv::Rect({0, 0}, paper->size());
    const auto depth = static_cast<float>(to_viewer.dot(point.place));
    const double strength = point.textured ? 1.0 : options.point_strength;
    for (int y = there.y; y < there.y + there.height; ++y)
      for (int x = there.x; x < there.x + there.width; ++x) {
        if (nearest(y, x) >= depth) continue;
        nearest(y, x) = depth;
        for (int c = 0; c < 3; ++c)
          (*paper)(y, x)[c] =
              cv::saturate_cast<uchar>(255 - strength * (255 - point.rgb[static_cast<std::size_t>(2 - c)]));
      }
  }
}

}  // namespace

std::vector<PaperPoint> choose_paper_points(const SessionScene& scene, const SessionPictureOptions& options,
                                            const Projection& projection) {
  std::vector<PaperPoint> out;
  std::vector<std::vector<Vector3d>> ways;
  for (const SceneSession& session : scene.sessions) {
    ways.emplace_back();
    for (const ScenePose& pose : session.poses) ways.back().push_back(projection.upright * pose.global_from_camera.t);
  }
  WayHeights way_heights(ways);
  for (const SceneSession& session : scene.sessions) {
    for (const ColouredPoint& point : session.points) {
      const Vector3d place = projection.upright * point.position.cast<double>();
      if (!place.allFinite()) continue;
      if (options.view == SessionPictureView::from_above &&
          place.z() > way_heights.at(place) + options.most_above_way_m)
        continue;
      out.push_back({place, point.rgb, session.textured});
    }
  }
  return out;
}

PlotBox box_of_most(const std::vector<PaperPoint>& points, const Projection& projection) {
  PlotBox out;
  if (points.empty()) return out;
  std::array<std::vector<double>, 2> values;
  for (const PaperPoint& point : points) {
    const Vector2d p = projection.page_from_upright * point.place;
    values[0].push_back(p.x());
    values[1].push_back(p.y());
  }
  for (int axis = 0; axis < 2; ++axis) {
    std::vector<double>& v = values[static_cast<std::size_t>(axis)];
    const auto stray = static_cast<std::ptrdiff_t>(kStrayPoints * static_cast<double>(v.size()));
    std::nth_element(v.begin(), v.begin() + stray, v.end());
    out.low[axis] = v[static_cast<std::size_t>(stray)];
    std::nth_element(v.begin(), v.end() - 1 - stray, v.end());
    out.high[axis] = *(v.end() - 1 - stray);
  }
  return out;
}

cv::Mat3b draw_paper(const std::vector<PaperPoint>& points, const FloorPlan* plan, const SessionPictureOptions& options,
                     const Projection& projection, const PlotSection& section) {
  cv::Mat3b paper(section.height_px, section.width_px, cv::Vec3b(255, 255, 255));
  if (plan) lay_plan(*plan, section, &paper);
  const cv::Scalar ink(kPlotGrid.blue, kPlotGrid.green, kPlotGrid.red);
  for (const double v : section.grid_lines(0)) {
    const int x = cvRound(section.pixel({v, 0}).x());
    cv::line(paper, {x, 0}, {x, paper.rows - 1}, ink);
  }
  for (const double v : section.grid_lines(1)) {
    const int y = cvRound(section.pixel({0, v}).y());
    cv::line(paper, {0, y}, {paper.cols - 1, y}, ink);
  }
  lay_points(points, options, projection, section, &paper);
  return paper;
}

}  // namespace parallax
