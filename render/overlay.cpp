#include "render/overlay.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/check.h"

namespace parallax {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

constexpr int kShift = 4;  // OpenCV draws with 1/16 px
constexpr double kNearMetres = 1e-3;
constexpr double kStepPx = 8;
constexpr int kMaxDepth = 8;

cv::Point fixed(const Vector2d& px) {
  // Far outside the image the exact place is of no interest, but the integers must not overflow.
  const auto limit = [](double v) { return std::clamp(v, -20000.0, 20000.0) * (1 << kShift); };
  return {static_cast<int>(std::lround(limit(px.x()))), static_cast<int>(std::lround(limit(px.y())))};
}

struct Segment {
  const CameraModel& camera;
  std::vector<std::vector<Vector2d>> pieces;
  bool open = false;  // the last piece goes on

  void add(const Vector2d& px) {
    if (!open) pieces.emplace_back();
    open = true;
    pieces.back().push_back(px);
  }
  // Both ends known (or not): halve until the ends are close, or no more can be gained. Adds everything after `a`.
  void subdivide(const Vector3d& a, const Vector3d& b, const std::optional<Vector2d>& pa,
                 const std::optional<Vector2d>& pb, int depth) {
    const bool close = pa && pb && (*pa - *pb).norm() <= kStepPx;
    // The first three halvings are always made when an end is missing, so that a visible middle is found.
    const bool enough = depth >= kMaxDepth || close || (!pa && !pb && depth >= 4);
    if (enough) {
      if (pa && pb)
        add(*pb);
      else
        open = false;
      if (!pa && pb) add(*pb);
      return;
    }
    const Vector3d m = (a + b) / 2;
    const auto pm = project(m);
    subdivide(a, m, pa, pm, depth + 1);
    subdivide(m, b, pm, pb, depth + 1);
  }
  std::optional<Vector2d> project(const Vector3d& p) const {
    Vector2d px;
    const double reach = 2.25 * camera.max_radius_squared() * p.z() * p.z();
    if (p.z() < kNearMetres || p.head<2>().squaredNorm() > reach || !camera.project(p, &px)) return std::nullopt;
    return px;
  }
};

void draw_grid(const OverlayInput& input, cv::Mat3b* out) {
  const OverlayGrid& grid = *input.grid;
  const RigidTransform camera_from_plane = input.camera_from_world * grid.world_from_plane;
  const cv::Scalar colour = input.coarse_stage ? cv::Scalar(235, 235, 235) : cv::Scalar(230, 190, 40);
  const int n = std::max(1, grid.cells);
  for (int i = 0; i <= n; ++i) {
    const double c = grid.half_extent * (2.0 * i / n - 1), h = grid.half_extent;
    const bool rim = i == 0 || i == n;
    for (const auto& [a, b] :
         {std::pair{Vector3d(c, -h, 0), Vector3d(c, h, 0)}, std::pair{Vector3d(-h, c, 0), Vector3d(h, c, 0)}})
      for (const auto& piece : project_segment(input.camera, camera_from_plane * a, camera_from_plane * b)) {
        std::vector<cv::Point> line;
        for (const Vector2d& px : piece) line.push_back(fixed(px));
        cv::polylines(*out, line, false, colour, rim ? 2 : 1, cv::LINE_AA, kShift);
      }
  }
}

void draw_points(const OverlayInput& input, cv::Mat3b* out) {
  const auto& colours = overlay_level_colours();
  for (const OverlayPoint& p : input.points) {
    if (!p.px.allFinite()) continue;
    const int level = std::clamp(p.level, 0, kPyramidLevels - 1);
    const cv::Point at = fixed(p.px.cast<double>());
    const cv::Scalar colour = colours[static_cast<std::size_t>(level)];
    const int radius = (1 << kShift) * (6 + level) / 4;
    if (p.found) {
      cv::circle(*out, at, radius + (1 << kShift) * 3 / 4, cv::Scalar(20, 20, 20), -1, cv::LINE_AA, kShift);
      cv::circle(*out, at, radius, colour, -1, cv::LINE_AA, kShift);
    } else {
      cv::circle(*out, at, radius, colour * 0.55, 1, cv::LINE_AA, kShift);
    }
  }
}

void draw_strip(const OverlayInput& input, cv::Mat3b* out) {
  const double scale = std::clamp(out->cols / 640.0, 0.5, 3.0) * 0.42;
  const int thickness = scale > 0.8 ? 2 : 1, face = cv::FONT_HERSHEY_SIMPLEX;
  const int text_height = cv::getTextSize("Hg", face, scale, thickness, nullptr).height;
  const int strip = std::min(out->rows, text_height * 2 + 4), top = out->rows - strip, base = out->rows - strip / 3;
  cv::Mat3b area = (*out)(cv::Rect(0, top, out->cols, strip));
  area.convertTo(area, -1, 0.25);
  int right = out->cols - text_height / 2;
  if (input.legend) {
    const auto& colours = overlay_level_colours();
    for (int level = kPyramidLevels - 1; level >= 0; --level) {
      const std::string label = "L" + std::to_string(level);
      right -= cv::getTextSize(label, face, scale, thickness, nullptr).width;
      cv::putText(*out, label, {right, base}, face, scale, {235, 235, 235}, thickness, cv::LINE_AA);
      right -= text_height;
      cv::circle(*out, {right + text_height / 3, base - text_height / 2}, std::max(2, text_height * 2 / 5),
                 cv::Scalar(colours[static_cast<std::size_t>(level)]), -1, cv::LINE_AA);
      right -= text_height / 2;
    }
  }
  std::string line = input.state_line;
  while (!line.empty() && cv::getTextSize(line, face, scale, thickness, nullptr).width > right - text_height)
    line.pop_back();
  cv::putText(*out, line, {text_height / 2, base}, face, scale, {245, 245, 245}, thickness, cv::LINE_AA);
}

}  // namespace

const std::array<cv::Vec3b, kPyramidLevels>& overlay_level_colours() {
  static const std::array<cv::Vec3b, kPyramidLevels> colours = {cv::Vec3b(66, 228, 240), cv::Vec3b(233, 180, 86),
                                                                cv::Vec3b(115, 158, 0), cv::Vec3b(0, 94, 213)};
  return colours;
}

std::vector<std::vector<Vector2d>> project_segment(const CameraModel& camera, const Vector3d& a, const Vector3d& b) {
  Segment segment{camera, {}, false};
  Vector3d p = a, q = b;
  if (p.z() < kNearMetres && q.z() < kNearMetres) return {};
  // What is behind the camera is cut off first.
  const auto clip = [](const Vector3d& in, const Vector3d& behind) {
    return Vector3d(in + (behind - in) * ((in.z() - kNearMetres) / (in.z() - behind.z())));
  };
  if (p.z() < kNearMetres) p = clip(q, p);
  if (q.z() < kNearMetres) q = clip(p, q);
  const auto pp = segment.project(p);
  if (pp) segment.add(*pp);
  segment.subdivide(p, q, pp, segment.project(q), 0);
  return std::move(segment.pieces);
}

cv::Mat3b draw_overlay(const OverlayInput& input) {
  const cv::Mat& background = input.background;
  PARALLAX_CHECK(!background.empty() && (background.type() == CV_8UC1 || background.type() == CV_8UC3),
                 "the overlay needs an 8-bit grey or BGR picture");
  cv::Mat3b out;
  if (background.channels() == 1)
    cv::cvtColor(background, out, cv::COLOR_GRAY2BGR);
  else
    background.copyTo(out);
  for (const OverlayTrail& t : input.trails) {
    if (!t.from_px.allFinite() || !t.to_px.allFinite()) continue;
    const cv::Point from = fixed(t.from_px.cast<double>()), to = fixed(t.to_px.cast<double>());
    cv::line(out, from, to, cv::Scalar(66, 228, 240), 1, cv::LINE_AA, kShift);
    cv::circle(out, to, 2 << kShift, cv::Scalar(0, 94, 213), -1, cv::LINE_AA, kShift);
  }
  if (input.tracked) {
    if (input.grid) draw_grid(input, &out);
    draw_points(input, &out);
  }
  if (!input.state_line.empty()) draw_strip(input, &out);
  return out;
}

}  // namespace parallax
