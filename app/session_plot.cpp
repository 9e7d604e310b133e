#include "app/session_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

namespace parallax {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kFootPx = 30;
constexpr int kMostLinks = 150;    // of a kind, drawn in an elevation picture
constexpr double kLetterPx = 7.4;  // of a small letter, about
constexpr CanvasColour kShadowInk{225, 225, 225};

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

void ring(CanvasPoint middle, double radius, CanvasColour colour, Canvas* canvas) {
  std::vector<CanvasPoint> points;
  for (int i = 0; i <= 16; ++i)
    points.push_back({middle.x + radius * std::cos(i * M_PI / 8), middle.y + radius * std::sin(i * M_PI / 8)});
  canvas->polyline(points, colour, radius > 4 ? 2 : 1.5);
}

}  // namespace

SessionPlot::SessionPlot(SessionScene scene, const SessionPictureOptions& options, bool first)
    : scene_(std::move(scene)), options_(options), first_(first), projection_(make_projection(scene_, options)) {
  if (!is_elevation()) {
    points_ = choose_paper_points(scene_, options_, projection_);
    box_ = box_of_most(points_, projection_);
  }
  for (const SceneSession& session : scene_.sessions)
    for (const ScenePose& pose : session.poses) {
      box_.take(way_page(session, pose));
      plan_.take((projection_.upright * pose.global_from_camera.t).head<2>());
    }
  if (is_elevation()) fit_ground();
}

// The ground, its grid, and the scale of session time at its left corner.
void SessionPlot::fit_ground() {
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

void SessionPlot::fit(double width_px, double most_height_px) {
  const Vector2d extent = (box_.high - box_.low).cwiseMax(1.0) * 1.06;
  section_.px_per_m = std::min(width_px / extent.x(), most_height_px / extent.y());
  section_.width_px =
      static_cast<int>(std::clamp(std::ceil(section_.px_per_m * extent.x()), std::min(420.0, width_px), width_px));
  section_.height_px =
      static_cast<int>(std::max(std::min(160.0, most_height_px), std::ceil(section_.px_per_m * extent.y())));
  const Vector2d middle = 0.5 * (box_.low + box_.high);
  section_.low = middle - 0.5 * Vector2d(section_.width_px, section_.height_px) / section_.px_per_m;
  section_.grid_step_m = is_elevation()
                             ? map_grid_step((plan_.high - plan_.low).maxCoeff())
                             : map_grid_step(std::max(section_.width_px, section_.height_px) / section_.px_per_m);
  fill_legend(width_px);
}

void SessionPlot::fill_legend(double width_px) {
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
    if (x > 0 && x + wide > width_px) {
      ++legend_lines_;
      x = 0;
    }
    entry.at = {x, static_cast<double>((legend_lines_ - 1) * kPlotLinePx)};
    x += wide;
  }
}

int SessionPlot::height_px() const {
  return legend_lines_ * kPlotLinePx + section_.height_px + kFootPx + (shows_ellipses() ? kPlotLinePx : 0);
}

void SessionPlot::draw(CanvasPoint corner, Canvas* canvas) {
  section_.corner = {corner.x, corner.y + legend_lines_ * kPlotLinePx};
  for (const LegendEntry& entry : legend_) {
    const CanvasPoint at{corner.x + entry.at.x, corner.y + entry.at.y};
    canvas->polyline({{at.x, at.y + 4}, {at.x + 28, at.y + 4}}, entry.colour, 3);
    canvas->text({at.x + 34, at.y + 9}, entry.text, kPlotTextPx, TextAnchor::left, kPlotInk);
  }
  if (is_elevation()) {
    draw_ground(canvas);
  } else {
    const bool on_plan = first_ && options_.floor_plan && options_.view == SessionPictureView::from_above;
    canvas->image(section_.corner,
                  draw_paper(points_, on_plan ? &*options_.floor_plan : nullptr, options_, projection_, section_));
  }
  for (const bool within : {true, false}) draw_links(within, canvas);
  for (const SceneSession& session : scene_.sessions) draw_way(session, canvas);
  if (shows_ellipses()) draw_ellipses(canvas);
  draw_frame(canvas);
}

SessionPlotPlace SessionPlot::place() const {
  SessionPlotPlace out;
  out.component = scene_.sessions.front().component;
  out.px_per_m = section_.px_per_m;
  out.corner = section_.corner;
  out.width_px = section_.width_px;
  out.height_px = section_.height_px;
  out.at = [projection = projection_, section = section_](const Vector3d& place, int id, double seconds) {
    return section.on_sheet(projection.page(place, projection.lift(id, seconds)));
  };
  return out;
}

std::size_t SessionPlot::longest_name() const {
  std::size_t out = 0;
  for (const SceneSession& session : scene_.sessions) out = std::max(out, session.name.size());
  return std::min<std::size_t>(out, 24) + 6;
}

int SessionPlot::link_step(int count) const {
  return is_elevation() ? std::max(1, (count + kMostLinks - 1) / kMostLinks) : 1;
}

std::array<Vector2d, 4> SessionPlot::corners() const {
  return {plan_.low, Vector2d(plan_.high.x(), plan_.low.y()), plan_.high, Vector2d(plan_.low.x(), plan_.high.y())};
}

Vector2d SessionPlot::ground(const Vector2d& plan, double lift_m) const {
  return projection_.page_from_upright * Vector3d(plan.x(), plan.y(), 0) + projection_.page_from_lift * lift_m;
}

Vector2d SessionPlot::way_page(const SceneSession& session, const ScenePose& pose) const {
  return projection_.page(pose.global_from_camera.t, projection_.lift(session.id, pose.seconds));
}

void SessionPlot::draw_ground(Canvas* canvas) const {
  for (double x = plan_.low.x(); x <= plan_.high.x() + 1e-6; x += section_.grid_step_m)
    canvas->polyline({on_sheet(ground({x, plan_.low.y()})), on_sheet(ground({x, plan_.high.y()}))}, kPlotGrid, 1);
  for (double y = plan_.low.y(); y <= plan_.high.y() + 1e-6; y += section_.grid_step_m)
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
    for (const CanvasPoint& end : {a, b}) canvas->polyline({{end.x - 5, end.y}, {end.x + 5, end.y}}, session.colour, 2);
    std::string name = session.name;
    if (name.size() > 24) name = name.substr(0, 22) + "..";
    canvas->text({a.x - 9, 0.5 * (a.y + b.y) + 4}, name + "  " + minutes_text(session.seconds()), kPlotTextPx,
                 TextAnchor::right, kPlotInk);
  }
}

void SessionPlot::draw_way(const SceneSession& session, Canvas* canvas) const {
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

void SessionPlot::draw_links(bool within, Canvas* canvas) const {
  const CanvasColour colour = within ? kWithinSessionColour : kBetweenSessionsColour;
  const auto count = static_cast<int>(std::count_if(scene_.links.begin(), scene_.links.end(),
                                                    [&](const SceneLink& l) { return l.within_session() == within; }));
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

void SessionPlot::draw_ellipses(Canvas* canvas) const {
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
  canvas->text({section_.corner.x, section_.corner.y + section_.height_px + kFootPx + 8},
               "95 % ellipses to scale, longest half axis " +
                   (largest < 1 ? short_number(100 * largest, "%.2g") + " cm" : short_number(largest, "%.3g") + " m"),
               kPlotTextPx, TextAnchor::left, kPlotInk);
}

void SessionPlot::draw_frame(Canvas* canvas) const {
  const double left = section_.corner.x, right = section_.corner.x + section_.width_px, top = section_.corner.y,
               bottom = section_.corner.y + section_.height_px;
  const std::string grid = "grid " + short_number(section_.grid_step_m) + " m";
  if (is_elevation()) {
    canvas->text({left, bottom + 20}, grid + ", height: session time (m:ss)", kPlotTextPx, TextAnchor::left, kPlotInk);
    return;
  }
  canvas->polyline({{left, top}, {right, top}, {right, bottom}, {left, bottom}, {left, top}}, kPlotGrid, 1);
  for (const double v : section_.grid_lines(0)) {
    const double x = left + (v - section_.low.x()) * section_.px_per_m;
    if (x < right - 70) canvas->text({x, bottom + 16}, short_number(v), kPlotTextPx - 1, TextAnchor::middle, kPlotInk);
  }
  for (const double v : section_.grid_lines(1))
    canvas->text({left - 5, bottom - (v - section_.low.y()) * section_.px_per_m + 4}, short_number(v), kPlotTextPx - 1,
                 TextAnchor::right, kPlotInk);
  canvas->text({right, bottom + 16}, grid, kPlotTextPx, TextAnchor::right, kPlotInk);
}

}  // namespace parallax
