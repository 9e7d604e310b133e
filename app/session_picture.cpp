#include "app/session_picture.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "core/error.h"

namespace parallax {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kPlotMarginPx = 52, kPlotsAcross = 3, kMostPlots = 12, kHeadPx = 44, kLegendLinePx = 20, kFootPx = 30;
constexpr int kMostLinks = 150;                                     // of a kind, drawn in an elevation picture
constexpr double kSmallPx = 13, kHeadTextPx = 18, kLetterPx = 7.4;  // of a small letter, about
constexpr double kPlanFade = 0.55;                                  // of a floor plan's ink that is taken away
constexpr double kStrayPoints = 0.002;            // share of the points at each end that does not widen the plot
constexpr double kPaperPointM = 0.03;             // side of a point on paper
constexpr double kWayCellM = 1;                   // over which a way's height is taken to be one
constexpr double kYawRad = -0.5, kTiltRad = 0.6;  // of the oblique view: turned, and seen from above the horizon
constexpr double kLiftShare = 0.75;               // of the plan's extent, that all of session time is lifted by
constexpr double kPauseShare = 0.06;              // of session time, between one session and the next above it
constexpr CanvasColour kPlotInk{40, 40, 40}, kPlotGrid{208, 208, 208}, kShadowInk{225, 225, 225};

std::string short_number(double value, const char* format = "%.10g") {
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), format, std::abs(value) < 1e-9 ? 0.0 : value);
  return text.data();
}

std::string minutes_text(double seconds) {
  std::array<char, 48> text{};
  const int whole = static_cast<int>(std::lround(seconds));
  std::snprintf(text.data(), text.size(), "%d:%02d", whole / 60, whole % 60);
  return text.data();
}

struct PlotBox {
  Vector2d low = Vector2d::Constant(std::numeric_limits<double>::max()), high = -low;
  void take(const Vector2d& p) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  bool empty() const { return !(low.x() <= high.x()); }
};

// From the global frame to the page: metres, x right, y up; linear in place and lift.
struct Projection {
  Eigen::Matrix<double, 2, 3> page_from_upright;
  Vector2d page_from_lift{0, 0};
  Matrix3d upright;
  double lift_per_second = 0;
  std::map<int, double> base_seconds;  // at which a session begins

  Vector2d page(const Vector3d& place, double lift_m = 0) const {
    return page_from_upright * (upright * place) + page_from_lift * lift_m;
  }
  double lift(int session, double seconds) const {
    const auto base = base_seconds.find(session);
    return base == base_seconds.end() ? 0 : lift_per_second * (base->second + seconds);
  }
};

Projection make_projection(const SessionScene& scene, const SessionPictureOptions& options) {
  Projection out;
  out.upright = upright_from_world(options.up);
  PlotBox plan;
  for (const SceneSession& session : scene.sessions)
    for (const ScenePose& pose : session.poses) plan.take((out.upright * pose.global_from_camera.t).head<2>());
  const Vector2d extent = (plan.high - plan.low).cwiseMax(1.0);
  const bool turned = extent.y() > extent.x();  // the longer side goes across
  out.page_from_upright << 1, 0, 0, 0, 1, 0;
  if (options.view == SessionPictureView::from_above) return out;
  if (options.view == SessionPictureView::from_the_side) {
    if (turned)
      out.page_from_upright << 0, 1, 0, 0, 0, 1;
    else
      out.page_from_upright << 1, 0, 0, 0, 0, 1;
    return out;
  }
  const double yaw = kYawRad + (turned ? -0.5 * M_PI : 0.0), c = std::cos(yaw), s = std::sin(yaw),
               flat = std::sin(kTiltRad);
  out.page_from_upright << c, -s, 0, flat * s, flat * c, 0;
  out.page_from_lift = {0, std::cos(kTiltRad)};
  double total = 0;
  for (const SceneSession& session : scene.sessions) total += std::max(session.seconds(), 1e-3);
  double base = 0;
  for (const SceneSession& session : scene.sessions) {
    out.base_seconds[session.id] = base;
    base += session.seconds() + kPauseShare * total;
  }
  out.lift_per_second = kLiftShare * extent.maxCoeff() / total;
  return out;
}

// One component.
class SessionPlot {
 public:
  SessionPlot(SessionScene scene, const SessionPictureOptions& options, bool first)
      : scene_(std::move(scene)), options_(options), first_(first), projection_(make_projection(scene_, options)) {
    choose_points();
    for (const SceneSession& session : scene_.sessions)
      for (const ScenePose& pose : session.poses) {
        box_.take(way_page(session, pose));
        plan_.take((projection_.upright * pose.global_from_camera.t).head<2>());
      }
    if (is_elevation()) {  // the ground, its grid, and the scale of session time at its left corner
      const double step = map_grid_step((plan_.high - plan_.low).maxCoeff());
      plan_.low = (plan_.low / step).array().floor() * step;
      plan_.high = ((plan_.high / step).array().floor() + 1) * step;
      time_corner_ = plan_.low;
      for (const Vector2d& corner : corners()) {
        box_.take(ground(corner));
        if (ground(corner).x() < ground(time_corner_).x()) time_corner_ = corner;
      }
      const SceneSession& last = scene_.sessions.back();
      box_.take(ground(time_corner_, projection_.lift(last.id, last.seconds())));
      const double widest = 10.5 * static_cast<double>(longest_name()) / 400 * (box_.high.x() - box_.low.x());
      box_.low.x() -= std::min(widest, 0.35 * (box_.high.x() - box_.low.x()));
    }
  }

  // The plot is at most so large; its scale follows.
  void fit(double width_px, double most_height_px) {
    const Vector2d extent = (box_.high - box_.low).cwiseMax(1.0) * 1.06;
    px_per_m_ = std::min(width_px / extent.x(), most_height_px / extent.y());
    width_px_ = static_cast<int>(std::clamp(std::ceil(px_per_m_ * extent.x()), std::min(420.0, width_px), width_px));
    legend_px_ = width_px;
    height_px_ = static_cast<int>(std::max(std::min(160.0, most_height_px), std::ceil(px_per_m_ * extent.y())));
    const Vector2d middle = 0.5 * (box_.low + box_.high);
    low_ = middle - 0.5 * Vector2d(width_px_, height_px_) / px_per_m_;
    step_ = is_elevation() ? map_grid_step((plan_.high - plan_.low).maxCoeff())
                           : map_grid_step(std::max(width_px_, height_px_) / px_per_m_);
    legend_.clear();
    for (const SceneSession& session : scene_.sessions) legend_.push_back({session.name, session.colour});
    int within = 0, between = 0;
    for (const SceneLink& link : scene_.links) ++(link.within_session() ? within : between);
    const auto links_entry = [&](const std::string& name, int count, CanvasColour colour) {
      const int step = link_step(count);
      if (count > 0)
        legend_.push_back({name + ": " + std::to_string(count) +
                               (step > 1 ? " (one in " + std::to_string(step) + " drawn)" : std::string()),
                           colour});
    };
    links_entry("within a session", within, kWithinSessionColour);
    links_entry("between sessions", between, kBetweenSessionsColour);
    legend_lines_ = 1;
    double x = 0;
    for (LegendEntry& entry : legend_) {
      const double wide = 54 + kLetterPx * static_cast<double>(entry.text.size());
      if (x > 0 && x + wide > legend_px_) {
        ++legend_lines_;
        x = 0;
      }
      entry.at = {x, static_cast<double>((legend_lines_ - 1) * kLegendLinePx)};
      x += wide;
    }
  }

  int width_px() const { return width_px_; }
  int height_px() const { return legend_lines_ * kLegendLinePx + height_px_ + kFootPx + (notes() ? kLegendLinePx : 0); }

  void draw(CanvasPoint corner, Canvas* canvas) {
    corner_ = {corner.x, corner.y + legend_lines_ * kLegendLinePx};
    for (const LegendEntry& entry : legend_) {
      const CanvasPoint at{corner.x + entry.at.x, corner.y + entry.at.y};
      canvas->polyline({{at.x, at.y + 4}, {at.x + 28, at.y + 4}}, entry.colour, 3);
      canvas->text({at.x + 34, at.y + 9}, entry.text, kSmallPx, TextAnchor::left, kPlotInk);
    }
    if (is_elevation())
      draw_ground(canvas);
    else
      draw_paper(canvas);
    for (const bool within : {true, false}) draw_links(within, canvas);
    for (const SceneSession& session : scene_.sessions) draw_way(session, canvas);
    if (shows_ellipses()) draw_ellipses(canvas);
    draw_frame(canvas);
  }

  SessionPlotPlace place() const {
    SessionPlotPlace out;
    out.component = scene_.sessions.front().component;
    out.px_per_m = px_per_m_;
    out.corner = corner_;
    out.width_px = width_px_;
    out.height_px = height_px_;
    out.at = [projection = projection_, low = low_, scale = px_per_m_, height = height_px_, corner = corner_](
                 const Vector3d& place, int id, double seconds) {
      const Vector2d p = projection.page(place, projection.lift(id, seconds));
      return CanvasPoint{corner.x + (p.x() - low.x()) * scale, corner.y + height - (p.y() - low.y()) * scale};
    };
    return out;
  }

 private:
  struct LegendEntry {
    std::string text;
    CanvasColour colour;
    CanvasPoint at{};
  };

  bool is_elevation() const { return options_.view == SessionPictureView::elevation; }
  bool shows_ellipses() const { return options_.ellipses && !is_elevation() && !scene_.spreads.empty(); }
  bool notes() const { return shows_ellipses(); }
  std::size_t longest_name() const {
    std::size_t out = 0;
    for (const SceneSession& session : scene_.sessions) out = std::max(out, session.name.size());
    return std::min<std::size_t>(out, 24) + 6;
  }
  std::array<Vector2d, 4> corners() const {
    return {plan_.low, Vector2d(plan_.high.x(), plan_.low.y()), plan_.high, Vector2d(plan_.low.x(), plan_.high.y())};
  }
  // Of a place on the plan, at session time zero.
  Vector2d ground(const Vector2d& plan, double lift_m = 0) const {
    return projection_.page_from_upright * Vector3d(plan.x(), plan.y(), 0) + projection_.page_from_lift * lift_m;
  }
  Vector2d way_page(const SceneSession& session, const ScenePose& pose) const {
    return projection_.page(pose.global_from_camera.t, projection_.lift(session.id, pose.seconds));
  }
  CanvasPoint on_sheet(const Vector2d& page) const {
    return {corner_.x + (page.x() - low_.x()) * px_per_m_, corner_.y + height_px_ - (page.y() - low_.y()) * px_per_m_};
  }

  // Those that are not hidden ceilings, upright, and where most of them are.
  void choose_points() {
    if (is_elevation()) return;
    std::map<std::pair<long, long>, double> heights;
    for (const SceneSession& session : scene_.sessions) {
      for (const ColouredPoint& point : session.points) {
        const Vector3d place = projection_.upright * point.position.cast<double>();
        if (!place.allFinite()) continue;
        if (options_.view == SessionPictureView::from_above &&
            place.z() > way_height(place, &heights) + options_.most_above_way_m)
          continue;
        points_.push_back({place, point.rgb, session.textured});
      }
    }
    if (points_.empty()) return;
    std::array<std::vector<double>, 2> values;
    for (const PaperPoint& point : points_) {
      const Vector2d p = projection_.page_from_upright * point.place;
      values[0].push_back(p.x());
      values[1].push_back(p.y());
    }
    Vector2d low, high;
    for (int axis = 0; axis < 2; ++axis) {
      std::vector<double>& v = values[static_cast<std::size_t>(axis)];
      const auto stray = static_cast<std::ptrdiff_t>(kStrayPoints * static_cast<double>(v.size()));
      std::nth_element(v.begin(), v.begin() + stray, v.end());
      low[axis] = v[static_cast<std::size_t>(stray)];
      std::nth_element(v.begin(), v.end() - 1 - stray, v.end());
      high[axis] = *(v.end() - 1 - stray);
    }
    box_.take(low);
    box_.take(high);
  }

  double way_height(const Vector3d& place, std::map<std::pair<long, long>, double>* heights) const {
    const std::pair<long, long> cell(std::lround(place.x() / kWayCellM), std::lround(place.y() / kWayCellM));
    const auto [found, fresh] = heights->try_emplace(cell, std::numeric_limits<double>::infinity());
    if (!fresh) return found->second;
    const Vector2d middle(static_cast<double>(cell.first) * kWayCellM, static_cast<double>(cell.second) * kWayCellM);
    double nearest = std::numeric_limits<double>::max();
    for (const SceneSession& session : scene_.sessions)
      for (const ScenePose& pose : session.poses) {
        const Vector3d p = projection_.upright * pose.global_from_camera.t;
        const double distance = (p.head<2>() - middle).squaredNorm();
        if (distance >= nearest) continue;
        nearest = distance;
        found->second = p.z();
      }
    return found->second;
  }

  std::vector<double> grid_lines(int axis) const {
    const double length = (axis == 0 ? width_px_ : height_px_) / px_per_m_;
    std::vector<double> out;
    for (double v = std::ceil(low_[axis] / step_) * step_; v <= low_[axis] + length; v += step_) out.push_back(v);
    return out;
  }

  // Floor plan, grid and points, as pixels.
  void draw_paper(Canvas* canvas) const {
    cv::Mat3b paper(height_px_, width_px_, cv::Vec3b(255, 255, 255));
    const auto pixel = [&](const Vector2d& page) {
      return Vector2d((page.x() - low_.x()) * px_per_m_ - 0.5, height_px_ - 0.5 - (page.y() - low_.y()) * px_per_m_);
    };
    if (first_ && options_.floor_plan && options_.view == SessionPictureView::from_above)
      lay_plan(*options_.floor_plan, pixel, &paper);
    const cv::Scalar ink(kPlotGrid.blue, kPlotGrid.green, kPlotGrid.red);
    for (const double v : grid_lines(0)) {
      const int x = cvRound(pixel({v, 0}).x());
      cv::line(paper, {x, 0}, {x, paper.rows - 1}, ink);
    }
    for (const double v : grid_lines(1)) {
      const int y = cvRound(pixel({0, v}).y());
      cv::line(paper, {0, y}, {paper.cols - 1, y}, ink);
    }
    draw_points(pixel, &paper);
    canvas->image(corner_, paper);
  }

  template <class Pixel>
  void lay_plan(const FloorPlan& plan, const Pixel& pixel, cv::Mat3b* paper) const {
    cv::Mat3b faded;
    plan.image.convertTo(faded, CV_8U, 1 - kPlanFade, 255 * kPlanFade);
    const Eigen::Rotation2Dd turn(plan.turn_rad);
    const auto corner = [&](double u, double v) {
      const Vector2d p = pixel(plan.corner_m + turn * (plan.metres_per_px * Vector2d(u + 0.5, faded.rows - 0.5 - v)));
      return cv::Point2f(static_cast<float>(p.x()), static_cast<float>(p.y()));
    };
    const std::array<cv::Point2f, 3> from{cv::Point2f(0, 0), cv::Point2f(100, 0), cv::Point2f(0, 100)},
        to{corner(0, 0), corner(100, 0), corner(0, 100)};
    const double shrink = px_per_m_ * plan.metres_per_px;
    if (shrink < 1) cv::GaussianBlur(faded, faded, {0, 0}, 0.4 / shrink);  // thin lines stay between the pixels
    cv::warpAffine(faded, *paper, cv::getAffineTransform(from.data(), to.data()), paper->size(), cv::INTER_LINEAR,
                   cv::BORDER_TRANSPARENT);
  }

  // The point nearest to the viewer colours the pixel.
  template <class Pixel>
  void draw_points(const Pixel& pixel, cv::Mat3b* paper) const {
    Vector3d to_viewer(0, 0, 1);
    if (options_.view == SessionPictureView::from_the_side)
      to_viewer =
          projection_.page_from_upright.row(0).transpose().cross(projection_.page_from_upright.row(1).transpose());
    cv::Mat1f nearest(paper->size(), std::numeric_limits<float>::lowest());
    const int side = std::max(1, static_cast<int>(std::ceil(kPaperPointM * px_per_m_)));
    for (const PaperPoint& point : points_) {
      const Vector2d p = pixel(projection_.page_from_upright * point.place);
      if (!(p.cwiseAbs().maxCoeff() < 1e6)) continue;
      const cv::Rect there =
          cv::Rect(cvRound(p.x() - 0.5 * (side - 1)), cvRound(p.y() - 0.5 * (side - 1)), side, side) &
          cv::Rect({0, 0}, paper->size());
      const auto depth = static_cast<float>(to_viewer.dot(point.place));
      const double strength = point.textured ? 1.0 : options_.point_strength;
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

  void draw_ground(Canvas* canvas) const {
    for (double x = plan_.low.x(); x <= plan_.high.x() + 1e-6; x += step_)
      canvas->polyline({on_sheet(ground({x, plan_.low.y()})), on_sheet(ground({x, plan_.high.y()}))}, kPlotGrid, 1);
    for (double y = plan_.low.y(); y <= plan_.high.y() + 1e-6; y += step_)
      canvas->polyline({on_sheet(ground({plan_.low.x(), y})), on_sheet(ground({plan_.high.x(), y}))}, kPlotGrid, 1);
    for (const SceneSession& session : scene_.sessions) {  // the way's shadow
      std::vector<CanvasPoint> line;
      for (const ScenePose& pose : session.poses)
        line.push_back(on_sheet(ground((projection_.upright * pose.global_from_camera.t).head<2>())));
      canvas->polyline(line, kShadowInk, 2);
    }
    // Session time, at the corner of the ground that is farthest left.
    for (const SceneSession& session : scene_.sessions) {
      const double from = projection_.lift(session.id, 0), to = projection_.lift(session.id, session.seconds());
      const CanvasPoint a = on_sheet(ground(time_corner_, from)), b = on_sheet(ground(time_corner_, to));
      canvas->polyline({a, b}, session.colour, 3);
      for (const CanvasPoint& end : {a, b})
        canvas->polyline({{end.x - 5, end.y}, {end.x + 5, end.y}}, session.colour, 2);
      std::string name = session.name;
      if (name.size() > 24) name = name.substr(0, 22) + "..";
      canvas->text({a.x - 9, 0.5 * (a.y + b.y) + 4}, name + "  " + minutes_text(session.seconds()), kSmallPx,
                   TextAnchor::right, kPlotInk);
    }
  }

  void draw_way(const SceneSession& session, Canvas* canvas) const {
    std::vector<CanvasPoint> line;
    const auto flush = [&] {
      canvas->polyline(line, session.colour, 2);
      line.clear();
    };
    for (const ScenePose& pose : session.poses) {
      const CanvasPoint here = on_sheet(way_page(session, pose));
      if (pose.after_failure && !line.empty()) {  // nobody has seen the way to here
        const CanvasPoint before = line.back();
        flush();
        canvas->polyline({before, here}, kPlotGrid, 1);
      }
      line.push_back(here);
    }
    flush();
    ring(on_sheet(way_page(session, session.poses.front())), 6, session.colour, canvas);
    const CanvasPoint end = on_sheet(way_page(session, session.poses.back()));
    canvas->polyline({{end.x - 5, end.y - 5}, {end.x + 5, end.y + 5}}, session.colour, 2);
    canvas->polyline({{end.x - 5, end.y + 5}, {end.x + 5, end.y - 5}}, session.colour, 2);
  }

  // Obliquely too many links would be a curtain before the ways; from above they lie on them.
  int link_step(int count) const { return is_elevation() ? std::max(1, (count + kMostLinks - 1) / kMostLinks) : 1; }

  static void ring(CanvasPoint middle, double radius, CanvasColour colour, Canvas* canvas) {
    std::vector<CanvasPoint> points;
    for (int i = 0; i <= 16; ++i)
      points.push_back({middle.x + radius * std::cos(i * M_PI / 8), middle.y + radius * std::sin(i * M_PI / 8)});
    canvas->polyline(points, colour, radius > 4 ? 2 : 1.5);
  }

  void draw_links(bool within, Canvas* canvas) const {
    const CanvasColour colour = within ? kWithinSessionColour : kBetweenSessionsColour;
    const auto count = static_cast<int>(std::count_if(
        scene_.links.begin(), scene_.links.end(), [&](const SceneLink& l) { return l.within_session() == within; }));
    int number = 0;
    for (const SceneLink& link : scene_.links) {
      if (link.within_session() != within || number++ % link_step(count) != 0) continue;
      const CanvasPoint a = on_sheet(way_page(*scene_.session(link.found.session), *scene_.pose(link.found))),
                        b = on_sheet(way_page(*scene_.session(link.query.session), *scene_.pose(link.query)));
      canvas->polyline({a, b}, colour, 1.2);
      if (is_elevation()) continue;
      ring(a, 3, colour, canvas);
      ring(b, 3, colour, canvas);
    }
  }

  void draw_ellipses(Canvas* canvas) const {
    double largest = 0;
    for (const SceneSpread& spread : scene_.spreads) {
      const SceneSession& session = *scene_.session(spread.key.session);
      const Eigen::Matrix<double, 2, 3> page_from_global = projection_.page_from_upright * projection_.upright;
      const Eigen::Matrix2d axes = ellipse_95(page_from_global * spread.covariance * page_from_global.transpose());
      const Vector2d middle = way_page(session, *scene_.pose(spread.key));
      std::vector<CanvasPoint> line;
      for (int i = 0; i <= 36; ++i)
        line.push_back(on_sheet(middle + axes * Vector2d(std::cos(i * M_PI / 18), std::sin(i * M_PI / 18))));
      canvas->polyline(line, session.colour, 1);
      largest = std::max(largest, axes.colwise().norm().maxCoeff());
    }
    canvas->text({corner_.x, corner_.y + height_px_ + kFootPx + 8},
                 "95 % ellipses to scale, longest half axis " +
                     (largest < 1 ? short_number(100 * largest, "%.2g") + " cm" : short_number(largest, "%.3g") + " m"),
                 kSmallPx, TextAnchor::left, kPlotInk);
  }

  void draw_frame(Canvas* canvas) const {
    const double left = corner_.x, right = corner_.x + width_px_, top = corner_.y, bottom = corner_.y + height_px_;
    const std::string grid = "grid " + short_number(step_) + " m";
    if (is_elevation()) {
      canvas->text({left, bottom + 20}, grid + ", height: session time (m:ss)", kSmallPx, TextAnchor::left, kPlotInk);
      return;
    }
    canvas->polyline({{left, top}, {right, top}, {right, bottom}, {left, bottom}, {left, top}}, kPlotGrid, 1);
    for (const double v : grid_lines(0)) {
      const double x = left + (v - low_.x()) * px_per_m_;
      if (x < right - 70) canvas->text({x, bottom + 16}, short_number(v), kSmallPx - 1, TextAnchor::middle, kPlotInk);
    }
    for (const double v : grid_lines(1))
      canvas->text({left - 5, bottom - (v - low_.y()) * px_per_m_ + 4}, short_number(v), kSmallPx - 1,
                   TextAnchor::right, kPlotInk);
    canvas->text({right, bottom + 16}, grid, kSmallPx, TextAnchor::right, kPlotInk);
  }

  struct PaperPoint {
    Vector3d place;  // upright
    std::array<std::uint8_t, 3> rgb;
    bool textured;
  };

  SessionScene scene_;
  const SessionPictureOptions& options_;
  bool first_;
  Projection projection_;
  PlotBox box_, plan_;
  Vector2d time_corner_{0, 0};  // of the ground, farthest left: where session time is told
  std::vector<PaperPoint> points_;
  std::vector<LegendEntry> legend_;
  int legend_lines_ = 1, width_px_ = 0, height_px_ = 0;
  double px_per_m_ = 1, step_ = 1, legend_px_ = 0;
  Vector2d low_{0, 0};
  CanvasPoint corner_;
};

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
  const int head = (options.title.empty() ? 16 : kHeadPx) + (parts > 1 ? kLegendLinePx : 0);
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
    canvas->text({kPlotMarginPx, static_cast<double>(head - 8)}, text, kSmallPx, TextAnchor::left, kPlotInk);
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
