#include "calib/target_detection.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/target_detectors.h"

namespace parallax {
namespace {

// Distance of each corner to its nearest neighbour, the median of them.
double median_spacing(const std::vector<TargetCorner>& corners) {
  std::vector<double> nearest;
  for (const auto& a : corners) {
    double best = std::numeric_limits<double>::infinity();
    for (const auto& b : corners)
      if (b.id != a.id) best = std::min(best, (a.px - b.px).squaredNorm());
    nearest.push_back(std::sqrt(best));
  }
  const auto middle = nearest.begin() + static_cast<std::ptrdiff_t>(nearest.size() / 2);
  std::nth_element(nearest.begin(), middle, nearest.end());
  return *middle;
}

// Contrast by steepest slope around the corners, the median of them: the width of an edge in pixels.
double edge_width(const GreyImage& image, const std::vector<TargetCorner>& corners, double spacing) {
  const int radius = std::clamp(static_cast<int>(0.45 * spacing), 2, 12);
  std::vector<double> widths;
  for (const auto& corner : corners) {
    const int x = static_cast<int>(std::lround(corner.px.x())), y = static_cast<int>(std::lround(corner.px.y()));
    if (x < radius + 1 || y < radius + 1 || x + radius + 1 >= image.cols || y + radius + 1 >= image.rows) continue;
    int low = 255, high = 0;
    double steepest = 0;
    for (int v = y - radius; v <= y + radius; ++v) {
      for (int u = x - radius; u <= x + radius; ++u) {
        low = std::min<int>(low, image(v, u));
        high = std::max<int>(high, image(v, u));
        steepest =
            std::max(steepest, 0.5 * std::hypot(image(v, u + 1) - image(v, u - 1), image(v + 1, u) - image(v - 1, u)));
      }
    }
    if (steepest > 0) widths.push_back((high - low) / steepest);
  }
  if (widths.empty()) return 0;
  const auto middle = widths.begin() + static_cast<std::ptrdiff_t>(widths.size() / 2);
  std::nth_element(widths.begin(), middle, widths.end());
  return *middle;
}

double mean_around(const GreyImage& image, const Eigen::Vector2d& at, int radius) {
  double sum = 0;
  int n = 0;
  for (int v = static_cast<int>(std::lround(at.y())) - radius; v <= std::lround(at.y()) + radius; ++v)
    for (int u = static_cast<int>(std::lround(at.x())) - radius; u <= std::lround(at.x()) + radius; ++u)
      if (u >= 0 && v >= 0 && u < image.cols && v < image.rows) {
        sum += image(v, u);
        ++n;
      }
  return n > 0 ? sum / n : 0;
}

// The order with the board the right way up and not mirrored, as far as its colours tell.
void orient_chessboard(const GreyImage& image, int columns, int rows, std::vector<cv::Point2f>* corners) {
  const auto at = [&](int column, int row) {
    const cv::Point2f& p = (*corners)[static_cast<std::size_t>(row * columns + column)];
    return Eigen::Vector2d(p.x, p.y);
  };
  const Eigen::Vector2d across = at(columns - 1, 0) - at(0, 0), down = at(0, rows - 1) - at(0, 0);
  if (across.x() * down.y() - across.y() * down.x() < 0) {  // seen from behind: count the rows from the other end
    for (int row = 0; row < rows / 2; ++row)
      std::swap_ranges(corners->begin() + row * columns, corners->begin() + (row + 1) * columns,
                       corners->begin() + (rows - 1 - row) * columns);
  }
  const Eigen::Vector2d first = 0.25 * (at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1));
  const Eigen::Vector2d second = 0.25 * (at(1, 0) + at(2, 0) + at(1, 1) + at(2, 1));
  if (mean_around(image, first, 1) <= mean_around(image, second, 1)) return;
  if ((columns + rows) % 2 == 1) {
    std::reverse(corners->begin(), corners->end());
  } else if (columns == rows && columns % 2 == 1) {
    std::vector<cv::Point2f> turned;
    for (int row = 0; row < rows; ++row)
      for (int column = 0; column < columns; ++column)
        turned.push_back((*corners)[static_cast<std::size_t>(column * columns + columns - 1 - row)]);
    *corners = turned;
  }
}

}  // namespace

bool refine_corner(const GreyImage& image, int radius_px, cv::Point2f* corner) {
  const float border = static_cast<float>(radius_px) + 2;
  if (corner->x < border || corner->y < border || corner->x > static_cast<float>(image.cols) - 1 - border ||
      corner->y > static_cast<float>(image.rows) - 1 - border)
    return false;
  std::vector<cv::Point2f> point{*corner};
  const cv::TermCriteria criteria(cv::TermCriteria::EPS | cv::TermCriteria::COUNT, 40, 1e-3);
  cv::cornerSubPix(image, point, cv::Size(radius_px, radius_px), cv::Size(-1, -1), criteria);
  const bool stayed = std::hypot(point[0].x - corner->x, point[0].y - corner->y) < static_cast<float>(radius_px);
  if (stayed) *corner = point[0];
  return stayed;
}

void refine_crossing(const GreyImage& image, double radius_px, cv::Point2f* corner) {
  using Vector6d = Eigen::Matrix<double, 6, 1>;
  using Matrix6d = Eigen::Matrix<double, 6, 6>;
  const Eigen::Vector2d start(corner->x, corner->y);
  Eigen::Vector2d at = start;
  const int reach = static_cast<int>(std::ceil(radius_px));
  constexpr int rounds = 20;
  for (int round = 0; round < rounds; ++round) {
    const int x = static_cast<int>(std::lround(at.x())), y = static_cast<int>(std::lround(at.y()));
    if (x < reach || y < reach || x + reach >= image.cols || y + reach >= image.rows) return;
    Matrix6d H = Matrix6d::Zero();
    Vector6d g = Vector6d::Zero();
    for (int v = y - reach; v <= y + reach; ++v) {
      for (int u = x - reach; u <= x + reach; ++u) {
        const double dx = u - at.x(), dy = v - at.y(), weight = 1 - std::hypot(dx, dy) / radius_px;
        if (weight <= 0) continue;
        Vector6d terms;
        terms << dx * dx, dx * dy, dy * dy, dx, dy, 1;
        H.selfadjointView<Eigen::Lower>().rankUpdate(terms, weight);
        g += weight * image(v, u) * terms;
      }
    }
    const Vector6d fit = H.selfadjointView<Eigen::Lower>().ldlt().solve(g);
    Eigen::Matrix2d bend;
    bend << 2 * fit(0), fit(1), fit(1), 2 * fit(2);
    if (!(bend.determinant() < 0)) return;
    const Eigen::Vector2d step = -bend.inverse() * fit.segment<2>(3);
    at += step;
    if (!((at - start).norm() < 1)) return;
    if (step.norm() < 1e-3) break;
  }
  *corner = {static_cast<float>(at.x()), static_cast<float>(at.y())};
}

std::vector<TargetCorner> detect_chessboard(const GreyImage& image, const CalibrationTarget& target,
                                            const DetectionOptions& options) {
  const cv::Size size(target.columns, target.rows);
  std::vector<cv::Point2f> found;
  int flags = cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE;
  if (!options.thorough) flags |= cv::CALIB_CB_FAST_CHECK;
  bool is_there = cv::findChessboardCorners(image, size, found, flags);
  if (!is_there && options.thorough)
    is_there = cv::findChessboardCornersSB(
        image, size, found, cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE | cv::CALIB_CB_ACCURACY);
  if (!is_there || found.size() != static_cast<std::size_t>(size.area())) return {};
  orient_chessboard(image, target.columns, target.rows, &found);

  std::vector<TargetCorner> corners;
  for (int row = 0; row < target.rows; ++row) {
    for (int column = 0; column < target.columns; ++column) {
      const int id = row * target.columns + column;
      // The window reaches a little less than half way to the nearest neighbour, so that no other corner is in it.
      float nearest = std::numeric_limits<float>::max();
      for (const cv::Point step : {cv::Point(1, 0), cv::Point(-1, 0), cv::Point(0, 1), cv::Point(0, -1)}) {
        const int c = column + step.x, r = row + step.y;
        if (c < 0 || r < 0 || c >= target.columns || r >= target.rows) continue;
        const cv::Point2f gap =
            found[static_cast<std::size_t>(r * target.columns + c)] - found[static_cast<std::size_t>(id)];
        nearest = std::min(nearest, std::hypot(gap.x, gap.y));
      }
      cv::Point2f refined = found[static_cast<std::size_t>(id)];
      if (!refine_corner(image, std::clamp(static_cast<int>(0.4F * nearest), 2, 8), &refined)) continue;
      refine_crossing(image, crossing_radius(nearest), &refined);
      corners.push_back({id, {refined.x, refined.y}});
    }
  }
  return corners;
}

std::optional<TargetDetection> detect_target(const GreyImage& image, const CalibrationTarget& target,
                                             const DetectionOptions& options) {
  TargetDetection out;
  switch (target.kind) {
    case TargetKind::chessboard:
      out.corners = detect_chessboard(image, target, options);
      break;
    case TargetKind::charuco:
      out.corners = detect_charuco(image, target, options);
      break;
    case TargetKind::circles:
    case TargetKind::asymmetric_circles:
      out.corners = detect_circles(image, target, options);
      break;
    case TargetKind::squares:
      out.corners = detect_squares(image, target, options);
      break;
  }
  if (static_cast<int>(out.corners.size()) < std::max(options.min_corners, 4)) return std::nullopt;
  out.spacing_px = median_spacing(out.corners);
  out.edge_px = edge_width(image, out.corners, out.spacing_px);
  return out;
}

}  // namespace parallax
