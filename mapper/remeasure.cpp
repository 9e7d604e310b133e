#include "mapper/remeasure.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "mapper/point_measurer.h"

namespace parallax {
namespace {

constexpr std::size_t kBlock = 200;
// Below this, in pixels of the level, a measurement has not moved.
constexpr double kMoved_px = 0.02;

struct View {
  KeyframeId id;
  RigidTransform camera_from_world;
  std::shared_ptr<const FrameImages> images;
  Measurement measurement;
};
struct Job {
  MapPoint point;
  RigidTransform source_pose;
  std::shared_ptr<const FrameImages> source;
  std::vector<View> views;
};
struct Finding {
  KeyframeId keyframe;
  Eigen::Vector2d before;
  Measurement measurement;
};

}  // namespace

int remeasure_points(SharedMap* map, const CameraModel& camera, const MapperOptions& options,
                     const std::vector<PointId>& points, const Interruption& stop) {
  int moved = 0;
  for (std::size_t begin = 0; begin < points.size() && !stop.requested(); begin += kBlock) {
    const std::size_t end = std::min(points.size(), begin + kBlock);
    const std::vector<Job> jobs = map->read([&](const Map& m) {
      std::vector<Job> out;
      for (std::size_t i = begin; i < end; ++i) {
        const MapPoint* p = m.points.find(points[i]);
        if (!p) continue;
        const Keyframe& source = m.keyframes.at(p->source);
        Job job{*p, source.camera_from_world, source.images, {}};
        for (KeyframeId id : p->observers) {
          if (id == p->source) continue;
          const Keyframe& kf = m.keyframes.at(id);
          job.views.push_back({id, kf.camera_from_world, kf.images, *kf.find(p->id)});
        }
        out.push_back(std::move(job));
      }
      return out;
    });
    std::vector<Finding> findings;
    for (const Job& job : jobs) {
      if (stop.requested()) break;
      for (const View& view : job.views) {
        auto predicted = predict_patch(camera, job.point, job.source_pose, view.camera_from_world);
        if (!predicted) continue;
        predicted->pixel = view.measurement.pixel;
        const auto m = measure_point(job.point, *job.source, *predicted, *view.images, options.second_chance_radius_px,
                                     view.measurement.source, options.other_light);
        if (m) findings.push_back({view.id, view.measurement.pixel, *m});
      }
    }
    moved += map->write([&](Map& m) {
      int n = 0;
      for (const Finding& f : findings) {
        Keyframe* kf = m.keyframes.find(f.keyframe);
        Measurement* now = kf ? kf->find(f.measurement.point) : nullptr;
        if (!now || now->pixel != f.before) continue;
        if ((f.measurement.pixel - f.before).norm() > kMoved_px * f.measurement.sigma_px) ++n;
        *now = f.measurement;
      }
      return n;
    });
  }
  return moved;
}

}  // namespace parallax
