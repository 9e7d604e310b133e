#include "app/map_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "app/way_heights.h"
#include "core/error.h"

namespace parallax {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kMapMarginPx = 56, kTitlePx = 40;
constexpr double kLabelPx = 13, kTitleTextPx = 18;
constexpr double kFade = 0.55;    // how much of a floor plan's ink is taken away
constexpr double kStray = 0.002;  // share of the points at each end that does not widen the picture
constexpr double kPointM = 0.03;  // side of a point on paper
constexpr CanvasColour kMapInk{40, 40, 40}, kMapGridInk{205, 205, 205};

struct MapBox {
  Vector2d low = Vector2d::Constant(std::numeric_limits<double>::max()), high = -low;
  void take(const Vector2d& p) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
};

class MapSheet {
 public:
  MapSheet(const MapBox& box, const MapPictureOptions& options) {
    const Vector2d extent = (box.high - box.low).cwiseMax(1.0) * 1.04;
    const double room_x = options.width_px - 2 * kMapMarginPx,
                 room_y = options.most_height_px - 2 * kMapMarginPx - kTitlePx;
    px_per_m_ = std::min(room_x / extent.x(), room_y / extent.y());
    const Vector2d middle = 0.5 * (box.low + box.high);
    const double height = std::max(200.0, std::ceil(px_per_m_ * extent.y()));
    picture_ = cv::Mat3b(static_cast<int>(height), static_cast<int>(room_x), cv::Vec3b(255, 255, 255));
    low_ = middle - 0.5 * Vector2d(picture_.cols, picture_.rows) / px_per_m_;
    step_ = map_grid_step(std::max(picture_.cols, picture_.rows) / px_per_m_);
  }

  cv::Mat3b& picture() { return picture_; }
  double px_per_m() const { return px_per_m_; }
  double grid_step() const { return step_; }
  // Of the picture.
  Vector2d pixel(const Vector2d& place) const {
    return {(place.x() - low_.x()) * px_per_m_ - 0.5, picture_.rows - 0.5 - (place.y() - low_.y()) * px_per_m_};
  }
  // Of the whole sheet.
  CanvasPoint canvas(const Vector2d& place) const {
    const Vector2d p = pixel(place);
    return {p.x() + kMapMarginPx, p.y() + kMapMarginPx + kTitlePx};
  }
  std::vector<double> lines(int axis) const {
    const double length = (axis == 0 ? picture_.cols : picture_.rows) / px_per_m_;
    std::vector<double> out;
    for (double v = std::ceil(low_[axis] / step_) * step_; v <= low_[axis] + length; v += step_) out.push_back(v);
    return out;
  }

 private:
  cv::Mat3b picture_;
  double px_per_m_ = 1, step_ = 1;
  Vector2d low_{0, 0};
};

void lay_floor_plan(const FloorPlan& plan, MapSheet* sheet) {
  cv::Mat3b faded;
  plan.image.convertTo(faded, CV_8U, 1 - kFade, 255 * kFade);
  // From a pixel of the plan to one of the sheet, by three corners.
  const auto place = [&](double u, double v) {
    const Vector2d m = plan.metres_per_px * Vector2d(u + 0.5, plan.image.rows - 0.5 - v);
    const double c = std::cos(plan.turn_rad), s = std::sin(plan.turn_rad);
    const Vector2d p = sheet->pixel(plan.corner_m + Vector2d(c * m.x() - s * m.y(), s * m.x() + c * m.y()));
    return cv::Point2f(static_cast<float>(p.x()), static_cast<float>(p.y()));
  };
  const std::array<cv::Point2f, 3> from{cv::Point2f(0, 0), cv::Point2f(100, 0), cv::Point2f(0, 100)},
      to{place(0, 0), place(100, 0), place(0, 100)};
  const cv::Mat sheet_from_plan = cv::getAffineTransform(from.data(), to.data());
  const bool shrinks = sheet->px_per_m() * plan.metres_per_px < 1;
  if (shrinks) {  // or thin lines would be lost between the pixels
    const double radius = 0.4 / (sheet->px_per_m() * plan.metres_per_px);
    cv::GaussianBlur(faded, faded, {0, 0}, radius);
  }
  cv::warpAffine(faded, sheet->picture(), sheet_from_plan, sheet->picture().size(), cv::INTER_LINEAR,
                 cv::BORDER_TRANSPARENT);
}

void draw_grid(MapSheet* sheet) {
  cv::Mat3b& picture = sheet->picture();
  const cv::Scalar ink(kMapGridInk.blue, kMapGridInk.green, kMapGridInk.red);
  for (const double v : sheet->lines(0)) {
    const int x = cvRound(sheet->pixel({v, 0}).x());
    cv::line(picture, {x, 0}, {x, picture.rows - 1}, ink);
  }
  for (const double v : sheet->lines(1)) {
    const int y = cvRound(sheet->pixel({0, v}).y());
    cv::line(picture, {0, y}, {picture.cols - 1, y}, ink);
  }
}

// The point nearest to the viewer colours the pixel.
void draw_points(const std::vector<Vector3d>& places, const std::vector<ColouredPoint>& points, MapSheet* sheet) {
  cv::Mat3b& picture = sheet->picture();
  cv::Mat1f nearest(picture.size(), std::numeric_limits<float>::lowest());
  const int side = std::max(1, static_cast<int>(std::ceil(kPointM * sheet->px_per_m())));
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (!places[i].allFinite()) continue;
    const Vector2d p = sheet->pixel(places[i].head<2>());
    const cv::Rect there = cv::Rect(cvRound(p.x() - 0.5 * (side - 1)), cvRound(p.y() - 0.5 * (side - 1)), side, side) &
                           cv::Rect({0, 0}, picture.size());
    const auto z = static_cast<float>(places[i].z());
    for (int y = there.y; y < there.y + there.height; ++y) {
      for (int x = there.x; x < there.x + there.width; ++x) {
        if (nearest(y, x) >= z) continue;
        nearest(y, x) = z;
        picture(y, x) = {points[i].rgb[2], points[i].rgb[1], points[i].rgb[0]};
      }
    }
  }
}

std::string grid_metres(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.10g", std::abs(value) < 1e-9 ? 0.0 : value);
  return text;
}

void draw_map_labels(const MapSheet& sheet, const cv::Size& picture, const MapPictureOptions& options,
                     const std::vector<MapPath>& paths, Canvas* canvas) {
  const double left = kMapMarginPx, right = kMapMarginPx + picture.width, top = kMapMarginPx + kTitlePx,
               bottom = top + picture.height;
  canvas->polyline({{left, top}, {right, top}, {right, bottom}, {left, bottom}, {left, top}}, kMapGridInk, 1);
  for (const double v : sheet.lines(0))
    canvas->text({sheet.canvas({v, 0}).x, bottom + 18}, grid_metres(v), kLabelPx, TextAnchor::middle, kMapInk);
  for (const double v : sheet.lines(1))
    canvas->text({left - 6, sheet.canvas({0, v}).y + 4}, grid_metres(v), kLabelPx, TextAnchor::right, kMapInk);
  canvas->text({right, bottom + 38}, "grid " + grid_metres(sheet.grid_step()) + " m", kTitleTextPx, TextAnchor::right,
               kMapInk);
  canvas->text({left, 34}, options.title, kTitleTextPx, TextAnchor::left, kMapInk);
  double x = left;
  for (const MapPath& path : paths) {
    if (path.name.empty()) continue;
    canvas->polyline({{x, top - 18}, {x + 30, top - 18}}, path.colour, 3);
    canvas->text({x + 36, top - 13}, path.name, kLabelPx, TextAnchor::left, kMapInk);
    x += 60 + 8 * static_cast<double>(path.name.size());
  }
}

// Where most of them are along one axis.
std::pair<double, double> common_range(const std::vector<Vector3d>& places, int axis) {
  std::vector<double> values;
  values.reserve(places.size());
  for (const Vector3d& p : places) values.push_back(p[axis]);
  const auto stray = static_cast<std::ptrdiff_t>(kStray * static_cast<double>(values.size()));
  std::nth_element(values.begin(), values.begin() + stray, values.end());
  const double low = values[static_cast<std::size_t>(stray)];
  std::nth_element(values.begin(), values.end() - 1 - stray, values.end());
  return {low, *(values.end() - 1 - stray)};
}

}  // namespace

double map_grid_step(double extent_m) {
  constexpr double most_lines = 14;
  double power = 1;
  while (true) {
    for (const double factor : {1.0, 2.0, 5.0})
      if (extent_m <= most_lines * factor * power || !(extent_m < 1e9)) return factor * power;
    power *= 10;
  }
}

void draw_map_picture(const std::vector<ColouredPoint>& points, const std::vector<MapPath>& paths,
                      const MapPictureOptions& options, const std::string& path) {
  const Eigen::Matrix3d upright = upright_from_world(options.up);
  const bool above = options.view == MapPictureView::from_above;
  std::vector<std::vector<Vector3d>> ways;
  for (const MapPath& way : paths) {
    ways.emplace_back();
    for (const Vector3d& place : way.places) ways.back().push_back(upright * place);
  }
  std::vector<Vector3d> places;
  std::vector<ColouredPoint> shown;
  WayHeights heights(ways);
  for (const ColouredPoint& point : points) {
    const Vector3d place = upright * point.position.cast<double>();
    if (!place.allFinite() || (above && place.z() > heights.at(place) + options.most_above_path_m)) continue;
    places.push_back(place);
    shown.push_back(point);
  }
  const auto for_every_way = [&](const auto& body) {
    for (auto& way : ways)
      for (Vector3d& place : way) body(place);
  };
  if (!above) {  // the longer of x and y goes across, height up, and the viewer is on the near side
    MapBox plan;
    for (const Vector3d& p : places) plan.take(p.head<2>());
    for_every_way([&](const Vector3d& p) { plan.take(p.head<2>()); });
    const Vector2d extent = plan.high - plan.low;
    Eigen::Matrix3d turn;
    if (extent.x() >= extent.y()) {
      turn << 1, 0, 0, 0, 0, 1, 0, -1, 0;
    } else {
      turn << 0, 1, 0, 0, 0, 1, 1, 0, 0;
    }
    for (Vector3d& place : places) place = turn * place;
    for_every_way([&](Vector3d& place) { place = turn * place; });
  }
  MapBox box;
  if (!places.empty()) {
    const auto [x0, x1] = common_range(places, 0);
    const auto [y0, y1] = common_range(places, 1);
    box.take({x0, y0});
    box.take({x1, y1});
  }
  for_every_way([&](const Vector3d& place) { box.take(place.head<2>()); });
  if (!(box.low.x() <= box.high.x())) throw RunError(path + ": cannot be written: the map has no points and no way");

  MapSheet sheet(box, options);
  if (above && options.floor_plan) lay_floor_plan(*options.floor_plan, &sheet);
  draw_grid(&sheet);
  draw_points(places, shown, &sheet);
  const cv::Size size = sheet.picture().size();
  const auto canvas = make_canvas(path, size.width + 2 * kMapMarginPx, size.height + 2 * kMapMarginPx + kTitlePx);
  canvas->image({kMapMarginPx, kMapMarginPx + kTitlePx}, sheet.picture());
  for (std::size_t i = 0; i < ways.size(); ++i) {
    std::vector<CanvasPoint> line;
    for (const Vector3d& place : ways[i]) line.push_back(sheet.canvas(place.head<2>()));
    canvas->polyline(line, paths[i].colour, 2);
    if (line.empty()) continue;
    std::vector<CanvasPoint> ring;  // where it begins
    for (int j = 0; j <= 16; ++j)
      ring.push_back({line[0].x + 6 * std::cos(j * M_PI / 8), line[0].y + 6 * std::sin(j * M_PI / 8)});
    canvas->polyline(ring, paths[i].colour, 2);
  }
  draw_map_labels(sheet, size, options, paths, canvas.get());
  canvas->save(path);
}

}  // namespace parallax
