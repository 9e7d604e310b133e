#include "mapper/keyframe_insertion.h"

#include <algorithm>
#include <unordered_set>

#include "mapper/point_measurer.h"

namespace parallax {
namespace {

// The keyframe that measures the most of what the frame measured.
KeyframeId most_in_common(SharedMap* map, const KeyframeProposal& proposal) {
  return map->read([&](const Map& m) {
    std::vector<int> count(static_cast<std::size_t>(m.keyframes.capacity()), 0);
    for (const Measurement& x : proposal.measurements)
      if (const MapPoint* p = m.points.find(x.point))
        for (KeyframeId id : p->observers) ++count[static_cast<std::size_t>(id.index)];
    KeyframeId best;
    for (const Keyframe& kf : m.keyframes)
      if (!best.valid() || count[static_cast<std::size_t>(kf.id.index)] > count[static_cast<std::size_t>(best.index)])
        best = kf.id;
    return best;
  });
}

}  // namespace

std::optional<KeyframeId> insert_keyframe(SharedMap* map, const CameraModel& camera, const MapperOptions& options,
                                          const KeyframeProposal& proposal) {
  const auto snapshot = map->snapshot();
  if (snapshot->empty() || snapshot->map_version != proposal.map_version) return std::nullopt;
  // The world may have moved since the frame was tracked, and not everywhere alike.
  RigidTransform pose = proposal.camera_from_world;
  if (snapshot->world_version != proposal.world_version)
    pose = snapshot->world().rebase(proposal.world, pose, most_in_common(map, proposal));

  // What is needed of the points, copied; searched outside the lock.
  struct Job {
    MapPoint point;
    RigidTransform source_pose;
    std::shared_ptr<const FrameImages> source;
  };
  std::unordered_set<int> measured;
  for (const Measurement& m : proposal.measurements) measured.insert(m.point.index);
  const std::vector<Job> jobs = map->read([&](const Map& m) {
    std::vector<Job> out;
    const Eigen::Vector3d centre = pose.inverse().t;
    for (const MapPoint& p : m.points) {
      if (measured.contains(p.id.index)) continue;
      const Eigen::Vector3d in_camera = pose * p.position;
      if (!(in_camera.z() > 0) ||
          in_camera.head<2>().squaredNorm() > camera.max_radius_squared() * in_camera.z() * in_camera.z())
        continue;
      if (p.normal.dot(centre - p.position) <= 0) continue;
      const Keyframe& source = m.keyframes.at(p.source);
      out.push_back({p, source.camera_from_world, source.images});
    }
    return out;
  });
  std::vector<Measurement> found;
  std::vector<PointId> missed;
  for (const Job& job : jobs) {
    const auto predicted = predict_patch(camera, job.point, job.source_pose, pose);
    if (!predicted) continue;
    const auto m = measure_point(job.point, *job.source, *predicted, *proposal.images, options.refind_radius_px,
                                 MeasurementSource::refind);
    if (m) {
      found.push_back(*m);
    } else {
      missed.push_back(job.point.id);
    }
  }

  return map->write([&](Map& m) -> std::optional<KeyframeId> {
    const auto known = std::count_if(proposal.measurements.begin(), proposal.measurements.end(),
                                     [&](const Measurement& x) { return m.points.contains(x.point); });
    if (known < options.min_keyframe_measurements) return std::nullopt;
    Keyframe kf;
    kf.frame = proposal.frame;
    kf.time = proposal.time;
    kf.camera_from_world = pose;
    kf.images = proposal.images;
    const KeyframeId id = m.keyframes.insert(std::move(kf));
    for (const Measurement& x : proposal.measurements)
      if (m.points.contains(x.point)) m.add_measurement(id, x);
    for (const Measurement& x : found)
      if (m.points.contains(x.point)) m.add_measurement(id, x);
    for (PointId p : missed)
      if (m.points.contains(p)) m.mark_failed(id, p);
    m.update_depth(&m.keyframes.at(id));
    return id;
  });
}

}  // namespace parallax
