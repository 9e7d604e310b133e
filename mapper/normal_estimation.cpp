#include "mapper/normal_estimation.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "map/source_patch.h"
#include "mapper/patch_slope.h"

namespace parallax {
namespace {

// Neighbours in the source image: how many, and how far (source-level pixels) they may be.
constexpr int kNeighbours = 10;
constexpr int kLeastNeighbours = 4;
constexpr double kNeighbourRadius_px = 40;
// Relative difference in inverse depth that a neighbour on the same plane may have from the fit (one standard
// deviation).
constexpr double kNeighbourSigma = 0.004;
// A point this near the dominant plane, as a part of its depth, may lie on it.
constexpr double kOnPlane = 0.01;

struct View {
  RigidTransform camera_from_world;
  std::shared_ptr<const FrameImages> images;
  Eigen::Vector2d pixel;  // level 0
};

struct Job {
  PointId id;
  Eigen::Vector3d position, normal;
  int level = 0;
  Eigen::Vector2d pixel;  // of the level
  Eigen::Matrix3d rays;
  int observers = 0;
  std::vector<View> views;
};

// A point that the source keyframe measures: level-0 pixel and inverse depth there.
struct Neighbour {
  Eigen::Vector2d pixel;
  double inverse_depth = 0;
};

struct Batch {
  RigidTransform source_pose;
  std::shared_ptr<const FrameImages> source;
  std::vector<Job> jobs;
  std::vector<Neighbour> neighbours;
  std::optional<Plane> plane;
};

// Views of the point by angle from the source's ray, at most `max_views`, spread from the widest down.
std::vector<View> choose_views(const Map& map, const MapPoint& p, const Eigen::Vector3d& source_centre,
                               const NormalEstimationOptions& options) {
  const double max_cosine = std::cos(options.min_angle_deg * M_PI / 180.0);
  const Eigen::Vector3d source_ray = (source_centre - p.position).normalized();
  std::vector<std::pair<double, KeyframeId>> found;
  for (KeyframeId id : p.observers) {
    if (id == p.source) continue;
    const double cosine = (map.keyframes.at(id).centre() - p.position).normalized().dot(source_ray);
    if (cosine < max_cosine) found.emplace_back(cosine, id);
  }
  std::sort(found.begin(), found.end());
  std::vector<View> views;
  const int n = static_cast<int>(found.size()), take = std::min(n, options.max_views);
  for (int i = 0; i < take; ++i) {
    const Keyframe& kf = map.keyframes.at(found[static_cast<std::size_t>(i * n / take)].second);
    views.push_back({kf.camera_from_world, kf.images, kf.find(p.id)->pixel});
  }
  return views;
}

// The slope of a plane through the point and its neighbours in the image, robustly; nothing when they do not agree.
std::optional<Eigen::Vector2d> slope_of_neighbours(const Job& job, double inverse_depth,
                                                   const std::vector<Neighbour>& neighbours) {
  const Eigen::Vector2d centre = level_to_level0(job.pixel, job.level);
  const double scale = level_scale(job.level), radius = kNeighbourRadius_px * scale;
  std::vector<std::pair<double, const Neighbour*>> near;
  for (const Neighbour& n : neighbours) {
    const Eigen::Vector2d d = n.pixel - centre;
    if (std::abs(d.x()) > radius || std::abs(d.y()) > radius) continue;
    const double distance = d.squaredNorm();
    if (distance > 4.0 && distance < radius * radius) near.emplace_back(distance, &n);
  }
  if (static_cast<int>(near.size()) < kLeastNeighbours) return std::nullopt;
  const auto keep = std::min<std::size_t>(kNeighbours, near.size());
  std::partial_sort(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(keep), near.end());
  near.resize(keep);
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
  constexpr int kRounds = 6;
  double weight_sum = 0;
  for (int round = 0; round < kRounds; ++round) {
    // Widely tolerant at first, then down to the noise.
    const double sigma = kNeighbourSigma * (1 << std::max(0, 4 - round));
    Eigen::Matrix2d a = Eigen::Matrix2d::Identity() * 1e-9;
    Eigen::Vector2d b = Eigen::Vector2d::Zero();
    weight_sum = 0;
    for (const auto& [distance, n] : near) {
      const Eigen::Vector2d d = (n->pixel - centre) / scale;
      const double relative = n->inverse_depth / inverse_depth - 1.0;
      const double residual = (relative - slope.dot(d)) / sigma;
      const double weight = 1.0 / ((1.0 + residual * residual) * (1.0 + residual * residual));
      a += weight * d * d.transpose();
      b += weight * relative * d;
      weight_sum += weight;
    }
    slope = a.inverse() * b;
    // All on a line: nothing is known across it.
    if (a.determinant() < 1e-3 * a.trace() * a.trace()) return std::nullopt;
  }
  if (weight_sum < kLeastNeighbours - 1.0 || !slope.allFinite()) return std::nullopt;
  return slope;
}

struct Verdict {
  bool decided = false;
  std::optional<Eigen::Vector3d> normal;  // world; when it is to be changed
};

Verdict judge(const Job& job, const Batch& batch, const CameraModel& camera, const NormalEstimationOptions& options) {
  Verdict verdict;
  const Eigen::Vector3d p = batch.source_pose * job.position;
  if (!(p.z() > 0)) return verdict;
  const Eigen::Vector3d present_normal = batch.source_pose.R * job.normal;
  const Eigen::Vector3d towards = -job.rays.col(0).normalized();
  const auto allowed = [&](const Eigen::Vector2d& slope) {
    if (!slope.allFinite()) return false;
    const Eigen::Vector3d n = normal_of_slope(job.rays, slope);
    if (n.dot(towards) < options.min_cosine) return false;
    const Eigen::Vector3d in_world = batch.source_pose.R.transpose() * n;
    return std::all_of(job.views.begin(), job.views.end(), [&](const View& view) {
      const Eigen::Vector3d ray = view.camera_from_world.inverse().t - job.position;
      return in_world.dot(ray) > 0.5 * options.min_cosine * ray.norm();
    });
  };
  PatchSlope patch(batch.source->pyramid, job.level, job.pixel, job.rays, p.z());
  if (!patch.ok()) return verdict;
  const Eigen::Vector2d present = slope_of_normal(job.rays, present_normal);
  if (!present.allFinite()) return verdict;
  const RigidTransform world_from_source = batch.source_pose.inverse();
  for (const View& view : job.views)
    patch.add(camera, {view.camera_from_world * world_from_source, &view.images->pyramid, view.pixel}, present);
  if (patch.views() + 1 < options.min_observers) return verdict;

  const double present_score = patch.score(present);
  Eigen::Vector2d best = present;
  double best_score = present_score;
  const auto offer = [&](const Eigen::Vector2d& slope) {
    if (!allowed(slope)) return;
    const double score = patch.score(slope);
    if (score < (1.0 - options.min_improvement) * best_score) {
      best = slope;
      best_score = score;
    }
  };
  if (const auto slope = slope_of_neighbours(job, 1.0 / p.z(), batch.neighbours)) offer(*slope);
  if (batch.plane) {
    const RigidTransform plane_from_world = batch.plane->world_from_plane.inverse();
    if (std::abs((plane_from_world * job.position).z()) < kOnPlane * p.z()) {
      Eigen::Vector3d n = batch.source_pose.R * batch.plane->world_from_plane.R.col(2);
      if (n.dot(towards) < 0) n = -n;
      offer(slope_of_normal(job.rays, n));
    }
  }
  // One pixel is this much of a radian: the slope of a surface inclined by 45 degrees.
  const double pixel_angle = (job.rays.col(1) - job.rays.col(0)).norm() / job.rays.col(0).norm();
  const PatchSlope::Refinement refined = patch.refine(best, options.prior_sigma * pixel_angle);
  const bool informed = refined.ok && refined.sigma < options.max_sigma;
  if (informed) offer(refined.slope);
  verdict.decided = informed;
  if (best_score < (1.0 - options.min_improvement) * present_score && best_score < options.max_unexplained) {
    verdict.decided = true;
    verdict.normal = batch.source_pose.R.transpose() * normal_of_slope(job.rays, best);
  }
  return verdict;
}

std::optional<Batch> extract(const Map& m, KeyframeId source, const std::vector<PointId>& points,
                             const NormalEstimationOptions& options) {
  const Keyframe* kf = m.keyframes.find(source);
  if (!kf) return std::nullopt;
  Batch batch{kf->camera_from_world, kf->images, {}, {}, m.plane};
  const Eigen::Vector3d centre = kf->centre();
  for (PointId id : points) {
    const MapPoint* p = m.points.find(id);
    if (!p || p->source != source) continue;
    Job job{p->id,
            p->position,
            p->normal,
            p->source_level,
            p->source_pixel,
            p->source_rays,
            static_cast<int>(p->observers.size()),
            choose_views(m, *p, centre, options)};
    if (static_cast<int>(job.views.size()) + 1 >= options.min_observers) batch.jobs.push_back(std::move(job));
  }
  if (batch.jobs.empty()) return std::nullopt;
  batch.neighbours.reserve(kf->measurements.size());
  for (const Measurement& x : kf->measurements) {
    const double z = (kf->camera_from_world * m.points.at(x.point).position).z();
    if (z > 0) batch.neighbours.push_back({x.pixel, 1.0 / z});
  }
  return batch;
}

}  // namespace

std::vector<PointId> NormalEstimation::estimate(SharedMap* map, const Interruption& stop) {
  // Which points, by source keyframe.
  const auto due = map->read([&](const Map& m) {
    tried_.resize(static_cast<std::size_t>(std::max<int>(m.points.capacity(), static_cast<int>(tried_.size()))), 0);
    std::vector<std::pair<KeyframeId, PointId>> out;
    for (const MapPoint& p : m.points) {
      const int observers = static_cast<int>(p.observers.size());
      if (observers >= options_.min_observers && observers >= options_.regrown * tried_[p.id.index])
        out.emplace_back(p.source, p.id);
    }
    return out;
  });
  std::vector<std::pair<KeyframeId, PointId>> sorted = due;
  std::sort(sorted.begin(), sorted.end());
  std::vector<PointId> changed;
  for (std::size_t begin = 0; begin < sorted.size() && !stop.requested();) {
    const KeyframeId source = sorted[begin].first;
    std::vector<PointId> points;
    for (; begin < sorted.size() && sorted[begin].first == source; ++begin) points.push_back(sorted[begin].second);
    const std::optional<Batch> batch = map->read([&](const Map& m) { return extract(m, source, points, options_); });
    if (!batch) continue;
    std::vector<std::pair<const Job*, Verdict>> verdicts;
    for (const Job& job : batch->jobs) {
      if (stop.requested()) break;
      verdicts.emplace_back(&job, judge(job, *batch, camera_, options_));
    }
    map->write([&](Map& m) {
      for (const auto& [job, verdict] : verdicts) {
        tried_[job->id.index] = job->observers;
        MapPoint* p = m.points.find(job->id);
        if (!p || p->source != source || !verdict.decided) continue;
        p->normal_estimated = true;
        if (!verdict.normal) continue;
        p->normal = *verdict.normal;
        changed.push_back(p->id);
      }
    });
  }
  return changed;
}

int estimate_normals(SharedMap* map, const CameraModel& camera, const Interruption& stop) {
  return static_cast<int>(NormalEstimation(camera).estimate(map, stop).size());
}

}  // namespace parallax
