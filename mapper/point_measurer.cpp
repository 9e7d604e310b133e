#include "mapper/point_measurer.h"

#include <Eigen/LU>

namespace parallax {
namespace {

constexpr double kHalfPatch = 4.0;
constexpr ResemblanceLimits kResemblance = {.max_rms = 18.0f, .part = 0.5f, .noise_rms = 6.0f};
constexpr double kMaxAlignShift_px = 2.0;

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
                                         MeasurementSource how) {
  WarpedPatch patch;
  if (!warp_source_patch_for_alignment(source.pyramid, point.source_level, point.source_pixel, predicted.warp,
                                       predicted.level, &patch))
    return std::nullopt;
  if (!patch.alignment.valid) return std::nullopt;
  const GreyImage& image = target.pyramid.level[predicted.level];
  const Eigen::Vector2d centre = level0_to_level(predicted.pixel, predicted.level);
  const int threshold = zmssd_threshold(patch.search);
  int x = 0, y = 0;
  const int score = best_zmssd(patch.search, image, target.corners[predicted.level], centre.x(), centre.y(), radius_px,
                               threshold, &x, &y);
  // Where no corner is near, the predicted place itself is as good a start.
  const Eigen::Vector2d start = score <= threshold ? Eigen::Vector2d(x, y) : centre;
  const AlignmentResult result = align_patch(patch.alignment, image, start, 10, kMaxAlignShift_px);
  if (!result.converged || !resembles(result, patch.search, kResemblance)) return std::nullopt;
  if ((result.position - centre).norm() > radius_px + 0.5) return std::nullopt;
  Measurement m;
  m.point = point.id;
  m.pixel = level_to_level0(result.position, predicted.level);
  m.level = static_cast<std::int8_t>(predicted.level);
  m.sigma_px = static_cast<float>(level_scale(predicted.level));
  m.source = how;
  return m;
}

}  // namespace parallax
