#include "tracker/tracker.h"

#include <algorithm>
#include <cmath>
#include <ctime>

#include "core/check.h"
#include "tracker/tracking_quality.h"

namespace parallax {
namespace {

// Counts are sent to the mapper at this interval at the latest.
constexpr int kCountInterval_frames = 10;

double thread_cpu_ms() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) * 1e3 + static_cast<double>(t.tv_nsec) * 1e-6;
}

}  // namespace

Tracker::Tracker(const CameraModel& camera, const TrackerOptions& options, bool automatic_initialisation,
                 const SharedMap* map, MapperInbox* mapper)
    : Tracker(camera, options, automatic_initialisation, std::make_unique<LiveTrackerSchedule>(map, mapper), nullptr) {}

Tracker::Tracker(const CameraModel& camera, const TrackerOptions& options, bool automatic_initialisation,
                 TrackerSchedule* schedule)
    : Tracker(camera, options, automatic_initialisation, nullptr, schedule) {}

Tracker::Tracker(const CameraModel& camera, const TrackerOptions& options, bool automatic_initialisation,
                 std::unique_ptr<TrackerSchedule> own, TrackerSchedule* given)
    : camera_(camera),
      options_(options),
      own_schedule_(std::move(own)),
      schedule_(own_schedule_ ? own_schedule_.get() : given),
      features_(camera.width(), camera.height(), options),
      initialisation_(camera, options, automatic_initialisation, schedule_),
      motion_(camera, options.motion),
      two_stage_(camera, options),
      relocaliser_(camera, options) {
  options.validate();
}

TrackingResult Tracker::track(const Frame& frame, bool key_press) {
  PARALLAX_CHECK(frame.grey.cols == camera_.width() && frame.grey.rows == camera_.height(),
                 "frame is not of the camera's size");
  const auto start = SteadyClock::now();
  const double cpu_start = thread_cpu_ms();
  TrackingResult out;
  out.frame = frame.index;
  out.time = frame.time;

  const auto snapshot = snapshot_ = schedule_->snapshot();
  last_images_ = images_;
  images_ = features_.compute(frame.grey);
  out.times.features = static_cast<float>(milliseconds_since(start));

  follow_map_changes(frame, *snapshot);
  out.map_points = snapshot->size();
  out.map_keyframes = static_cast<int>(snapshot->keyframes.size());
  out.map_version = snapshot->map_version;
  out.world_from_first = snapshot->world_from_first;
  out.warps = snapshot->warps.size();

  if (!tracking_) {
    const auto before = SteadyClock::now();
    const Initialisation::Step step = initialisation_.step(frame, images_, key_press, *snapshot,
                                                           [this](const auto& images) { features_.give_away(images); });
    out.state = step.state;
    out.message = step.message;
    out.times.recovery = static_cast<float>(milliseconds_since(before));
    if (step.first_pose) {
      tracking_ = true;
      bad_frames_ = 0;
      last_keyframe_frame_ = frame.index;
      two_stage_.clear_cache();
      motion_.reset(*step.first_pose, frame.time);
      scene_depth_ = snapshot->keyframes.back().mean_depth;
      last_images_ = nullptr;  // the pose is this frame's own: nothing to predict from
    } else {
      out.trails = initialisation_.trails_for_drawing();
    }
  }
  if (tracking_) {
    if (bad_frames_ > options_.lost_after_frames) {
      recover(frame, *snapshot, &out);
    } else {
      track_map(frame, *snapshot, &out);
    }
  }
  out.seen_from = seen_from_;
  out.times.total = static_cast<float>(milliseconds_since(start));
  out.times.cpu = static_cast<float>(thread_cpu_ms() - cpu_start);
  return out;
}

void Tracker::follow_map_changes(const Frame& frame, const TrackingSnapshot& map) {
  if (map.map_version != known_map_version_) {
    // Another map: whatever was known of the old one is void.
    known_map_version_ = map.map_version;
    known_world_version_ = map.world_version;
    known_world_ = map.stamp();
    seen_from_ = KeyframeId();
    counts_.clear();
    touched_.clear();
    trust_.clear();
    two_stage_.clear_cache();
    relocaliser_.clear();
    if (map.empty()) initialisation_.reset();  // the user's reset drops the trails too
    was_on_map_ = false;
    if (tracking_) {
      tracking_ = false;
      initialisation_.reset();
      motion_.reset();
    }
    if (!map.empty() && !initialisation_.expects_map()) {
      // A map that was made before: the camera is somewhere on it, or nowhere.
      initialisation_.reset();
      tracking_ = true;
      bad_frames_ = options_.lost_after_frames + 1;
      motion_.reset(map.keyframes.back().camera_from_world, frame.time);
      scene_depth_ = map.keyframes.back().mean_depth;
      relocaliser_.reset();
    }
    return;
  }
  if (map.world_version != known_world_version_) {
    // A closed loop moves the neighbourhood of each keyframe in its own way.
    const SimilarityTransform change = map.world().now_from(known_world_, motion_.pose().inverse().t, seen_from_);
    motion_.rebase(change);
    scene_depth_ *= change.s;
    known_world_version_ = map.world_version;
    known_world_ = map.stamp();
  }
}

void Tracker::track_map(const Frame& frame, const TrackingSnapshot& map, TrackingResult* out) {
  const SmallBlurryImage* last = last_images_ ? &last_images_->small : nullptr;
  motion_.set_scene_depth(scene_depth_);
  const RigidTransform predicted = last_images_ ? motion_.predict(frame.time, last, &images_->small) : motion_.pose();
  TwoStageRequest request;
  request.prior = predicted;
  request.coarse_radius_px = options_.coarse_radius_px;
  request.fine_radius_px = options_.fine_radius_px;
  request.out_of_place = &trust_.out_of_place(map);
  request.turn = frame.index;
  request.coarse = bad_frames_ > 0 || !motion_.is_nearly_still(scene_depth_, options_.coarse_skip_below_px);
  two_stage_.track(map, *images_, request, &result_);
  TrackingQuality quality = assess_quality(result_, options_);
  if (quality == TrackingQuality::lost && !request.coarse) {
    // The camera was thought still and is not: once more with the coarse stage.
    const TrackingTimes spent = result_.times;
    request.coarse = true;
    two_stage_.track(map, *images_, request, &result_);
    result_.times.projection += spent.projection;
    result_.times.search += spent.search;
    result_.times.pose += spent.pose;
    quality = assess_quality(result_, options_);
  }
  report(result_, map, out);
  out->quality = quality;
  if (quality == TrackingQuality::lost) {
    ++bad_frames_;
    motion_.update_untracked(predicted, frame.time);
    out->state = bad_frames_ > options_.lost_after_frames ? TrackingState::lost : TrackingState::tracking;
    if (bad_frames_ > options_.lost_after_frames) relocaliser_.reset();
    return;
  }
  accept(frame, result_.camera_from_world, out);
  trust_.update(result_, map);
  note_keyframe(result_, map);
  count_points(result_, map);
  most_found_ = std::max(most_found_, out->total_found());
  if (quality == TrackingQuality::good && wants_keyframe(frame, map, *out)) propose_keyframe(frame, map, result_, out);
}

void Tracker::recover(const Frame& frame, const TrackingSnapshot& map, TrackingResult* out) {
  const auto before = SteadyClock::now();
  const bool found = relocaliser_.recover(map, *images_, motion_.pose(), &two_stage_, &result_);
  out->times.recovery = static_cast<float>(milliseconds_since(before));
  out->state = TrackingState::lost;
  if (!found) {
    out->message = was_on_map_ ? "lost: move the camera back to where it has been"
                               : "looking for the place: show the camera something that is on the saved map";
    return;
  }
  report(result_, map, out);
  out->relocalised = true;
  // The velocity from before the loss means nothing now.
  motion_.reset(result_.camera_from_world, frame.time);
  out->quality = TrackingQuality::poor;
  accept(frame, result_.camera_from_world, out);
  trust_.clear();  // wherever the camera is now, it was recognised by what is in place
  note_keyframe(result_, map);
  last_keyframe_frame_ = frame.index;
}

void Tracker::accept(const Frame& frame, const RigidTransform& pose, TrackingResult* out) {
  bad_frames_ = 0;
  was_on_map_ = true;
  motion_.update(pose, frame.time);
  out->camera_from_world = pose;
  out->state = TrackingState::tracking;
}

void Tracker::report(const TwoStageResult& result, const TrackingSnapshot& map, TrackingResult* out) {
  out->attempted = result.attempted;
  out->found = result.found;
  out->sigma = result.sigma;
  out->coarse_stage = result.coarse_used;
  out->times.projection = result.times.projection;
  out->times.search = result.times.search;
  out->times.pose = result.times.pose;
  std::vector<float> depths;
  for (const MatchedPoint& m : result.matches) {
    out->points.push_back({m.pixel.cast<float>(), m.level, m.weight > 0});
    if (m.weight > 0) depths.push_back(static_cast<float>((result.camera_from_world * map.position[m.row]).z()));
  }
  for (const Candidate& c : result.missed) out->points.push_back({c.pixel.cast<float>(), c.level, false});
  if (!depths.empty()) {
    std::nth_element(depths.begin(), depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2), depths.end());
    scene_depth_ = depths[depths.size() / 2];
  }
}

void Tracker::note_keyframe(const TwoStageResult& result, const TrackingSnapshot& map) {
  std::vector<int> found(map.keyframes.size(), 0);
  for (const MatchedPoint& m : result.matches)
    if (m.weight > 0) ++found[static_cast<std::size_t>(map.source[static_cast<std::size_t>(m.row)])];
  const auto most = std::max_element(found.begin(), found.end());
  if (most != found.end()) seen_from_ = map.keyframes[static_cast<std::size_t>(most - found.begin())].id;
}

bool Tracker::wants_keyframe(const Frame& frame, const TrackingSnapshot& map, const TrackingResult& out) {
  const bool young = static_cast<int>(map.keyframes.size()) < options_.young_keyframes;
  const int found = out.total_found();
  const bool leaving = found < options_.leaving_points || found < options_.leaving_part * most_found_;
  const int interval = leaving ? options_.leaving_interval_frames
                       : young ? options_.young_interval_frames
                               : options_.keyframe_interval_frames;
  if (frame.index - last_keyframe_frame_ < interval) return false;
  const RigidTransform world_from_camera = out.camera_from_world->inverse();
  // Nearest keyframe in position, turning counted as if it moved the view at the scene's depth.
  double nearest = std::numeric_limits<double>::infinity();
  const std::vector<std::uint8_t>& out_of_place = trust_.out_of_place(map);
  for (std::size_t row = 0; row < map.keyframes.size(); ++row) {
    if (out_of_place[row]) continue;  // near only as the map has it
    const SnapshotKeyframe& kf = map.keyframes[row];
    const double distance = (kf.centre - world_from_camera.t).norm() / scene_depth_;
    const double angle = (kf.camera_from_world * world_from_camera).angle();
    nearest = std::min(nearest, distance + options_.keyframe_distance_over_depth * angle / options_.keyframe_angle_rad);
  }
  constexpr double kLeavingDistance = 0.5;  // of the usual distance
  return nearest > options_.keyframe_distance_over_depth * (leaving ? kLeavingDistance : 1.0);
}

void Tracker::propose_keyframe(const Frame& frame, const TrackingSnapshot& map, const TwoStageResult& result,
                               TrackingResult* out) {
  KeyframeProposal proposal;
  proposal.frame = frame.index;
  proposal.time = frame.time;
  proposal.camera_from_world = result.camera_from_world;
  proposal.world_version = map.world_version;
  proposal.map_version = map.map_version;
  proposal.world = map.stamp();
  proposal.images = images_;
  for (const MatchedPoint& m : result.matches) {
    if (m.weight <= 0) continue;
    proposal.measurements.push_back(
        {map.id[m.row], m.pixel, static_cast<float>(m.sigma_px), m.level, MeasurementSource::tracker});
  }
  features_.give_away(images_);
  MapperMessage message = std::move(proposal);
  if (!schedule_->try_push(message)) return;  // the mapper is busy: a later frame will do
  last_keyframe_frame_ = frame.index;
  most_found_ = 0;
  out->keyframe_proposed = true;
}

void Tracker::count_points(const TwoStageResult& result, const TrackingSnapshot& map) {
  const auto entry = [&](std::int32_t row) -> PointCount& {
    const PointId id = map.id[row];
    const auto index = static_cast<std::size_t>(id.index);
    if (index >= counts_.size()) counts_.resize(std::max(index + 1, 2 * counts_.size()));
    PointCount& count = counts_[index];
    if (count.searched == 0) touched_.push_back(id.index);
    count.point = id;
    ++count.searched;
    return count;
  };
  for (const Candidate& c : result.missed) entry(c.row);
  for (const MatchedPoint& m : result.matches) {
    PointCount& count = entry(m.row);
    ++count.found;
    if (m.weight <= 0) ++count.outliers;
  }
  for (const ProbedPoint& p : result.probed) {
    PointCount& count = entry(p.row);
    if (p.found) ++count.found;
    if (p.found && !p.agrees) ++count.outliers;
  }
  bool due = false;
  for (std::int32_t index : touched_) due = due || counts_[index].searched >= kCountInterval_frames;
  if (!due) return;
  PointCounts message;
  message.map_version = map.map_version;
  for (std::int32_t index : touched_) message.counts.push_back(counts_[index]);
  MapperMessage boxed = std::move(message);
  if (!schedule_->try_push(boxed)) return;  // goes on counting
  for (std::int32_t index : touched_) counts_[index] = PointCount();
  touched_.clear();
}

}  // namespace parallax
