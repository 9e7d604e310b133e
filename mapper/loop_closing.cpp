#include "mapper/loop_closing.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "core/error.h"
#include "mapper/map_adjustment.h"
#include "mapper/map_maintenance.h"
#include "mapper/place_view.h"
#include "mapper/point_measurer.h"
#include "solver/similarity_graph.h"

namespace parallax {
namespace {

// Standard deviations of a step between two well-connected keyframes: of the translation in parts of the depth, of the
// rotation (radians) and of the logarithm of the scale. Only their ratios matter.
constexpr double kStepSigma = 0.01;
// Shared points that make a full step; fewer make a weaker one.
constexpr double kFullStep = 100;
// The loop itself is known from dozens of points with errors of a pixel: better than a step.
constexpr double kLoopWeight = 5;
// What joins parts of the map that share nothing, against what a step weighs.
constexpr double kLooseWeight = 0.05;
// Where a point of the other side is looked for, pixels of the level.
constexpr double kSearchRadius_px = 5;
// Median errors below this, in standard deviations, are nothing to worry about.
constexpr double kSmallError = 1;

struct GraphOfMap {
  SimilarityGraph graph;
  std::vector<KeyframeId> keyframes;  // of the nodes
};

Matrix7d information_of(double weight, double depth) {
  Vector7d root;
  root << Eigen::Vector3d::Constant(1 / depth), Eigen::Vector4d::Ones();
  return (weight * weight / (kStepSigma * kStepSigma)) * Matrix7d(root.cwiseAbs2().asDiagonal());
}

// Sets that are joined one by one.
class Parts {
 public:
  explicit Parts(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0); }
  int find(int i) {
    while (parent_[static_cast<std::size_t>(i)] != i) i = parent_[static_cast<std::size_t>(i)];
    return i;
  }
  // False when they were one already.
  bool join(int i, int k) {
    i = find(i);
    k = find(k);
    if (i == k) return false;
    parent_[static_cast<std::size_t>(std::max(i, k))] = std::min(i, k);
    return true;
  }

 private:
  std::vector<int> parent_;
};

GraphOfMap graph_of(const Map& map, const LoopCandidate& loop, const LoopClosingOptions& options) {
  GraphOfMap out;
  SimilarityGraph& graph = out.graph;
  std::vector<int> row(static_cast<std::size_t>(map.keyframes.capacity()), -1);
  for (const Keyframe& kf : map.keyframes) {
    row[static_cast<std::size_t>(kf.id.index)] = static_cast<int>(out.keyframes.size());
    out.keyframes.push_back(kf.id);
    graph.nodes.emplace_back(kf.camera_from_world);
    graph.fixed.push_back(kf.fixed || kf.id == loop.old_keyframe ? 1 : 0);
  }
  const auto add = [&](int a, int b, double weight) {
    const auto i = static_cast<std::size_t>(a), k = static_cast<std::size_t>(b);
    const double depth = std::max(1e-6, map.keyframes.at(out.keyframes[k]).mean_depth);
    graph.edges.push_back({a, b, graph.nodes[i] * graph.nodes[k].inverse(), information_of(weight, depth)});
  };
  struct Link {
    int shared, a, b;
  };
  std::vector<Link> links;
  for (const Keyframe& kf : map.keyframes) {
    const std::vector<int> shared = shared_points(map, kf.id);
    const int a = row[static_cast<std::size_t>(kf.id.index)];
    for (const Keyframe& other : map.keyframes) {
      const int n = shared[static_cast<std::size_t>(other.id.index)];
      if (other.id < kf.id && n > 0) links.push_back({n, a, row[static_cast<std::size_t>(other.id.index)]});
    }
  }
  std::stable_sort(links.begin(), links.end(), [](const Link& x, const Link& y) { return x.shared > y.shared; });
  Parts parts(out.keyframes.size());
  for (const Link& link : links) {
    const bool bridges = parts.join(link.a, link.b);
    if (bridges || link.shared >= options.edge_points)
      add(link.a, link.b, std::sqrt(std::min(1.0, link.shared / kFullStep)));
  }
  for (int i = 1; i < static_cast<int>(out.keyframes.size()); ++i)
    if (parts.join(i - 1, i)) add(i, i - 1, kLooseWeight);
  // What the newer side measures in its drifted world is there: the loop's step.
  const Keyframe &old_side = map.keyframes.at(loop.old_keyframe), &new_side = map.keyframes.at(loop.new_keyframe);
  const SimilarityTransform old_from_new = SimilarityTransform(old_side.camera_from_world) * loop.alignment.a_from_b *
                                           SimilarityTransform(new_side.camera_from_world).inverse();
  graph.edges.push_back({row[static_cast<std::size_t>(old_side.id.index)],
                         row[static_cast<std::size_t>(new_side.id.index)], old_from_new,
                         information_of(kLoopWeight, std::max(1e-6, new_side.mean_depth))});
  return out;
}

// Every keyframe with its surroundings.
void move_map(Map* map, const std::vector<KeyframeId>& keyframes, const std::vector<SimilarityTransform>& new_from_old,
              const WorldWarp& warp, const SimilarityTransform& world_from_first) {
  std::vector<const SimilarityTransform*> of(static_cast<std::size_t>(map->keyframes.capacity()), nullptr);
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    of[static_cast<std::size_t>(keyframes[i].index)] = &new_from_old[i];
    Keyframe& kf = map->keyframes.at(keyframes[i]);
    kf.camera_from_world = new_from_old[i].rebase(kf.camera_from_world);
    kf.camera_from_world.orthonormalise();
    kf.mean_depth *= new_from_old[i].s;
    kf.depth_sigma *= new_from_old[i].s;
  }
  for (MapPoint& p : map->points) {
    const SimilarityTransform& change = *of[static_cast<std::size_t>(p.source.index)];
    p.position = change * p.position;
    p.normal = (change.R * p.normal).normalized();
  }
  const SimilarityTransform first_from_world = world_from_first.inverse();
  const auto move_plane = [&](Plane* plane) {
    RigidTransform& frame = plane->world_from_plane;
    const SimilarityTransform change = world_from_first * warp.at(first_from_world * frame.t) * first_from_world;
    frame.R = change.R * frame.R;
    frame.t = change * frame.t;
    frame.orthonormalise();
    plane->extent_m *= change.s;
  };
  if (map->plane) move_plane(&*map->plane);
  for (Plane& plane : map->planes) move_plane(&plane);
}

// The point measured in a keyframe that does not measure it yet.
bool measure_in(Map* map, const CameraModel& camera, PointId id, KeyframeId keyframe) {
  const MapPoint& point = map->points.at(id);
  const Keyframe& kf = map->keyframes.at(keyframe);
  if (kf.find(id)) return false;
  const Keyframe& source = map->keyframes.at(point.source);
  if (point.normal.dot(kf.centre() - point.position) <= 0) return false;
  const auto predicted = predict_patch(camera, point, source.camera_from_world, kf.camera_from_world);
  if (!predicted) return false;
  const auto found =
      measure_point(point, *source.images, *predicted, *kf.images, kSearchRadius_px, MeasurementSource::refind);
  if (!found) return false;
  map->add_measurement(keyframe, *found);
  return true;
}

std::vector<PointId> points_of(const Map& map, const std::vector<KeyframeId>& keyframes) {
  std::vector<PointId> out;
  for (KeyframeId id : keyframes)
    for (const Measurement& m : map.keyframes.at(id).measurements) out.push_back(m.point);
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

// Pairs become one where the older point is found in the newer side's keyframes; then each side's points are looked for
// in the other's.
void join_sides(Map* map, const CameraModel& camera, const LoopCandidate& loop,
                const std::vector<KeyframeId>& old_window, const std::vector<KeyframeId>& new_window,
                LoopReport* report) {
  // Where they were looked for before was elsewhere.
  for (const auto* window : {&old_window, &new_window})
    for (PointId id : points_of(*map, *window)) {
      MapPoint& point = map->points.at(id);
      point.failed.clear();
      point.refined_everywhere = false;
    }
  for (const PointPair& pair : loop.alignment.pairs) {
    if (!map->points.contains(pair.a) || !map->points.contains(pair.b) || pair.a == pair.b) continue;
    const std::vector<KeyframeId> observers = map->points.at(pair.b).observers;
    int measured = 0;
    for (KeyframeId id : observers) measured += measure_in(map, camera, pair.a, id) ? 1 : 0;
    report->measurements_added += measured;
    if (measured == 0) continue;
    // What measured the other patch is off by how differently the two are centred.
    for (KeyframeId id : observers)
      if (!map->keyframes.at(id).find(pair.a)) map->remove_measurement(id, pair.b);
    map->merge_points(pair.a, pair.b);
    ++report->points_fused;
  }
  const std::vector<PointId> old_points = points_of(*map, old_window), new_points = points_of(*map, new_window);
  for (KeyframeId id : new_window)
    for (PointId point : old_points) report->measurements_added += measure_in(map, camera, point, id) ? 1 : 0;
  for (KeyframeId id : old_window)
    for (PointId point : new_points) report->measurements_added += measure_in(map, camera, point, id) ? 1 : 0;
}

// Points that are measured on both sides.
int joint_points(const Map& map, const std::vector<KeyframeId>& old_window, const std::vector<KeyframeId>& new_window) {
  const std::vector<PointId> a = points_of(map, old_window), b = points_of(map, new_window);
  std::vector<PointId> both;
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
  return static_cast<int>(both.size());
}

double median_of(std::vector<float>* errors) {
  if (errors->empty()) return 0;
  const auto middle = errors->begin() + static_cast<std::ptrdiff_t>(errors->size() / 2);
  std::nth_element(errors->begin(), middle, errors->end());
  return static_cast<double>(*middle);
}

struct MedianErrors {
  double all = 0;
  std::vector<double> keyframe;  // by index
};

MedianErrors median_errors(const Map& map, const CameraModel& camera) {
  constexpr float kBehind = 1e3F;
  MedianErrors out;
  out.keyframe.resize(static_cast<std::size_t>(map.keyframes.capacity()), 0);
  std::vector<float> all, errors;
  for (const Keyframe& kf : map.keyframes) {
    errors.clear();
    for (const Measurement& m : kf.measurements) {
      Eigen::Vector2d pixel;
      const bool seen = camera.project(kf.camera_from_world * map.points.at(m.point).position, &pixel);
      errors.push_back(seen ? static_cast<float>((pixel - m.pixel).norm()) / m.sigma_px : kBehind);
    }
    all.insert(all.end(), errors.begin(), errors.end());
    out.keyframe[static_cast<std::size_t>(kf.id.index)] = median_of(&errors);
  }
  out.all = median_of(&all);
  return out;
}

// Points that the graph left behind their source, or with measurements of points nobody else sees.
void drop_impossible(Map* map) {
  std::vector<PointId> doomed;
  for (const MapPoint& p : map->points)
    if (!((map->keyframes.at(p.source).camera_from_world * p.position).z() > 0)) doomed.push_back(p.id);
  for (PointId id : doomed) map->erase_point(id);
}

void require_closing_option(bool ok, const char* what) {
  if (!ok) throw InputError(std::string("loop closing: ") + what);
}

}  // namespace

void LoopClosingOptions::validate() const {
  require_closing_option(edge_points > 0, "edge_points must be positive");
  require_closing_option(window_keyframes > 0, "window_keyframes must be positive");
  require_closing_option(min_joint_points > 0, "min_joint_points must be positive");
  require_closing_option(max_error_growth > 0 && max_keyframe_error_growth > 0, "error growths must be positive");
  require_closing_option(max_scale_change > 1, "max_scale_change must be above 1");
}

LoopCorrection correct_loop(const Map& map, const SimilarityTransform& world_from_first, const CameraModel& camera,
                            const MapperOptions& mapper, const LoopCandidate& loop, const LoopClosingOptions& options) {
  options.validate();
  LoopCorrection out;
  LoopReport& report = out.report;
  if (!map.keyframes.contains(loop.old_keyframe) || !map.keyframes.contains(loop.new_keyframe)) {
    report.reason = "its keyframes are gone";
    return out;
  }
  const auto began = SteadyClock::now();
  const Keyframe& newest = map.keyframes.at(loop.new_keyframe);
  const Eigen::Vector3d ahead = newest.camera_from_world.inverse() * Eigen::Vector3d(0, 0, newest.mean_depth);
  report.drift_m = (loop.alignment.a_from_b * ahead - ahead).norm();
  report.drift_scale = 1 / loop.alignment.a_from_b.s;
  const MedianErrors before = median_errors(map, camera);
  report.error_before = before.all;

  GraphOfMap bent = graph_of(map, loop, options);
  report.keyframes = static_cast<int>(bent.keyframes.size());
  report.edges = static_cast<int>(bent.graph.edges.size());
  const std::vector<SimilarityTransform> nodes = bent.graph.nodes;
  const SimilarityGraphSummary solved = adjust_similarity_graph(&bent.graph, {}, {});
  if (solved.failed || !std::isfinite(solved.final_cost)) {
    report.reason = "the graph has no solution";
    return out;
  }
  std::vector<SimilarityTransform> new_from_old;
  std::vector<WarpNode> warp_nodes;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    new_from_old.push_back(bent.graph.fixed[i] ? SimilarityTransform() : bent.graph.nodes[i].inverse() * nodes[i]);
    const Keyframe& kf = map.keyframes.at(bent.keyframes[i]);
    warp_nodes.push_back(warp_node(kf.id, kf.camera_from_world, kf.mean_depth, new_from_old.back(), world_from_first));
    const double scale = new_from_old.back().s;
    if (!(scale < options.max_scale_change && scale > 1 / options.max_scale_change)) {
      report.reason = "its scales are too different";
      return out;
    }
  }
  out.warp = std::make_shared<const WorldWarp>(std::move(warp_nodes));
  report.graph_ms = milliseconds_since(began);

  const auto fusing = SteadyClock::now();
  const std::vector<KeyframeId> old_window = keyframes_around(map, loop.old_keyframe, options.window_keyframes - 1);
  const std::vector<KeyframeId> new_window = keyframes_around(map, loop.new_keyframe, options.window_keyframes - 1);
  Map corrected = map;
  move_map(&corrected, bent.keyframes, new_from_old, *out.warp, world_from_first);
  drop_impossible(&corrected);
  const double bent_error = median_errors(corrected, camera).all;
  join_sides(&corrected, camera, loop, old_window, new_window, &report);
  SharedMap work;
  work.replace_map(std::move(corrected));
  for (const auto* window : {&new_window, &old_window})
    for (KeyframeId id : *window) report.points_fused += merge_duplicates(&work, id);
  report.fuse_ms = milliseconds_since(fusing);

  const auto adjusting = SteadyClock::now();
  const AdjustmentReport adjusted = adjust_local(&work, camera, mapper, loop.new_keyframe, {});
  out.map = work.copy().map;
  report.joint_points = joint_points(out.map, old_window, new_window);
  const MedianErrors after = median_errors(out.map, camera);
  report.error_after = after.all;
  report.adjust_ms = milliseconds_since(adjusting);

  const auto grown = [](double now, double then, double by) { return now > std::max(then, kSmallError) + by; };
  if (!adjusted.ran || adjusted.solve.failed || !adjusted.suspicious.empty()) {
    report.reason = "the sides contradict each other where they meet";
  } else if (report.joint_points < options.min_joint_points) {
    report.reason = "the sides share only " + std::to_string(report.joint_points) + " points";
  } else if (grown(std::max(bent_error, after.all), before.all, options.max_error_growth)) {
    report.reason = "the map would have to bend too much";
  } else {
    for (const Keyframe& kf : out.map.keyframes) {
      const auto i = static_cast<std::size_t>(kf.id.index);
      if (grown(after.keyframe[i], before.keyframe[i], options.max_keyframe_error_growth))
        report.reason = "a keyframe would no longer fit";
    }
  }
  report.closed = report.reason.empty();
  if (!report.closed) out.map.clear();
  return out;
}

LoopReport close_loop(SharedMap* map, const CameraModel& camera, const MapperOptions& mapper, const LoopCandidate& loop,
                      const LoopClosingOptions& options) {
  const MapCopy copy = map->copy();
  LoopCorrection correction = correct_loop(copy.map, copy.world_from_first, camera, mapper, loop, options);
  if (!correction.report.closed) return correction.report;
  const auto committing = SteadyClock::now();
  map->warp_world(std::move(correction.map), correction.warp);
  map->publish();
  correction.report.commit_ms = milliseconds_since(committing);
  return correction.report;
}

}  // namespace parallax
