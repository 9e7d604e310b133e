#include "mapper/point_measurer.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace parallax {
namespace {

constexpr double kHalfPatch = 4.0;
constexpr ResemblanceLimits kResemblance = {.max_rms = 18.0f, .part = 0.5f, .noise_rms = 6.0f};
constexpr double kMaxAlignShift_px = 2.0;
// In another light the contrast is less or more by a factor between these.
constexpr double kLeastGain = 1.15, kMostGain = 2.5;

// Where the patch is in the image (pixels of its level), near the centre. `*start` is where the alignment began.
std::optional<Eigen::Vector2d> locate(const WarpedPatch& patch, const GreyImage& image, const CornerList& corners,
                                      const Eigen::Vector2d& centre, double radius_px, Eigen::Vector2d* start) {
  const int threshold = zmssd_threshold(patch.search);
  int x = 0, y = 0;
  const int score = best_zmssd(patch.search, image, corners, centre.x(), centre.y(), radius_px, threshold, &x, &y);
  // Where no corner is near, the predicted place itself is as good a start.
  *start = score <= threshold ? Eigen::Vector2d(x, y) : centre;
  const AlignmentResult result = align_patch(patch.alignment, image, *start, 10, kMaxAlignShift_px);
  if (!result.converged || !resembles(result, patch.search, kResemblance)) return std::nullopt;
  if ((result.position - centre).norm() > radius_px + 0.5) return std::nullopt;
  return result.position;
}

}  // namespace

std::optional<PredictedPatch> predict_patch(const CameraModel& camera, const MapPoint& point,
                                            const RigidTransform& source_from_world,
                                            const RigidTransform& target_from_world) {
  const Eigen::Vector3d p = target_from_world * point.position;
  PredictedPatch out;
  Eigen::Matrix<double, 2, 3> jacobian;
  if (!camera.project(p, &out.pixel, &jacobian) || !camera.in_image(out.pixel, kHalfPatch)) return std::nullopt;
  // Seen from behind, or so obliquely that the patch is a line.
  constexpr double kMinCosine = 0.15;
  const Eigen::Vector3d normal = target_from_world.R * point.normal;
  if (-normal.dot(p) < kMinCosine * p.norm()) return std::nullopt;
  Eigen::Matrix<double, 3, 2> axes;
  if (!patch_axes(point, source_from_world, &axes)) return std::nullopt;
  out.warp = warp_matrix(jacobian, target_from_world.R, axes);
  out.level = target_level(out.warp.determinant());
  if (out.level < 0 || !camera.in_image(out.pixel, kHalfPatch * level_scale(out.level))) return std::nullopt;
  return out;
}

std::optional<Measurement> measure_point(const MapPoint& point, const FrameImages& source,
                                         const PredictedPatch& predicted, const FrameImages& target, double radius_px,
                                         MeasurementSource how, bool other_light) {
  WarpedPatch patch;
  if (!warp_source_patch_for_alignment(source.pyramid, point.source_level, point.source_pixel, predicted.warp,
                                       predicted.level, &patch))
    return std::nullopt;
  if (!patch.alignment.valid) return std::nullopt;
  const GreyImage& image = target.pyramid.level[predicted.level];
  const Eigen::Vector2d centre = level0_to_level(predicted.pixel, predicted.level);
  const CornerList& corners = target.corners[predicted.level];
  Eigen::Vector2d start;
  auto position = locate(patch, image, corners, centre, radius_px, &start);
  if (!position && other_light) {
    const double gain = contrast_ratio(patch.search, image, static_cast<int>(std::lround(start.x())),
                                       static_cast<int>(std::lround(start.y())));
    const double factor = std::max(gain, 1 / gain);
    if (factor > kLeastGain && factor < kMostGain)
      position = locate(with_gain(patch, gain), image, corners, centre, radius_px, &start);
  }
  if (!position) return std::nullopt;
  Measurement m;
  m.point = point.id;
  m.pixel = level_to_level0(*position, predicted.level);
  m.level = static_cast<std::int8_t>(predicted.level);
  m.sigma_px = static_cast<float>(level_scale(predicted.level));
  m.source = how;
  return m;
}

}  // namespace parallax
