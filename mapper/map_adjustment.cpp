#include "mapper/map_adjustment.h"

#include <algorithm>
#include <set>

namespace parallax {
namespace {

// A measurement is grossly wrong beyond this many of its own standard deviations.
constexpr double kGrossError = 5.0;

struct Extracted {
  BundleProblem problem;
  std::vector<KeyframeId> keyframes;
  std::vector<PointId> points;
  std::vector<MeasurementSource> sources;  // per observation
};

// Poses in `moving` are adjusted; points seen by fewer than two keyframes are left out.
Extracted extract(const Map& map, const CameraModel& camera, const std::set<KeyframeId>& moving, bool everything) {
  Extracted out;
  out.problem.camera = camera;
  std::vector<int> pose_row(static_cast<std::size_t>(map.keyframes.capacity()), -1);
  const auto pose_of = [&](const Keyframe& kf) {
    int& row = pose_row[kf.id.index];
    if (row < 0) {
      row = static_cast<int>(out.keyframes.size());
      out.keyframes.push_back(kf.id);
      out.problem.poses.push_back(kf.camera_from_world);
      const bool moves = !kf.fixed && (everything || moving.contains(kf.id));
      out.problem.pose_fixed.push_back(moves ? 0 : 1);
    }
    return row;
  };
  for (const Keyframe& kf : map.keyframes)
    if (everything || moving.contains(kf.id)) pose_of(kf);
  for (const MapPoint& p : map.points) {
    if (p.observers.size() < 2) continue;
    if (!everything &&
        std::none_of(p.observers.begin(), p.observers.end(), [&](KeyframeId id) { return moving.contains(id); }))
      continue;
    const int row = static_cast<int>(out.points.size());
    out.points.push_back(p.id);
    out.problem.points.push_back(p.position);
    for (KeyframeId id : p.observers) {
      const Keyframe& kf = map.keyframes.at(id);
      const Measurement& m = *kf.find(p.id);
      out.problem.observations.push_back({pose_of(kf), row, m.pixel, m.sigma_px});
      out.sources.push_back(m.source);
    }
  }
  return out;
}

void commit(Map* map, const Extracted& solved, const std::vector<std::uint8_t>& outlier, const MapperOptions& options,
            AdjustmentReport* report) {
  for (std::size_t i = 0; i < solved.keyframes.size(); ++i) {
    if (solved.problem.pose_fixed[i]) continue;
    Keyframe* kf = map->keyframes.find(solved.keyframes[i]);
    if (!kf) continue;
    kf->camera_from_world = solved.problem.poses[i];
    kf->camera_from_world.orthonormalise();
  }
  for (std::size_t j = 0; j < solved.points.size(); ++j)
    if (MapPoint* p = map->points.find(solved.points[j])) p->position = solved.problem.points[j];

  if (!report->solve.stopped) {
    std::vector<int> total(solved.keyframes.size(), 0), bad(solved.keyframes.size(), 0);
    // A keyframe is wrong when its measurements are off by much more than any noise; outliers of a narrow kernel may
    // only say that the lens or the shutter is not quite what the model says.
    for (const auto& o : solved.problem.observations) {
      ++total[o.pose];
      Eigen::Vector2d pixel;
      const bool seen =
          solved.problem.camera.project(solved.problem.poses[o.pose] * solved.problem.points[o.point], &pixel);
      if (!seen || (pixel - o.pixel).norm() > kGrossError * o.sigma_px) ++bad[o.pose];
    }
    for (std::size_t i = 0; i < solved.keyframes.size(); ++i) {
      const Keyframe* kf = map->keyframes.find(solved.keyframes[i]);
      if (kf && !kf->fixed && !solved.problem.pose_fixed[i] && total[i] >= options.min_keyframe_measurements &&
          bad[i] > options.keyframe_outlier_part * total[i])
        report->suspicious.push_back(kf->id);
    }
    for (std::size_t k = 0; k < outlier.size(); ++k) {
      if (!outlier[k]) continue;
      const auto& o = solved.problem.observations[k];
      const PointId point = solved.points[o.point];
      const KeyframeId keyframe = solved.keyframes[o.pose];
      MapPoint* p = map->points.find(point);
      if (!p || !map->keyframes.contains(keyframe)) continue;
      // When the patch's own pixel contradicts the point, or only one view would be left, the point is wrong.
      if (solved.sources[k] == MeasurementSource::root || p->observers.size() <= 2) {
        map->erase_point(point);
        ++report->points_erased;
      } else if (map->remove_measurement(keyframe, point)) {
        report->outliers.emplace_back(keyframe, point);
      }
    }
  }
  // A point that ended behind its source cannot be drawn, warped or measured.
  for (PointId id : solved.points) {
    const MapPoint* p = map->points.find(id);
    if (!p) continue;
    const Keyframe& source = map->keyframes.at(p->source);
    if ((source.camera_from_world * p->position).z() <= 0) {
      map->erase_point(id);
      ++report->points_erased;
    }
  }
  for (KeyframeId id : solved.keyframes)
    if (Keyframe* kf = map->keyframes.find(id)) map->update_depth(kf);
}

AdjustmentReport solve_and_commit(SharedMap* map, Extracted extracted, const MapperOptions& options, int iterations,
                                  const Interruption& stop) {
  AdjustmentReport report;
  const auto start = SteadyClock::now();
  report.poses =
      static_cast<int>(std::count(extracted.problem.pose_fixed.begin(), extracted.problem.pose_fixed.end(), 0));
  report.points = static_cast<int>(extracted.points.size());
  report.observations = static_cast<int>(extracted.problem.observations.size());
  if (report.poses == 0 || report.observations == 0) return report;
  BundleOptions bundle;
  bundle.max_iterations = iterations;
  bundle.min_sigma = options.min_sigma;
  bundle.threads = options.threads;
  std::vector<std::uint8_t> outlier;
  report.solve = adjust_bundle(&extracted.problem, bundle, stop, &outlier);
  report.ran = true;
  if (!report.solve.failed) {
    map->write([&](Map& m) { commit(&m, extracted, outlier, options, &report); });
  }
  report.milliseconds = milliseconds_since(start);
  return report;
}

}  // namespace

AdjustmentReport adjust_local(SharedMap* map, const CameraModel& camera, const MapperOptions& options,
                              KeyframeId newest, const Interruption& stop) {
  Extracted extracted = map->read([&](const Map& m) {
    const Keyframe* centre = m.keyframes.find(newest);
    if (!centre) return Extracted();
    std::vector<std::pair<double, KeyframeId>> near;
    for (const Keyframe& kf : m.keyframes)
      if (kf.id != newest) near.emplace_back((kf.centre() - centre->centre()).norm(), kf.id);
    std::sort(near.begin(), near.end());
    std::set<KeyframeId> moving = {newest};
    for (const auto& [distance, id] : near) {
      if (static_cast<int>(moving.size()) >= options.local_keyframes) break;
      moving.insert(id);
    }
    return extract(m, camera, moving, false);
  });
  return solve_and_commit(map, std::move(extracted), options, options.local_iterations, stop);
}

AdjustmentReport adjust_global(SharedMap* map, const CameraModel& camera, const MapperOptions& options,
                               const Interruption& stop) {
  Extracted extracted = map->read([&](const Map& m) { return extract(m, camera, {}, true); });
  return solve_and_commit(map, std::move(extracted), options, options.global_iterations, stop);
}

}  // namespace parallax
