// Circle grids: OpenCV finds and orders the discs; their centroids, weighted by darkness, are ours.
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>

#include "calib/planar_pose.h"
#include "calib/target_detectors.h"

namespace parallax {
namespace {

// The centroid of the ink within `reach_m` of the disc's centre, from the local map of the plane. False when the disc
// touches the border or there is no contrast.
bool disc_centroid(const GreyImage& image, const Eigen::Matrix3d& target_from_image, const Eigen::Vector2d& centre_m,
                   double reach_m, const Eigen::Vector2d& guess, double reach_px, Eigen::Vector2d* centroid) {
  const int radius = static_cast<int>(std::ceil(reach_px)) + 1;
  const int x0 = static_cast<int>(std::lround(guess.x())), y0 = static_cast<int>(std::lround(guess.y()));
  if (x0 - radius < 0 || y0 - radius < 0 || x0 + radius >= image.cols || y0 + radius >= image.rows) return false;
  std::vector<Eigen::Vector3d> samples;
  std::vector<unsigned char> greys;
  for (int y = y0 - radius; y <= y0 + radius; ++y) {
    for (int x = x0 - radius; x <= x0 + radius; ++x) {
      const Eigen::Vector2d on_target = (target_from_image * Eigen::Vector3d(x, y, 1)).hnormalized();
      if ((on_target - centre_m).norm() > reach_m) continue;
      samples.emplace_back(x, y, image(y, x));
      greys.push_back(image(y, x));
    }
  }
  if (samples.size() < 12) return false;
  std::sort(greys.begin(), greys.end());
  const double dark = greys[greys.size() / 20], bright = greys[greys.size() - 1 - greys.size() / 5];
  if (bright - dark < 20) return false;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& s : samples) {
    // Noise of the white paper does not count.
    const double ink = std::clamp(((bright - s.z()) / (bright - dark) - 0.1) / 0.8, 0.0, 1.0);
    sum += ink * Eigen::Vector3d(s.x(), s.y(), 1);
  }
  if (!(sum.z() > 3)) return false;
  *centroid = sum.head<2>() / sum.z();
  return true;
}

}  // namespace

std::vector<TargetCorner> detect_circles(const GreyImage& image, const CalibrationTarget& target,
                                         const DetectionOptions& options) {
  cv::SimpleBlobDetector::Params blobs;
  blobs.minArea = 12;
  blobs.maxArea = static_cast<float>(image.total()) / 40.0F;
  blobs.filterByConvexity = true;
  blobs.minConvexity = 0.8F;
  blobs.filterByInertia = true;
  blobs.minInertiaRatio = 0.08F;
  blobs.minDistBetweenBlobs = 4;
  blobs.minRepeatability = 2;
  if (!options.thorough) blobs.thresholdStep = 20;
  const bool asymmetric = target.kind == TargetKind::asymmetric_circles;
  const int layout = asymmetric ? cv::CALIB_CB_ASYMMETRIC_GRID : cv::CALIB_CB_SYMMETRIC_GRID;
  const cv::Size size(target.columns, target.rows);
  std::vector<cv::Point2f> found;
  const auto detector = cv::SimpleBlobDetector::create(blobs);
  bool is_there = cv::findCirclesGrid(image, size, found, layout, detector);
  if (!is_there && options.thorough)
    is_there = cv::findCirclesGrid(image, size, found, layout | cv::CALIB_CB_CLUSTERING, detector);
  if (!is_there || found.size() != static_cast<std::size_t>(size.area())) return {};

  const std::vector<Eigen::Vector3d> points = target_points(target);
  std::vector<Eigen::Vector2d> plane, px;
  for (std::size_t i = 0; i < points.size(); ++i) {
    plane.push_back(points[i].head<2>());
    px.emplace_back(found[i].x, found[i].y);
  }
  // Not mirrored: a symmetric grid counted from the other end, an asymmetric one cannot be.
  const auto columns = static_cast<std::size_t>(target.columns);
  const Eigen::Vector2d across = px[columns - 1] - px[0], down = px[px.size() - columns] - px[0];
  if (across.x() * down.y() - across.y() * down.x() < 0) {
    if (asymmetric) return {};
    for (std::size_t row = 0; row < static_cast<std::size_t>(target.rows) / 2; ++row)
      std::swap_ranges(px.begin() + static_cast<std::ptrdiff_t>(row * columns),
                       px.begin() + static_cast<std::ptrdiff_t>((row + 1) * columns),
                       px.end() - static_cast<std::ptrdiff_t>((row + 1) * columns));
  }

  const double nearest_m = asymmetric ? std::sqrt(2.0) * target.square_m : target.square_m;
  const double reach_m = std::min(0.5 * nearest_m, 0.5 * target.detail() + 0.25 * (nearest_m - target.detail()) + 1e-9);
  std::vector<TargetCorner> corners;
  for (std::size_t i = 0; i < points.size(); ++i) {
    // The plane around the disc, from its nearest neighbours.
    std::vector<Eigen::Vector2d> local_plane, local_px;
    for (std::size_t k = 0; k < points.size(); ++k) {
      if ((plane[k] - plane[i]).norm() > 2.1 * nearest_m) continue;
      local_plane.push_back(plane[k]);
      local_px.push_back(px[k]);
    }
    Eigen::Matrix3d image_from_target;
    if (local_plane.size() < 4 || !find_homography(local_plane, local_px, &image_from_target)) continue;
    double reach_px = 0;
    for (int k = 0; k < 16; ++k) {
      const double angle = k * 2 * 3.14159265358979 / 16;
      const Eigen::Vector2d rim = plane[i] + reach_m * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      reach_px = std::max(reach_px, ((image_from_target * rim.homogeneous()).hnormalized() - px[i]).norm());
    }
    if (!(reach_px < 0.25 * image.cols)) continue;
    Eigen::Vector2d centroid = px[i];
    bool good = true;
    for (int round = 0; round < 2 && good; ++round)
      good = disc_centroid(image, image_from_target.inverse(), plane[i], reach_m, px[i], reach_px, &centroid);
    if (!good || (centroid - px[i]).norm() > 0.5 * reach_px) continue;
    corners.push_back({static_cast<int>(i), centroid});
  }
  return corners;
}

}  // namespace parallax
