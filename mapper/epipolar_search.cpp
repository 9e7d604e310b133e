#include "mapper/epipolar_search.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "map/source_patch.h"
#include "mapper/two_view.h"

namespace parallax {
namespace {

constexpr int kBorder = 5;
constexpr ResemblanceLimits kResemblance = {.max_rms = 16.0f, .part = 0.45f, .noise_rms = 6.0f};
// Matches closer than this to the best are the same match, not a rival (pixels of the level).
constexpr double kRivalDistance_px = 4.0;

}  // namespace

EpipolarSearch::EpipolarSearch(const CameraModel& camera, const MapperOptions& options, const SearchView& view,
                               const SearchView& second)
    : camera_(camera),
      options_(options),
      view_(view),
      second_(second),
      second_from_view_(second.camera_from_world * view.camera_from_world.inverse()) {
  for (int level = 0; level < kPyramidLevels; ++level) {
    const auto& corners = second.images->corners[level].corners;
    rays_[level].x.resize(corners.size());
    rays_[level].y.resize(corners.size());
    for (std::size_t i = 0; i < corners.size(); ++i) {
      Eigen::Vector3d ray;
      const bool ok = camera_.unproject(level_to_level0(Eigen::Vector2d(corners[i].x, corners[i].y), level), &ray);
      rays_[level].x[i] = ok ? static_cast<float>(ray.x()) : std::numeric_limits<float>::quiet_NaN();
      rays_[level].y[i] = ok ? static_cast<float>(ray.y()) : std::numeric_limits<float>::quiet_NaN();
    }
  }
}

std::optional<NewPoint> EpipolarSearch::find(const SalientPoint& candidate) const {
  const Eigen::Vector2d pixel0 = level_to_level0(candidate.pixel, candidate.level);
  Eigen::Vector3d ray;
  if (!camera_.unproject(pixel0, &ray)) return std::nullopt;

  // The part of the ray that is likely, in the second camera.
  const Eigen::Vector3d near = second_from_view_ * (ray * view_.min_depth);
  const Eigen::Vector3d far = second_from_view_ * (ray * view_.max_depth);
  constexpr double kMinZ = 1e-3;
  if (near.z() < kMinZ * view_.mean_depth || far.z() < kMinZ * view_.mean_depth) return std::nullopt;
  const Eigen::Vector2d a = near.hnormalized(), b = far.hnormalized();
  const Eigen::Vector2d along = b - a;
  const double length = along.norm();
  if (length < 1e-9) return std::nullopt;
  const Eigen::Vector2d direction = along / length, across(-direction.y(), direction.x());

  // The warp at the mean depth for a patch that faces the keyframe decides the level and the template.
  MapPoint guess;
  if (!set_source(&guess, view_.id, candidate.level, candidate.pixel, camera_)) return std::nullopt;
  guess.position = view_.camera_from_world.inverse() * (ray * view_.mean_depth);
  guess.normal = view_.camera_from_world.R.transpose() * (-ray.normalized());
  Eigen::Matrix<double, 3, 2> axes;
  if (!patch_axes(guess, view_.camera_from_world, &axes)) return std::nullopt;
  Eigen::Vector2d mean_pixel;
  Eigen::Matrix<double, 2, 3> jacobian;
  if (!camera_.project(second_.camera_from_world * guess.position, &mean_pixel, &jacobian)) return std::nullopt;
  const Eigen::Matrix2d A = warp_matrix(jacobian, second_.camera_from_world.R, axes);
  const int level = target_level(A.determinant());
  if (level < 0) return std::nullopt;
  WarpedPatch patch;
  if (!warp_source_patch(view_.images->pyramid, candidate.level, candidate.pixel, A, level, &patch))
    return std::nullopt;
  const int threshold = zmssd_threshold(patch.search);

  // Pixels of the level per unit on z = 1: near enough for a band's width.
  const double px_per_unit = camera_.mean_focal_px() / level_scale(level);
  const float band = static_cast<float>(options_.epipolar_band_px / px_per_unit);
  const float slack = 2.0f * band;
  const GreyImage& image = second_.images->pyramid.level[level];
  const auto& corners = second_.images->corners[level].corners;
  const auto& rays = rays_[level];
  const auto ax = static_cast<float>(a.x()), ay = static_cast<float>(a.y());
  const auto dx = static_cast<float>(direction.x()), dy = static_cast<float>(direction.y());
  const auto nx = static_cast<float>(across.x()), ny = static_cast<float>(across.y());
  const auto span = static_cast<float>(length);

  struct Hit {
    int score, x, y;
  };
  thread_local std::vector<Hit> hits;
  hits.clear();
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const float rx = rays.x[i] - ax, ry = rays.y[i] - ay;
    if (!(std::abs(rx * nx + ry * ny) < band)) continue;
    const float s = rx * dx + ry * dy;
    if (!(s > -slack && s < span + slack)) continue;
    const Corner& c = corners[i];
    if (c.x < kBorder || c.y < kBorder || c.x >= image.cols - kBorder || c.y >= image.rows - kBorder) continue;
    hits.push_back({zmssd(patch.search, image, c.x, c.y), c.x, c.y});
  }
  const auto best =
      std::min_element(hits.begin(), hits.end(), [](const Hit& l, const Hit& r) { return l.score < r.score; });
  if (best == hits.end() || best->score > threshold) return std::nullopt;
  const Hit chosen = *best;
  for (const Hit& h : hits) {
    const double distance = std::hypot(h.x - chosen.x, h.y - chosen.y);
    if (distance > kRivalDistance_px && chosen.score > options_.epipolar_uniqueness * h.score) return std::nullopt;
  }

  prepare_alignment(view_.images->pyramid, candidate.level, candidate.pixel, &patch);
  if (!patch.alignment.valid) return std::nullopt;
  const AlignmentResult aligned = align_patch(patch.alignment, image, Eigen::Vector2d(chosen.x, chosen.y));
  if (!aligned.converged || !resembles(aligned, patch.search, kResemblance)) return std::nullopt;

  NewPoint out;
  out.level = candidate.level;
  out.pixel = candidate.pixel;
  out.other.pixel = level_to_level0(aligned.position, level);
  out.other.level = static_cast<std::int8_t>(level);
  out.other.sigma_px = static_cast<float>(level_scale(level));
  out.other.source = MeasurementSource::epipolar;
  Eigen::Vector3d other_ray, point;
  if (!camera_.unproject(out.other.pixel, &other_ray)) return std::nullopt;
  const double cosine = (second_from_view_.R * ray).normalized().dot(other_ray.normalized());
  if (cosine > std::cos(options_.min_triangulation_deg * M_PI / 180.0)) return std::nullopt;
  if (!triangulate(second_from_view_, ray, other_ray, &point)) return std::nullopt;
  if (point.z() < view_.min_depth || point.z() > view_.max_depth) return std::nullopt;
  Eigen::Vector2d p1, p2;
  if (!camera_.project(point, &p1) || !camera_.project(second_from_view_ * point, &p2)) return std::nullopt;
  if ((p1 - pixel0).norm() > options_.max_triangulation_error_px * level_scale(candidate.level)) return std::nullopt;
  if ((p2 - out.other.pixel).norm() > options_.max_triangulation_error_px * level_scale(level)) return std::nullopt;
  out.position = view_.camera_from_world.inverse() * point;
  return out;
}

}  // namespace parallax
