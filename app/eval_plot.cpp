#include "app/eval_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <vector>

#include "app/eval_canvas.h"

namespace parallax {
namespace {

constexpr int kWidthPx = 960, kTrajectoryHeightPx = 640, kErrorHeightPx = 240;
constexpr int kTitleHeightPx = 36;
constexpr double kTextPx = 14, kTickPx = 12;
constexpr CanvasColour kBlack{30, 30, 30}, kGrid{225, 225, 225}, kTruth{120, 120, 120}, kEstimate{31, 98, 180},
    kRotation{190, 80, 30};

using Curve = std::vector<CanvasPoint>;

struct Range {
  double low = 0, high = 1;
  double extent() const { return high - low; }
};

// The step among 1, 2, 5 times a power of ten that gives about `count` ticks.
double tick_step(double extent, int count) {
  const double raw = extent / count, power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (raw <= factor * power) return factor * power;
  }
  return 10 * power;
}

std::string tick_text(double value, double step) {
  const int decimals = std::clamp(static_cast<int>(std::ceil(-std::log10(step) - 1e-9)), 0, 9);
  std::array<char, 64> text;
  std::snprintf(text.data(), text.size(), "%.*f", decimals, std::abs(value) < 1e-9 * step ? 0.0 : value);
  return text.data();
}

// A frame with axes: maps values to pixels.
class Panel {
 public:
  Panel(Canvas* canvas, CanvasPoint top_left, double width, double height, Range x, Range y)
      : canvas_(canvas), left_(top_left.x), top_(top_left.y), width_(width), height_(height), x_(x), y_(y) {}

  CanvasPoint at(CanvasPoint value) const {
    return {left_ + (value.x - x_.low) / x_.extent() * width_, top_ + (y_.high - value.y) / y_.extent() * height_};
  }

  void draw_axes(const std::string& x_label, const std::string& y_label) const {
    const double x_step = tick_step(x_.extent(), 8);
    for (double v = std::ceil(x_.low / x_step) * x_step; v <= x_.high + 1e-9 * x_step; v += x_step) {
      canvas_->polyline({at({v, y_.low}), at({v, y_.high})}, kGrid, 1);
      canvas_->text({at({v, 0}).x, top_ + height_ + 16}, tick_text(v, x_step), kTickPx, TextAnchor::middle, kBlack);
    }
    const double y_step = tick_step(y_.extent(), std::max(3, static_cast<int>(height_ / 70)));
    for (double v = std::ceil(y_.low / y_step) * y_step; v <= y_.high + 1e-9 * y_step; v += y_step) {
      canvas_->polyline({at({x_.low, v}), at({x_.high, v})}, kGrid, 1);
      canvas_->text({left_ - 8, at({0, v}).y + 4}, tick_text(v, y_step), kTickPx, TextAnchor::right, kBlack);
    }
    canvas_->polyline({{left_, top_}, {left_, top_ + height_}, {left_ + width_, top_ + height_}}, kBlack, 1);
    canvas_->text({left_ + width_, top_ + height_ + 34}, x_label, kTextPx, TextAnchor::right, kBlack);
    canvas_->text({left_ - 56, top_ - 10}, y_label, kTextPx, TextAnchor::left, kBlack);
  }

  // Points that fall within half a pixel of the one before are left out.
  void draw_curve(const Curve& curve, CanvasColour colour, double width_px) const {
    std::vector<CanvasPoint> pixels;
    for (size_t i = 0; i < curve.size(); ++i) {
      const CanvasPoint p = at(curve[i]);
      const bool is_last = i + 1 == curve.size();
      if (!pixels.empty() && !is_last && std::hypot(p.x - pixels.back().x, p.y - pixels.back().y) < 0.5) continue;
      pixels.push_back(p);
    }
    canvas_->polyline(pixels, colour, width_px);
  }

 private:
  Canvas* canvas_;
  double left_, top_, width_, height_;
  Range x_, y_;
};

// Where the camera was lost for long there is no line. Times in seconds, sorted; gives the first index of every piece.
std::vector<size_t> pieces(const std::vector<double>& times) {
  constexpr double kGap = 10;  // in median intervals
  std::vector<double> intervals;
  for (size_t i = 1; i < times.size(); ++i) intervals.push_back(times[i] - times[i - 1]);
  const double longest = kGap * summarise_errors(intervals).median;
  std::vector<size_t> starts{0};
  for (size_t i = 1; i < times.size(); ++i) {
    if (times[i] - times[i - 1] > longest) starts.push_back(i);
  }
  starts.push_back(times.size());
  return starts;
}

void draw_in_pieces(const Panel& panel, const Curve& curve, const std::vector<double>& times, CanvasColour colour,
                    double width_px) {
  const auto starts = pieces(times);
  for (size_t i = 1; i < starts.size(); ++i) {
    panel.draw_curve(Curve(curve.begin() + static_cast<std::ptrdiff_t>(starts[i - 1]),
                           curve.begin() + static_cast<std::ptrdiff_t>(starts[i])),
                     colour, width_px);
  }
}

// The two axes of largest extent, in order x, y, z.
std::array<int, 2> best_axes(const Trajectory& a, const Trajectory& b) {
  Eigen::Array3d low = Eigen::Array3d::Constant(1e300), high = -low;
  for (const Trajectory* trajectory : {&a, &b}) {
    for (const auto& pose : *trajectory) {
      low = low.min(pose.world_from_camera.t.array());
      high = high.max(pose.world_from_camera.t.array());
    }
  }
  int least = 0;
  (high - low).minCoeff(&least);
  return {least == 0 ? 1 : 0, least == 2 ? 1 : 2};
}

Range range_of(const std::vector<const Curve*>& curves, double CanvasPoint::*member) {
  Range range{1e300, -1e300};
  for (const Curve* curve : curves) {
    for (const auto& point : *curve) {
      range.low = std::min(range.low, point.*member);
      range.high = std::max(range.high, point.*member);
    }
  }
  return range;
}

// Equal scale on both axes: one of the ranges grows.
void make_scale_equal(Range* x, Range* y, double width, double height) {
  const double per_pixel = std::max({1.08 * x->extent() / width, 1.08 * y->extent() / height, 1e-9});
  const auto grow = [&](Range* range, double pixels) {
    const double middle = 0.5 * (range->low + range->high), half = 0.5 * per_pixel * pixels;
    *range = {middle - half, middle + half};
  };
  grow(x, width);
  grow(y, height);
}

void draw_trajectories(Canvas* canvas, const Trajectory& truth, const Trajectory& estimate) {
  const auto axes = best_axes(truth, estimate);
  const auto curve_of = [&](const Trajectory& trajectory) {
    Curve curve;
    for (const auto& pose : trajectory) {
      curve.push_back({pose.world_from_camera.t(axes[0]), pose.world_from_camera.t(axes[1])});
    }
    return curve;
  };
  const auto times_of = [](const Trajectory& trajectory) {
    std::vector<double> times;
    for (const auto& pose : trajectory) times.push_back(to_seconds(pose.time));
    return times;
  };
  const Curve true_curve = curve_of(truth), curve = curve_of(estimate);
  const double left = 80, top = kTitleHeightPx + 36, width = kWidthPx - 110, height = kTrajectoryHeightPx - 90;
  Range x = range_of({&true_curve, &curve}, &CanvasPoint::x), y = range_of({&true_curve, &curve}, &CanvasPoint::y);
  make_scale_equal(&x, &y, width, height);
  const Panel panel(canvas, {left, top}, width, height, x, y);
  const std::array<const char*, 3> names{"x (m)", "y (m)", "z (m)"};
  panel.draw_axes(names[static_cast<size_t>(axes[0])], names[static_cast<size_t>(axes[1])]);
  draw_in_pieces(panel, true_curve, times_of(truth), kTruth, 2);
  draw_in_pieces(panel, curve, times_of(estimate), kEstimate, 1);
  const double legend_y = top - 14;
  canvas->polyline({{left + 120, legend_y}, {left + 160, legend_y}}, kTruth, 2);
  canvas->text({left + 168, legend_y + 5}, "truth", kTextPx, TextAnchor::left, kBlack);
  canvas->polyline({{left + 230, legend_y}, {left + 270, legend_y}}, kEstimate, 1);
  canvas->text({left + 278, legend_y + 5}, "estimate, aligned", kTextPx, TextAnchor::left, kBlack);
}

void draw_error(Canvas* canvas, double top, const std::vector<double>& times, const std::vector<double>& errors,
                const std::string& x_label, const std::string& y_label, CanvasColour colour) {
  Curve curve;
  for (size_t i = 0; i < errors.size(); ++i) curve.push_back({times[i], errors[i]});
  Range x = range_of({&curve}, &CanvasPoint::x), y{0, 1.08 * range_of({&curve}, &CanvasPoint::y).high};
  if (x.extent() < 1e-9) x.high = x.low + 1;
  if (y.extent() < 1e-9) y.high = 1e-9;
  const Panel panel(canvas, {80, top + 30}, kWidthPx - 110, kErrorHeightPx - 76, x, y);
  panel.draw_axes(x_label, y_label);
  draw_in_pieces(panel, curve, times, colour, 1);
}

}  // namespace

void plot_trajectory_error(const TrajectoryError& error, const Trajectory& truth, const EvalPlotOptions& options,
                           const std::string& path) {
  const auto canvas = make_canvas(path, kWidthPx, kTitleHeightPx + kTrajectoryHeightPx + 2 * kErrorHeightPx);
  canvas->text({kWidthPx / 2.0, 26}, options.title, 16, TextAnchor::middle, kBlack);
  draw_trajectories(canvas.get(), truth, error.aligned);

  std::vector<double> times;
  const double start = options.time_is_frame ? 0.0 : to_seconds(truth.front().time);
  for (const auto& match : error.matches) times.push_back(to_seconds(truth[match.truth].time) - start);
  const std::string x_label = options.time_is_frame ? "frame" : "time since the first true pose (s)";
  const double below = kTitleHeightPx + kTrajectoryHeightPx;
  draw_error(canvas.get(), below, times, error.position, x_label, "position error (m)", kEstimate);
  draw_error(canvas.get(), below + kErrorHeightPx, times, error.rotation_deg, x_label, "rotation error (degrees)",
             kRotation);
  canvas->save(path);
}

}  // namespace parallax
