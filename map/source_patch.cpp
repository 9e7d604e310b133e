#include "map/source_patch.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace parallax {
namespace {

// A ray closer to the plane than this (cosine to the normal) is edge-on.
constexpr double kMinCosine = 0.05;
// Mean squared difference (grey levels squared) that noise, blur and gain may cause, per pixel.
constexpr int kNoisePerPixel = 80;
constexpr int kMaxPerPixel = 600;
// Part of the template's own variance that may remain unexplained.
constexpr double kUnexplainedPart = 0.5;

// Sum of squared differences from the mean.
double energy(const PatchTemplate& t) { return t.sum_squares - static_cast<double>(t.sum) * t.sum / kPatchPixels; }

}  // namespace

bool set_source(MapPoint* point, KeyframeId keyframe, int level, const Eigen::Vector2d& pixel,
                const CameraModel& camera) {
  Eigen::Matrix3d rays;
  const Eigen::Vector2d offsets[3] = {{0, 0}, {1, 0}, {0, 1}};
  for (int k = 0; k < 3; ++k) {
    Eigen::Vector3d ray;
    if (!camera.unproject(level_to_level0(pixel + offsets[k], level), &ray)) return false;
    rays.col(k) = ray;
  }
  point->source = keyframe;
  point->source_level = level;
  point->source_pixel = pixel;
  point->source_rays = rays;
  return true;
}

bool patch_axes(const MapPoint& point, const RigidTransform& source_from_world, Eigen::Matrix<double, 3, 2>* axes) {
  // Everything in the source camera: the plane is n . x = d.
  const Eigen::Vector3d p = source_from_world * point.position;
  const Eigen::Vector3d n = source_from_world.R * point.normal;
  const double d = n.dot(p);
  Eigen::Vector3d on_plane[3];
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d ray = point.source_rays.col(k);
    const double cosine = n.dot(ray);
    if (-cosine < kMinCosine * ray.norm()) return false;
    on_plane[k] = ray * (d / cosine);
  }
  axes->col(0) = source_from_world.R.transpose() * (on_plane[1] - on_plane[0]);
  axes->col(1) = source_from_world.R.transpose() * (on_plane[2] - on_plane[0]);
  return true;
}

int target_level(double det_A, double max_ratio) {
  if (!(det_A > 0)) return -1;
  int level = 0;
  // Closest to one in ratio: going up a level divides by 4, so the border between levels is at 2.
  while (det_A > 2.0 && level < kPyramidLevels - 1) {
    det_A *= 0.25;
    ++level;
  }
  return det_A > max_ratio || det_A < 1.0 / max_ratio ? -1 : level;
}

bool warp_source_patch(const ImagePyramid& source, int source_level, const Eigen::Vector2d& source_pixel,
                       const Eigen::Matrix2d& A, int level, WarpedPatch* out) {
  const Eigen::Matrix2d source_from_template = (A / level_scale(level)).inverse();
  out->warp = A;
  out->level = level;
  out->alignment_ready = false;
  out->ok = warp_patch(source.level[source_level], source_pixel, source_from_template, &out->search);
  return out->ok;
}

void prepare_alignment(const ImagePyramid& source, int source_level, const Eigen::Vector2d& source_pixel,
                       WarpedPatch* patch) {
  const Eigen::Matrix2d source_from_template = (patch->warp / level_scale(patch->level)).inverse();
  if (!warp_alignment_template(source.level[source_level], source_pixel, source_from_template, &patch->alignment))
    prepare_alignment(patch->search, &patch->alignment);
  patch->alignment_ready = true;
}

bool warp_source_patch_for_alignment(const ImagePyramid& source, int source_level, const Eigen::Vector2d& source_pixel,
                                     const Eigen::Matrix2d& A, int level, WarpedPatch* out) {
  const Eigen::Matrix2d source_from_template = (A / level_scale(level)).inverse();
  if (!warp_alignment_template(source.level[source_level], source_pixel, source_from_template, &out->alignment)) {
    // At the image's rim there is room for the patch, though not for the gradients around it.
    if (!warp_source_patch(source, source_level, source_pixel, A, level, out)) return false;
    prepare_alignment(out->search, &out->alignment);
    out->alignment_ready = true;
    return true;
  }
  for (int k = 0; k < kPatchPixels; ++k)
    out->search.pixels[k] = static_cast<std::uint8_t>(static_cast<int>(out->alignment.intensity[k] + 0.5f));
  finish_template(&out->search);
  out->warp = A;
  out->level = level;
  out->alignment_ready = true;
  out->ok = true;
  return true;
}

WarpedPatch with_gain(const WarpedPatch& patch, double gain) {
  WarpedPatch out = patch;
  const auto g = static_cast<float>(gain);
  const float mean = static_cast<float>(patch.search.sum) / kPatchPixels;
  const auto lit = [&](float v) { return mean + g * (v - mean); };
  for (std::size_t k = 0; k < kPatchPixels; ++k) {
    out.search.pixels[k] =
        static_cast<std::uint8_t>(std::clamp(lit(static_cast<float>(patch.search.pixels[k])) + 0.5f, 0.0f, 255.0f));
    out.alignment.intensity[k] = lit(patch.alignment.intensity[k]);
    out.alignment.dx[k] *= g;
    out.alignment.dy[k] *= g;
  }
  finish_template(&out.search);
  // The normal matrix over (dx, dy, mean) is scaled by diag(g, g, 1) on both sides.
  out.alignment.covariance /= g * g;
  const Eigen::Vector3f scale(1 / g, 1 / g, 1);
  out.alignment.inverse_normal = scale.asDiagonal() * patch.alignment.inverse_normal * scale.asDiagonal();
  return out;
}

double contrast_ratio(const PatchTemplate& t, const GreyImage& image, int x, int y) {
  PatchTemplate block;
  if (!(energy(t) > 0) || !copy_patch(image, x, y, &block)) return 0;
  return std::sqrt(energy(block) / energy(t));
}

int zmssd_threshold(const PatchTemplate& t) {
  return static_cast<int>(std::min(kNoisePerPixel * kPatchPixels + kUnexplainedPart * energy(t),
                                   static_cast<double>(kMaxPerPixel * kPatchPixels)));
}

bool resembles(const AlignmentResult& match, const PatchTemplate& t, const ResemblanceLimits& limits) {
  const auto contrast = static_cast<float>(std::sqrt(std::max(0.0, energy(t) / kPatchPixels)));
  return match.rms_residual < std::min(limits.max_rms, std::max(limits.noise_rms, limits.part * contrast));
}

}  // namespace parallax
