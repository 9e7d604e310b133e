#include "mapper/point_creation.h"

#include <algorithm>
#include <optional>

#include "map/source_patch.h"
#include "mapper/epipolar_search.h"
#include "mapper/salient_points.h"

namespace parallax {
namespace {

// Second views tried for each keyframe.
constexpr int kSecondViews = 3;
// The range searched is what is known of the scene's depths, widened by this factor.
constexpr double kDepthMargin = 1.4;

SearchView view_of(const Map& map, const Keyframe& kf) {
  SearchView view{kf.id, kf.camera_from_world, kf.images, kf.mean_depth, kf.depth_sigma, 0, 0};
  std::vector<double> depths;
  for (const Measurement& m : kf.measurements) {
    const double z = (kf.camera_from_world * map.points.at(m.point).position).z();
    if (z > 0) depths.push_back(z);
  }
  double low = kf.mean_depth * 0.5, high = kf.mean_depth * 2.0;
  if (depths.size() >= 10) {
    std::sort(depths.begin(), depths.end());
    low = depths[depths.size() / 50];
    high = depths[depths.size() - 1 - depths.size() / 50];
  }
  view.min_depth = low / kDepthMargin;
  view.max_depth = high * kDepthMargin;
  return view;
}

struct Setting {
  SearchView view;
  std::vector<Measurement> measured;
  std::vector<SearchView> seconds;
};

}  // namespace

int create_points(SharedMap* map, const CameraModel& camera, const MapperOptions& options, KeyframeId keyframe) {
  const std::optional<Setting> setting = map->read([&](const Map& m) -> std::optional<Setting> {
    const Keyframe* kf = m.keyframes.find(keyframe);
    if (!kf) return std::nullopt;
    Setting s{view_of(m, *kf), kf->measurements, {}};
    // The closest keyframes whose parallax at the mean depth is enough to triangulate with.
    std::vector<std::pair<double, KeyframeId>> near;
    for (const Keyframe& other : m.keyframes) {
      if (other.id == kf->id) continue;
      const double distance = (other.centre() - kf->centre()).norm();
      const double angle_deg = distance / kf->mean_depth * 180.0 / M_PI;
      if (angle_deg < options.min_triangulation_deg) continue;
      // Looking elsewhere: nothing in common.
      if ((other.camera_from_world.R * kf->camera_from_world.R.transpose())(2, 2) < 0.5) continue;
      near.emplace_back(distance, other.id);
    }
    std::sort(near.begin(), near.end());
    for (std::size_t i = 0; i < std::min<std::size_t>(kSecondViews, near.size()); ++i)
      s.seconds.push_back(view_of(m, m.keyframes.at(near[i].second)));
    return s;
  });
  if (!setting || setting->seconds.empty()) return 0;

  std::vector<SalientPoint> candidates = find_salient_points(*setting->view.images, setting->measured, options);
  struct Made {
    MapPoint point;
    Measurement root, other;
    KeyframeId second;
  };
  std::vector<Made> made;
  for (const SearchView& second : setting->seconds) {
    const EpipolarSearch search(camera, options, setting->view, second);
    std::vector<SalientPoint> left;
    for (const SalientPoint& candidate : candidates) {
      const std::optional<NewPoint> found = search.find(candidate);
      if (!found) {
        left.push_back(candidate);
        continue;
      }
      Made entry;
      if (!set_source(&entry.point, keyframe, found->level, found->pixel, camera)) continue;
      entry.point.position = found->position;
      // Facing the keyframe it was seen from, until more is known (PTAM §6.5).
      entry.point.normal =
          -(setting->view.camera_from_world.R.transpose() * entry.point.source_rays.col(0)).normalized();
      entry.root.pixel = level_to_level0(found->pixel, found->level);
      entry.root.level = static_cast<std::int8_t>(found->level);
      entry.root.sigma_px = static_cast<float>(level_scale(found->level));
      entry.root.source = MeasurementSource::root;
      entry.other = found->other;
      entry.second = second.id;
      made.push_back(std::move(entry));
    }
    candidates.swap(left);
  }
  map->write([&](Map& m) {
    for (Made& entry : made) {
      if (!m.keyframes.contains(keyframe) || !m.keyframes.contains(entry.second)) continue;
      const PointId id = m.points.insert(entry.point);
      entry.root.point = id;
      entry.other.point = id;
      m.add_measurement(keyframe, entry.root);
      m.add_measurement(entry.second, entry.other);
    }
    if (Keyframe* kf = m.keyframes.find(keyframe)) m.update_depth(kf);
  });
  return static_cast<int>(made.size());
}

}  // namespace parallax
