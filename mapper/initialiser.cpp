#include "mapper/initialiser.h"

#include <algorithm>
#include <optional>

#include "core/log.h"
#include "map/source_patch.h"
#include "mapper/map_adjustment.h"
#include "mapper/map_planes.h"
#include "mapper/point_creation.h"

namespace parallax {
namespace {

Keyframe make_keyframe(int frame, Timestamp time, const RigidTransform& pose, std::shared_ptr<const FrameImages> images,
                       double depth) {
  Keyframe kf;
  kf.frame = frame;
  kf.time = time;
  kf.camera_from_world = pose;
  kf.images = std::move(images);
  kf.mean_depth = depth;
  return kf;
}

}  // namespace

InitialisationReply initialise_map(SharedMap* map, const CameraModel& camera, const MapperOptions& options,
                                   const InitialisationRequest& request, std::mt19937_64* rng) {
  InitialisationReply reply;
  std::vector<TwoViewMatch> matches;
  for (const TrailMatch& m : request.matches) matches.push_back({m.first, m.second});
  TwoViewOptions two_view = options.two_view;
  if (request.automatic) two_view.min_parallax_deg = options.auto_min_parallax_deg;
  const TwoViewResult views = solve_two_view(camera, matches, two_view, rng);
  log::debug("two views ", request.first_frame, " and ", request.second_frame, ": ",
             std::count(views.inlier.begin(), views.inlier.end(), 1), " of ", matches.size(), " matches, parallax ",
             views.median_parallax_deg, " deg, score ", views.score, ", ", describe(views.status));
  if (views.status != TwoViewStatus::ok) {
    reply.reason = describe(views.status);
    return reply;
  }

  // Built aside; the shared map changes only when everything has worked.
  SharedMap fresh;
  const double scale = options.initial_baseline_m;
  std::vector<std::pair<int, PointId>> point_of_trail;
  KeyframeId first_id, second_id;
  fresh.write([&](Map& m) {
    std::vector<double> depths;
    for (std::size_t i = 0; i < matches.size(); ++i)
      if (views.inlier[i]) depths.push_back(views.points[i].z() * scale);
    std::nth_element(depths.begin(), depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2), depths.end());
    const double depth = depths[depths.size() / 2];
    RigidTransform second_pose = views.second_from_first;
    second_pose.t *= scale;
    Keyframe first = make_keyframe(request.first_frame, request.first_time, RigidTransform(), request.first, depth);
    first.fixed = true;
    first_id = m.keyframes.insert(std::move(first));
    second_id = m.keyframes.insert(
        make_keyframe(request.second_frame, request.second_time, second_pose, request.second, depth));
    for (std::size_t i = 0; i < matches.size(); ++i) {
      if (!views.inlier[i]) continue;
      MapPoint point;
      if (!set_source(&point, first_id, 0, matches[i].first, camera)) continue;
      point.position = views.points[i] * scale;
      point.normal = -point.source_rays.col(0).normalized();
      const PointId id = m.points.insert(point);
      m.add_measurement(first_id, {id, matches[i].first, 1.0f, 0, MeasurementSource::root});
      m.add_measurement(second_id, {id, matches[i].second, 1.0f, 0, MeasurementSource::trail});
      point_of_trail.emplace_back(request.matches[i].trail, id);
    }
  });
  // The noise of the matches decides how much parallax is enough, so its estimate has a low floor here.
  MapperOptions first_options = options;
  first_options.min_sigma = std::min(options.min_sigma, 0.05);
  AdjustmentReport adjusted = adjust_global(&fresh, camera, first_options, {});
  log::debug("first adjustment: sigma ", adjusted.solve.sigma, " px");
  if (!adjusted.ran || adjusted.solve.failed || adjusted.solve.sigma > options.initial_max_sigma_px) {
    reply.reason = "the two views do not agree well enough: press Space again and slide the camera smoothly sideways";
    return reply;
  }
  const double parallax_px = views.median_parallax_deg * M_PI / 180.0 * camera.mean_focal_px();
  if (request.automatic && parallax_px < options.auto_min_parallax_sigmas * adjusted.solve.sigma) {
    reply.reason = describe(TwoViewStatus::too_little_parallax);
    return reply;
  }
  fresh.write([&](Map& m) {
    for (Keyframe& kf : m.keyframes) m.update_depth(&kf);
  });
  int added = create_points(&fresh, camera, options, second_id);
  added += create_points(&fresh, camera, options, first_id);
  adjusted = adjust_global(&fresh, camera, options, {});
  const int points = fresh.read([](const Map& m) { return m.points.size(); });
  log::debug("first map: ", points, " points (", added, " by epipolar search), sigma ", adjusted.solve.sigma);
  if (adjusted.solve.failed || points < options.initial_min_points) {
    reply.reason = "too few points could be placed: choose a view with more texture and press Space again";
    return reply;
  }

  fresh.write([&](Map& m) {
    // Scale: the camera translated 10 cm between the stereo pair (PTAM §6.1).
    const double baseline = (m.keyframes.at(second_id).centre() - m.keyframes.at(first_id).centre()).norm();
    SimilarityTransform to_scale;
    to_scale.s = options.initial_baseline_m / baseline;
    m.transform_world(to_scale);
    if (const auto plane = dominant_plane_of(m, options.plane, rng)) {
      m.transform_world(SimilarityTransform(plane->world_from_plane.inverse()));
      set_dominant_plane(&m, *plane, RigidTransform());
    }
    for (Keyframe& kf : m.keyframes) m.update_depth(&kf);
  });
  Map made = fresh.read([](const Map& m) { return m; });
  reply.ok = true;
  reply.second_from_world = made.keyframes.at(second_id).camera_from_world;
  for (const auto& [trail, id] : point_of_trail)
    if (made.points.contains(id)) reply.point_of_trail.emplace_back(trail, id);
  map->replace_map(std::move(made));
  return reply;
}

}  // namespace parallax
