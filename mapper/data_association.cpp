#include "mapper/data_association.h"

#include <algorithm>
#include <optional>

#include "mapper/point_measurer.h"

namespace parallax {
namespace {

struct Target {
  KeyframeId id;
  RigidTransform pose;
  std::shared_ptr<const FrameImages> images;
};
struct Job {
  MapPoint point;
  RigidTransform source_pose;
  std::shared_ptr<const FrameImages> source;
  std::vector<Target> targets;
};
struct Finding {
  KeyframeId keyframe;
  PointId point;
  std::optional<Measurement> measurement;
};

Job job_for(const Map& map, const MapPoint& point) {
  const Keyframe& source = map.keyframes.at(point.source);
  return {point, source.camera_from_world, source.images, {}};
}

int commit(SharedMap* map, const std::vector<Finding>& findings) {
  return map->write([&](Map& m) {
    int added = 0;
    for (const Finding& f : findings) {
      if (!m.points.contains(f.point) || !m.keyframes.contains(f.keyframe)) continue;
      if (m.keyframes.at(f.keyframe).find(f.point)) continue;
      if (f.measurement) {
        m.add_measurement(f.keyframe, *f.measurement);
        ++added;
      } else {
        m.mark_failed(f.keyframe, f.point);
      }
    }
    return added;
  });
}

}  // namespace

void DataAssociation::add_outliers(const std::vector<std::pair<KeyframeId, PointId>>& outliers) {
  for (const auto& pair : outliers)
    if (given_.insert(pair).second) second_chances_.push_back(pair);
}

int DataAssociation::refine_new_points(SharedMap* map, int max_points, const Interruption& stop, bool* idle) {
  const std::vector<Job> jobs = map->read([&](const Map& m) {
    std::vector<Job> out;
    for (const MapPoint& p : m.points) {
      if (p.refined_everywhere) continue;
      if (static_cast<int>(out.size()) >= max_points) break;
      Job job = job_for(m, p);
      for (const Keyframe& kf : m.keyframes) {
        if (std::binary_search(p.observers.begin(), p.observers.end(), kf.id) ||
            std::binary_search(p.failed.begin(), p.failed.end(), kf.id))
          continue;
        const Eigen::Vector3d in_camera = kf.camera_from_world * p.position;
        if (!(in_camera.z() > 0) ||
            in_camera.head<2>().squaredNorm() > camera_.max_radius_squared() * in_camera.z() * in_camera.z())
          continue;
        job.targets.push_back({kf.id, kf.camera_from_world, kf.images});
      }
      out.push_back(std::move(job));
    }
    return out;
  });
  *idle = jobs.empty();
  std::vector<Finding> findings;
  std::vector<PointId> done;
  for (const Job& job : jobs) {
    if (stop.requested()) break;
    for (const Target& target : job.targets) {
      const auto predicted = predict_patch(camera_, job.point, job.source_pose, target.pose);
      std::optional<Measurement> m;
      if (predicted)
        m = measure_point(job.point, *job.source, *predicted, *target.images, options_.refind_radius_px,
                          MeasurementSource::refind, options_.other_light);
      if (predicted || m) findings.push_back({target.id, job.point.id, m});
    }
    done.push_back(job.point.id);
  }
  const int added = commit(map, findings);
  map->write([&](Map& m) {
    for (PointId id : done)
      if (MapPoint* p = m.points.find(id)) p->refined_everywhere = true;
  });
  return added;
}

int DataAssociation::give_second_chances(SharedMap* map, const Interruption& stop) {
  std::vector<Finding> findings;
  while (!second_chances_.empty() && !stop.requested()) {
    const auto [keyframe, point] = second_chances_.front();
    second_chances_.pop_front();
    const std::optional<Job> job =
        map->read([&, keyframe = keyframe, point = point](const Map& m) -> std::optional<Job> {
          const MapPoint* p = m.points.find(point);
          const Keyframe* kf = m.keyframes.find(keyframe);
          if (!p || !kf || kf->find(point) || std::binary_search(p->failed.begin(), p->failed.end(), keyframe))
            return std::nullopt;
          Job out = job_for(m, *p);
          out.targets.push_back({kf->id, kf->camera_from_world, kf->images});
          return out;
        });
    if (!job) continue;
    const Target& target = job->targets.front();
    const auto predicted = predict_patch(camera_, job->point, job->source_pose, target.pose);
    std::optional<Measurement> m;
    if (predicted)
      m = measure_point(job->point, *job->source, *predicted, *target.images, options_.second_chance_radius_px,
                        MeasurementSource::second_chance, options_.other_light);
    findings.push_back({keyframe, point, m});
  }
  return commit(map, findings);
}

// Identifiers are not given out twice, so that a pair of what is gone never comes again.
void DataAssociation::forget_absent(const SharedMap& map) {
  map.read([this](const Map& m) {
    std::erase_if(
        given_, [&](const auto& pair) { return !m.keyframes.contains(pair.first) || !m.points.contains(pair.second); });
  });
  forget_above_ = std::max(forget_above_, 2 * given_.size());
}

int DataAssociation::refine(SharedMap* map, int max_points, const Interruption& stop, bool* idle) {
  if (given_.size() > forget_above_) forget_absent(*map);
  int added = give_second_chances(map, stop);
  added += refine_new_points(map, max_points, stop, idle);
  return added;
}

}  // namespace parallax
