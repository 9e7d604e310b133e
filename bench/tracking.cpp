// The tracking thread on maps of 1000 to 50,000 points (PTAM §7.1, Table 1): each stage, wall and processor time. One
// core.
//
//   bench_tracking [SOURCE] [passes] [points...]
//
// SOURCE is synthetic:desk by default. The program itself, in lockstep, makes a map of the first half of the sequence.
// The map is then thinned to the first size and grown to the others by salient points of its keyframes and of further
// frames, whose depth and slope are the scene's own, measured in every keyframe that sees them. At each size the
// tracker follows the second half of the sequence to its end and back, `passes` times; frames that became keyframes are
// not counted. Wall times are, for each frame, the best over the passes: other work on the machine does not count.
// Processor time of the thread is counted for every pass.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <numeric>
#include <random>
#include <set>
#include <string>

#include "map/shared_map.h"
#include "map/source_patch.h"
#include "mapper/mapper.h"
#include "mapper/salient_points.h"
#include "render/synthetic_source.h"
#include "tracker/tracker.h"

using namespace parallax;

namespace {

constexpr std::size_t kInboxCapacity = 32;

// A point and where it is measured; its identifier is given when it enters the map.
struct PooledPoint {
  MapPoint point;
  std::vector<std::pair<KeyframeId, Measurement>> measurements;
};

struct View {
  int frame = 0;
  RigidTransform world_from_camera;
  cv::Mat1f depth;  // of the map's scale
};

class Bench {
 public:
  Bench(const std::string& name, int frames)
      : source_(open_synthetic_source(name + (name.find('?') == std::string::npos ? "?" : "&") +
                                      "frames=" + std::to_string(frames))),
        camera_(*source_->calibration()),
        inbox_(kInboxCapacity),
        mapper_(camera_, MapperOptions{}, &map_, &inbox_),
        tracker_(camera_, TrackerOptions{}, true, &map_, &inbox_),
        projector_(camera_, TrackerOptions{}.min_view_cosine, 1 << 30) {}

  // Lockstep over the sequence's first half; false when there is no map then.
  bool make_map() {
    const int frames = source_->frame_count();
    for (int i = 0; i < frames; ++i) images_.push_back(source_->frame(i).grey);
    bool tracked = false;
    for (next_ = 0; next_ < frames / 2; ++next_) {
      tracked = track(next_).camera_from_world.has_value();
      while (mapper_.step()) {
      }
    }
    if (!tracked) return false;
    align_with_truth();
    return true;
  }

  // Every point of the map, in an order of its own, then salient points of keyframes and further frames.
  void make_pool(int wanted) {
    std::mt19937 random(1);
    map_.read([&](const Map& map) {
      for (const MapPoint& p : map.points) {
        PooledPoint pooled{p, {}};
        for (KeyframeId kf : p.observers) pooled.measurements.emplace_back(kf, *map.keyframes.at(kf).find(p.id));
        pool_.push_back(std::move(pooled));
      }
    });
    mapped_ = static_cast<int>(pool_.size());
    std::shuffle(pool_.begin(), pool_.end(), random);
    std::vector<KeyframeId> keyframes;
    map_.read([&](const Map& map) {
      for (const Keyframe& kf : map.keyframes) keyframes.push_back(kf.id);
    });
    for (KeyframeId id : keyframes)
      views_[id] = view_of(map_.read([&](const Map& m) { return m.keyframes.at(id).frame; }), id);
    for (KeyframeId id : keyframes) add_salient(id);
    // Frames between the keyframes, halving the gaps, become keyframes too as long as points are wanted.
    const int half = source_->frame_count() / 2;
    for (int step = half / 4; step > 2 && static_cast<int>(pool_.size()) < wanted; step /= 2)
      for (int frame = step; frame < source_->frame_count() && static_cast<int>(pool_.size()) < wanted; frame += step) {
        if (used_.count(frame)) continue;
        add_salient(add_keyframe(frame));
      }
    std::shuffle(pool_.begin() + mapped_, pool_.end(), random);
  }

  int pooled() const { return static_cast<int>(pool_.size()); }
  int mapped() const { return mapped_; }
  int keyframes() const {
    return map_.read([](const Map& m) { return m.keyframes.size(); });
  }
  const CameraModel& camera() const { return camera_; }

  void set_points(int count) {
    map_.write([&](Map& map) {
      map.points.clear();
      for (Keyframe& kf : map.keyframes) kf.measurements.clear();
      for (int i = 0; i < count; ++i) {
        MapPoint point = pool_[static_cast<std::size_t>(i)].point;
        point.observers.clear();
        point.failed.clear();
        const PointId id = map.points.insert(point);
        for (const auto& [keyframe, measurement] : pool_[static_cast<std::size_t>(i)].measurements) {
          Measurement m = measurement;
          m.point = id;
          map.add_measurement(keyframe, m);
        }
      }
    });
    map_.publish();
  }

  struct Row {
    int points = 0, frames = 0, lost = 0;
    double in_view = 0, searched = 0, found = 0;
    std::vector<float> features, projection, search, pose, total, cpu;
  };

  Row measure(int passes) {
    const int first = source_->frame_count() / 2, last = source_->frame_count() - 1;
    Row row;
    row.points = map_.snapshot()->size();
    std::map<std::pair<int, int>, TrackingTimes> best;  // by frame and direction
    for (int pass = -1; pass < passes; ++pass) {        // the first warms the template cache up
      for (int direction : {1, -1}) {
        for (int k = first; k <= last; ++k) {
          const int frame = direction > 0 ? k : first + last - k;
          const TrackingResult r = track(frame);
          while (inbox_.try_pop()) {  // the map stays as it is
          }
          if (pass < 0 || used_.count(frame)) continue;
          if (!r.camera_from_world) {
            ++row.lost;
            continue;
          }
          ++row.frames;
          row.searched += r.total_attempted();
          row.found += r.total_found();
          row.cpu.push_back(r.times.cpu);
          projector_.project(*map_.snapshot(), *r.camera_from_world, &candidates_);
          row.in_view += static_cast<double>(candidates_.size());
          const auto [it, is_new] = best.try_emplace({frame, direction}, r.times);
          if (!is_new && r.times.total < it->second.total) it->second = r.times;
        }
      }
    }
    for (const auto& [key, t] : best) {
      row.features.push_back(t.features);
      row.projection.push_back(t.projection);
      row.search.push_back(t.search);
      row.pose.push_back(t.pose);
      row.total.push_back(t.total);
    }
    const double n = std::max(1, row.frames);
    row.in_view /= n;
    row.searched /= n;
    row.found /= n;
    return row;
  }

 private:
  TrackingResult track(int image) {
    Frame frame;
    frame.index = clock_;
    frame.time = from_seconds(1000 + clock_ / 30.0);
    ++clock_;
    frame.grey = images_[static_cast<std::size_t>(image)];
    return tracker_.track(frame);
  }

  // The similarity between the scene and the map, from the keyframes' centres.
  void align_with_truth() {
    map_.read([&](const Map& map) {
      Eigen::Matrix3Xd truth(3, map.keyframes.size()), mapped(3, map.keyframes.size());
      int i = 0;
      for (const Keyframe& kf : map.keyframes) {
        truth.col(i) = source_->world_from_camera(kf.frame).t;
        mapped.col(i++) = kf.centre();
        used_.insert(kf.frame);
      }
      align_points(truth, mapped, true, &map_from_truth_);
    });
  }

  View view_of(int frame, KeyframeId keyframe) {
    View view;
    view.frame = frame;
    view.world_from_camera =
        map_.read([&](const Map& m) { return m.keyframes.at(keyframe).camera_from_world.inverse(); });
    view.depth = source_->depth(frame) * map_from_truth_.s;
    return view;
  }

  KeyframeId add_keyframe(int frame) {
    used_.insert(frame);
    FrameFeatures features(camera_.width(), camera_.height(), TrackerOptions{});
    std::shared_ptr<const FrameImages> images;
    for (int k = 0; k < 15; ++k)
      images = features.compute(images_[static_cast<std::size_t>(frame)]);  // thresholds settle
    Keyframe kf;
    kf.frame = frame;
    kf.time = source_->time(frame);
    kf.images = images;
    kf.camera_from_world = map_from_truth_.rebase(source_->world_from_camera(frame).inverse());
    const KeyframeId id = map_.write([&](Map& map) {
      const Keyframe& near = *map.keyframes.begin();
      kf.mean_depth = near.mean_depth;
      kf.depth_sigma = near.depth_sigma;
      return map.keyframes.insert(kf);
    });
    views_[id] = view_of(frame, id);
    return id;
  }

  // The scene's point under a pixel of the view, and the normal there; false at an edge of something.
  bool scene_point(const View& view, const Eigen::Vector2d& pixel, Eigen::Vector3d* position,
                   Eigen::Vector3d* normal) const {
    constexpr int kReach = 3;
    const int x = static_cast<int>(std::lround(pixel.x())), y = static_cast<int>(std::lround(pixel.y()));
    if (x < kReach || y < kReach || x >= view.depth.cols - kReach || y >= view.depth.rows - kReach) return false;
    const auto at = [&](double px, double py, Eigen::Vector3d* p) {
      const float z = view.depth(static_cast<int>(std::lround(py)), static_cast<int>(std::lround(px)));
      Eigen::Vector3d ray;
      if (!(z > 0) || !camera_.unproject({px, py}, &ray)) return false;
      *p = view.world_from_camera * (ray * static_cast<double>(z));
      return true;
    };
    Eigen::Vector3d centre, left, right, up, down;
    if (!at(x, y, &centre) || !at(x - kReach, y, &left) || !at(x + kReach, y, &right) || !at(x, y - kReach, &up) ||
        !at(x, y + kReach, &down))
      return false;
    *normal = (down - up).cross(right - left).normalized();
    const Eigen::Vector3d towards = (view.world_from_camera.t - centre).normalized();
    if (normal->dot(towards) < 0) *normal = -*normal;
    // The centre off the plane of its neighbours: a step in depth.
    const double span = (right - left).norm() + (down - up).norm();
    if (normal->dot(towards) < 0.25 || std::abs((0.25 * (left + right + up + down) - centre).norm()) > 0.1 * span)
      return false;
    // Where the ray of the pixel itself meets the plane.
    Eigen::Vector3d ray;
    if (!camera_.unproject(pixel, &ray)) return false;
    ray = view.world_from_camera.R * ray;
    *position = view.world_from_camera.t + ray * (normal->dot(centre - view.world_from_camera.t) / normal->dot(ray));
    return true;
  }

  void add_salient(KeyframeId id) {
    const View& view = views_.at(id);
    const std::shared_ptr<const FrameImages> images =
        map_.read([&](const Map& m) { return m.keyframes.at(id).images; });
    MapperOptions options;
    options.min_spacing_px = 2.5;
    for (int level = 0; level < kPyramidLevels; ++level) {
      options.min_shi_tomasi[level] = 20;
      options.max_new_points[level] = 4000;
    }
    // What is in the pool already is not taken twice.
    for (const SalientPoint& salient : find_salient_points(*images, measured_[id], options)) {
      PooledPoint pooled;
      const Eigen::Vector2d pixel = level_to_level0(salient.pixel, salient.level);
      if (!scene_point(view, pixel, &pooled.point.position, &pooled.point.normal)) continue;
      if (!set_source(&pooled.point, id, salient.level, salient.pixel, camera_)) continue;
      for (const auto& [other_id, other] : views_) {
        const Eigen::Vector3d p = other.world_from_camera.inverse() * pooled.point.position;
        Measurement m;
        if (!camera_.project(p, &m.pixel) || !camera_.in_image(m.pixel, 8)) continue;
        const float seen =
            other.depth(static_cast<int>(std::lround(m.pixel.y())), static_cast<int>(std::lround(m.pixel.x())));
        if (std::abs(static_cast<double>(seen) - p.z()) > 0.02 * p.z()) continue;  // hidden
        m.level = static_cast<std::int8_t>(salient.level);
        m.sigma_px = static_cast<float>(level_scale(salient.level));
        m.source = other_id == id ? MeasurementSource::root : MeasurementSource::refind;
        pooled.measurements.emplace_back(other_id, m);
        measured_[other_id].push_back(m);
      }
      pool_.push_back(std::move(pooled));
    }
  }

  std::unique_ptr<SyntheticSource> source_;
  CameraModel camera_;
  std::vector<GreyImage> images_;
  SharedMap map_;
  MapperInbox inbox_;
  Mapper mapper_;
  Tracker tracker_;
  MapProjector projector_;
  std::vector<Candidate> candidates_;
  int next_ = 0, clock_ = 0, mapped_ = 0;
  SimilarityTransform map_from_truth_;
  std::set<int> used_;  // frames that are keyframes
  std::map<KeyframeId, View> views_;
  std::map<KeyframeId, std::vector<Measurement>> measured_;
  std::vector<PooledPoint> pool_;
};

double part(std::vector<float> values, double p) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return static_cast<double>(values[static_cast<std::size_t>(p * static_cast<double>(values.size() - 1) + 0.5)]);
}

void print_stages(const Bench::Row& row) {
  std::printf("| stage | Parallax median ms | 99 %% | PTAM Table 1 (2007, Core 2 Duo 2.66 GHz) |\n|---|---|---|---|\n");
  const auto line = [](const char* stage, const std::vector<float>& v, const char* paper) {
    std::printf("| %s | %.2f | %.2f | %s |\n", stage, part(v, 0.5), part(v, 0.99), paper);
  };
  line("keyframe preparation (pyramid, corners, small image)", row.features, "2.2");
  line("feature projection and choice", row.projection, "3.5");
  line("patch search", row.search, "9.8");
  line("iterative pose update", row.pose, "3.7");
  line("total, wall", row.total, "19.2");
  line("total, processor time of the thread", row.cpu, "");
}

}  // namespace

int main(int argc, char** argv) {
  const std::string name = argc > 1 ? argv[1] : "synthetic:desk";
  const int passes = argc > 2 ? std::max(1, std::atoi(argv[2])) : 3;
  std::vector<int> sizes;
  for (int i = 3; i < argc; ++i) sizes.push_back(std::max(50, std::atoi(argv[i])));
  if (sizes.empty()) sizes = {1000, 1900, 4000, 8000, 12500, 23000, 50000};
  std::sort(sizes.begin(), sizes.end());

  Bench bench(name, 400);
  if (!bench.make_map()) {
    std::fprintf(stderr, "%s: there is no map after half of the sequence\n", name.c_str());
    return 1;
  }
  bench.make_pool(sizes.back());
  std::printf("Map of `%s`, %dx%d: %d points made by the mapper, grown to %d in %d keyframes.\n\n", name.c_str(),
              bench.camera().width(), bench.camera().height(), bench.mapped(), bench.pooled(), bench.keyframes());
  std::vector<Bench::Row> rows;
  for (int size : sizes) {
    if (size > bench.pooled()) {
      std::fprintf(stderr, "%s: found only %d points, expected %d\n", name.c_str(), bench.pooled(), size);
      break;
    }
    bench.set_points(size);
    rows.push_back(bench.measure(passes));
  }
  for (const Bench::Row& row : rows)
    if (row.points == 4000) print_stages(row);
  std::printf(
      "\n| points in map | in view | searched | found | features | projection | search | pose | total wall | (99 %%) | "
      "total "
      "cpu | (99 %%) | frames | lost |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const Bench::Row& r : rows)
    std::printf("| %d | %.0f | %.0f | %.0f | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f | %d | %d |\n",
                r.points, r.in_view, r.searched, r.found, part(r.features, 0.5), part(r.projection, 0.5),
                part(r.search, 0.5), part(r.pose, 0.5), part(r.total, 0.5), part(r.total, 0.99), part(r.cpu, 0.5),
                part(r.cpu, 0.99), r.frames, r.lost);
  return 0;
}
