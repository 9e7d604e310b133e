#include "mapper/map_merge.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <optional>
#include <set>
#include <sstream>
#include <utility>
#include <vector>

#include "core/error.h"
#include "mapper/data_association.h"
#include "mapper/map_adjustment.h"
#include "mapper/map_join.h"
#include "mapper/map_maintenance.h"
#include "mapper/remeasure.h"

namespace parallax {
namespace {

// The first adjustment draws the two maps together over errors of several pixels: its kernel is no narrower than this
// (standard deviations of a measurement). Then in so many rounds points are looked for and the map adjusted.
constexpr double kDrawTogetherSigma = 2.5;
constexpr int kDrawTogetherIterations = 20;
constexpr int kRounds = 2;
constexpr int kSettlingAdjustments = 3;
constexpr int kMergeBatch = 500;
// Content of both maps is one thing when it says the same within this part of the distance it is seen from.
constexpr double kOneThing = 0.02;

bool is_of_other(KeyframeId id, const Map& base) { return id.index >= base.keyframes.capacity(); }

struct Interrupted {};

// The map while it is put together; the steps of merge_maps() in their order.
class MapMerge {
 public:
  MapMerge(const MapDocument& base, const MapDocument& other, const CameraModel& camera, const MapMergeOptions& options,
           const Interruption& stop)
      : base_(base), other_(other), camera_(camera), options_(options), stop_(stop) {
    options_.mapper.other_light = true;
  }

  std::optional<std::string> refused_at_once() const;
  std::optional<std::string> refused_for_scale(const SimilarityTransform& base_from_other) const;
  void join(const CommonPlace& place, MapMergeResult* out);
  void adjust(MapMergeResult* out);
  int common_points() const;
  std::optional<std::string> refused_when_adjusted(const MapMergeResult& out) const;
  void bound(MapMergeResult* out);
  void write(MapMergeResult* out);

 private:
  void ask() const {
    if (stop_.requested()) throw Interrupted();
  }
  int look_for_points();
  void solve(const MapperOptions& options);
  void count_common(MapMergeResult* out) const;
  void join_content(MapMergeResult* out) const;
  Map copy() const {
    return shared_.read([](const Map& m) { return m; });
  }

  const MapDocument& base_;
  const MapDocument& other_;
  CameraModel camera_;
  MapMergeOptions options_;
  const Interruption& stop_;

  JoinedMaps joined_;  // its map goes to shared_
  SimilarityTransform placed_;
  SharedMap shared_;
  std::optional<DataAssociation> association_;
  SurfaceMotion motion_of_base_, motion_of_other_;
  std::set<std::pair<KeyframeId, PointId>> cross_before_;  // measurements across that come from fused pairs
};

std::optional<std::string> MapMerge::refused_at_once() const {
  if (base_.map.empty() || other_.map.empty()) return "one of the maps is empty";
  for (const MapDocument* document : {&base_, &other_}) {
    const ImagePyramid& images = document->map.keyframes.begin()->images->pyramid;
    if (images.width() != camera_.width() || images.height() != camera_.height())
      return "the maps were made with different lenses";
  }
  return std::nullopt;
}

std::optional<std::string> MapMerge::refused_for_scale(const SimilarityTransform& base_from_other) const {
  if (!base_.scale_is_known || !other_.scale_is_known) return std::nullopt;
  if (std::abs(std::log(base_from_other.s)) <= std::log(1 + options_.max_scale_error)) return std::nullopt;
  std::ostringstream line;
  line << std::setprecision(3) << "the scales that were set disagree: a metre of the one is " << base_from_other.s
       << " m of the other";
  return line.str();
}

void MapMerge::join(const CommonPlace& place, MapMergeResult* out) {
  placed_ = place.a_from_b;
  joined_ = join_maps(base_.map, other_.map, placed_);
  out->points_fused = fuse_points(&joined_, place.pairs);
  for (const MapPoint& p : base_.map.points) motion_of_base_.add(p.id, p.position);
  for (const MapPoint& p : other_.map.points)
    motion_of_other_.add(joined_.point_of_b[static_cast<std::size_t>(p.id.index)], placed_ * p.position);
  for (const Keyframe& kf : joined_.map.keyframes)
    for (const Measurement& m : kf.measurements)
      if (is_of_other(kf.id, base_.map) == (m.point.index < base_.map.points.capacity()))
        cross_before_.emplace(kf.id, m.point);
  // Everything may be seen from new keyframes.
  for (MapPoint& p : joined_.map.points) p.refined_everywhere = false;
  shared_.replace_map(std::move(joined_.map));
  shared_.publish();
  association_.emplace(camera_, options_.mapper);
}

void MapMerge::solve(const MapperOptions& options) {
  for (int k = 0; k < kSettlingAdjustments; ++k) {
    ask();
    const AdjustmentReport report = adjust_global(&shared_, camera_, options, stop_);
    association_->add_outliers(report.outliers);
    if (!report.ran || report.solve.converged) break;
  }
}

int MapMerge::look_for_points() {
  int added = 0;
  for (bool idle = false; !idle;) {
    ask();
    added += association_->refine(&shared_, kMergeBatch, stop_, &idle);
  }
  return added;
}

void MapMerge::adjust(MapMergeResult* out) {
  MapperOptions wide = options_.mapper;
  wide.min_sigma = kDrawTogetherSigma;
  wide.global_iterations = kDrawTogetherIterations;
  solve(wide);
  // Fused points were measured by another patch, centred up to a pixel beside.
  std::set<PointId> fused;
  for (const auto& [keyframe, point] : cross_before_) fused.insert(point);
  remeasure_points(&shared_, camera_, options_.mapper, {fused.begin(), fused.end()}, stop_);
  for (int round = 0; round < kRounds; ++round) {
    solve(options_.mapper);
    out->measurements_added += look_for_points();
    if (round == 0) count_common(out);  // as found at the first look
    const auto keyframes = shared_.read([](const Map& m) {
      std::vector<KeyframeId> ids;
      for (const Keyframe& kf : m.keyframes) ids.push_back(kf.id);
      return ids;
    });
    for (KeyframeId id : keyframes) {
      ask();
      out->points_fused += merge_duplicates(&shared_, id);
    }
  }
  out->measurements_added += look_for_points();
  solve(options_.mapper);
}

// Of the points of either map that were looked for in keyframes of the other, those that were found.
void MapMerge::count_common(MapMergeResult* out) const {
  shared_.read([&](const Map& m) {
    int found = 0, missed = 0;
    for (const MapPoint& p : m.points) {
      const bool of_base = p.id.index < base_.map.points.capacity();
      for (KeyframeId id : p.observers)
        if (is_of_other(id, base_.map) == of_base && !cross_before_.contains({id, p.id})) ++found;
      for (KeyframeId id : p.failed)
        if (is_of_other(id, base_.map) == of_base) ++missed;
    }
    out->found_part = found + missed > 0 ? static_cast<double>(found) / (found + missed) : 0;
  });
}

// Measured from keyframes of both.
int MapMerge::common_points() const {
  const auto of_other = [&](KeyframeId id) { return is_of_other(id, base_.map); };
  return shared_.read([&](const Map& m) {
    int out = 0;
    for (const MapPoint& p : m.points) {
      const auto n = std::count_if(p.observers.begin(), p.observers.end(), of_other);
      if (n > 0 && n < static_cast<std::ptrdiff_t>(p.observers.size())) ++out;
    }
    return out;
  });
}

std::optional<std::string> MapMerge::refused_when_adjusted(const MapMergeResult& out) const {
  const int least = options_.min_common_points;
  if (out.common_points < least)
    return "too few common points: found " + std::to_string(out.common_points) + ", expected " + std::to_string(least);
  if (out.found_part < options_.min_found_part)
    return "the one map shows little of what the other says should be there: the place has changed, or is another";
  const double kept = shared_.read([&](const Map& m) {
    double now = 0, before = 0;
    for (const Keyframe& kf : other_.map.keyframes) {
      before += static_cast<double>(kf.measurements.size());
      const Keyframe* joined = m.keyframes.find(joined_.keyframe_of_b[static_cast<std::size_t>(kf.id.index)]);
      if (joined) now += static_cast<double>(std::min(joined->measurements.size(), kf.measurements.size()));
    }
    return now / std::max(1.0, before);
  });
  if (kept < options_.min_kept_part) return "the maps do not hold together: they contradict each other when adjusted";
  return std::nullopt;
}

void MapMerge::bound(MapMergeResult* out) {
  const int before = shared_.read([](const Map& m) { return m.keyframes.size(); });
  const KeyframeId newest = shared_.read([](const Map& m) {
    KeyframeId last;
    for (const Keyframe& kf : m.keyframes) last = kf.id;
    return last;
  });
  while (cull_redundant_keyframe(&shared_, camera_, options_.mapper, newest)) ask();
  out->keyframes_removed = before - shared_.read([](const Map& m) { return m.keyframes.size(); });
}

void MapMerge::join_content(MapMergeResult* out) const {
  const Map& map = out->document.map;
  int next = 1;
  for (const ContentItem& item : base_.content) {
    ContentItem moved = item;
    moved.world_from_item = motion_of_base_.at(map, item.position()) * item.world_from_item;
    next = std::max(next, item.id + 1);
    out->document.content.push_back(std::move(moved));
  }
  double distance = 0;
  for (const Keyframe& kf : map.keyframes) distance += kf.mean_depth / map.keyframes.size();
  const std::size_t of_base = out->document.content.size();
  for (const ContentItem& item : other_.content) {
    ContentItem moved = item;
    const SimilarityTransform in_base = placed_ * item.world_from_item;
    moved.world_from_item = motion_of_other_.at(map, in_base.t) * in_base;
    const auto begin = out->document.content.begin();
    const bool known = std::any_of(begin, begin + static_cast<std::ptrdiff_t>(of_base), [&](const ContentItem& there) {
      return there.kind == moved.kind && there.text == moved.text &&
             (there.position() - moved.position()).norm() < kOneThing * distance &&
             (there.line_end() - moved.line_end()).norm() < kOneThing * distance;
    });
    if (known) continue;
    moved.id = next++;
    if (other_.map.keyframes.contains(item.seen_from))
      moved.seen_from = joined_.keyframe_of_b[static_cast<std::size_t>(item.seen_from.index)];
    out->document.content.push_back(std::move(moved));
  }
}

void MapMerge::write(MapMergeResult* out) {
  MapDocument& document = out->document;
  document.map = copy();
  const auto follow = [&](const SurfaceMotion& motion, Plane* plane) {
    const SimilarityTransform moved = motion.at(document.map, plane->world_from_plane.t);
    plane->world_from_plane = RigidTransform(moved.R * plane->world_from_plane.R, moved * plane->world_from_plane.t);
    plane->extent_m *= moved.s;
  };
  const auto motion_of = [&](bool of_base) -> const SurfaceMotion& {
    return of_base ? motion_of_base_ : motion_of_other_;
  };
  if (document.map.plane) follow(motion_of(base_.map.plane.has_value()), &*document.map.plane);
  for (std::size_t i = 0; i < document.map.planes.size(); ++i)
    follow(motion_of(i < base_.map.planes.size()), &document.map.planes[i]);
  join_content(out);
  document.calibration = base_.calibration;
  document.name = base_.name.empty() ? other_.name : base_.name;
  document.scale_is_known = base_.scale_is_known || other_.scale_is_known;
  document.merged_from = base_.merged_from;
  document.merged_from.insert(document.merged_from.end(), other_.merged_from.begin(), other_.merged_from.end());
  document.games = base_.games;
  document.games.insert(other_.games.begin(), other_.games.end());

  // Where the other's world has come to lie, its points say.
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> from_to;
  for (const MapPoint& p : other_.map.points)
    if (const MapPoint* now = document.map.points.find(joined_.point_of_b[static_cast<std::size_t>(p.id.index)]))
      from_to.emplace_back(p.position, now->position);
  out->base_from_other = from_to.size() < 3 ? placed_ : fit_similarity(std::move(from_to));
  if (other_.scale_is_known && !base_.scale_is_known) {
    out->document_from_base.s = 1 / out->base_from_other.s;
    document.map.transform_world(out->document_from_base);
    for (ContentItem& item : document.content) item.world_from_item = out->document_from_base * item.world_from_item;
  }
  out->document_from_other = out->document_from_base * out->base_from_other;
}

void check_merge_option(bool ok, const char* what) {
  if (!ok) throw InputError(std::string("merging maps: ") + what);
}

}  // namespace

void MapMergeOptions::validate() const {
  place.validate();
  mapper.validate();
  check_merge_option(max_scale_error > 0, "max_scale_error must be positive");
  check_merge_option(min_common_points >= 0, "min_common_points must not be negative");
  check_merge_option(min_found_part >= 0 && min_found_part <= 1, "min_found_part must lie between 0 and 1");
  check_merge_option(min_kept_part >= 0 && min_kept_part <= 1, "min_kept_part must lie between 0 and 1");
}

MapMergeResult merge_maps(const MapDocument& base, const MapDocument& other, const CameraModel& camera,
                          std::shared_ptr<const Vocabulary> vocabulary, const MapMergeOptions& options,
                          const Interruption& stop) {
  options.validate();
  if (&base == &other) {  // two places in one object would be two sides of a loop
    const MapDocument copy = other;
    return merge_maps(base, copy, camera, std::move(vocabulary), options, stop);
  }
  MapMergeResult out;
  const auto refuse = [&](std::string reason) {
    MapMergeResult refused;
    refused.reason = std::move(reason);
    return refused;
  };
  MapMerge merge(base, other, camera, options, stop);
  if (auto reason = merge.refused_at_once()) return refuse(*reason);
  std::mt19937_64 rng(options.seed);
  const CommonPlace place =
      find_common_place(base.map, other.map, camera, std::move(vocabulary), options.place, &rng, stop);
  if (!place.found) return refuse(place.reason);
  if (auto reason = merge.refused_for_scale(place.a_from_b)) return refuse(*reason);
  out.alignments = place.alignments;
  try {
    merge.join(place, &out);
    merge.adjust(&out);
    out.common_points = merge.common_points();
    if (auto reason = merge.refused_when_adjusted(out)) return refuse(*reason);
    merge.bound(&out);
  } catch (const Interrupted&) {
    return refuse("interrupted");
  }
  merge.write(&out);
  const std::vector<std::string> problems = check_consistency(out.document.map, camera);
  if (!problems.empty()) return refuse("the merged map is not consistent: " + problems.front());
  out.merged = true;
  return out;
}

}  // namespace parallax
