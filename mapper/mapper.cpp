#include "mapper/mapper.h"

#include <cmath>
#include <utility>

#include "core/log.h"
#include "map/append_bounded.h"
#include "mapper/initialiser.h"
#include "mapper/keyframe_insertion.h"
#include "mapper/map_maintenance.h"
#include "mapper/map_planes.h"
#include "mapper/merge_commit.h"
#include "mapper/point_creation.h"
#include "mapper/remeasure.h"

namespace parallax {
namespace {

// Points looked at in one unit of data association refinement.
constexpr int kAssociationBatch = 200;
// Adjustments in a row that may each find new outliers or measurements before the mapper rests.
constexpr int kMaxGlobalRounds = 4;
// Keyframes at which the dominant plane is fitted again, doubling from the first to the last.
constexpr int kFirstPlaneRefinement = 6, kLastPlaneRefinement = 24;
// One change of scale.
constexpr double kMinScale = 1e-3, kMaxScale = 1e3;
// Times kept for the report.
constexpr std::size_t kTimesKept = 20000;
// Loops kept for the report.
constexpr std::size_t kLoopsKept = 20;

void keep_time(double milliseconds, std::vector<float>* times) {
  append_bounded(static_cast<float>(milliseconds), kTimesKept, times);
}

}  // namespace

Mapper::Mapper(const CameraModel& camera, const MapperOptions& options, SharedMap* map, MapperInbox* inbox)
    : Mapper(camera, options, map, std::make_unique<LiveMapperSchedule>(inbox), nullptr) {}

Mapper::Mapper(const CameraModel& camera, const MapperOptions& options, SharedMap* map, MapperSchedule* schedule)
    : Mapper(camera, options, map, nullptr, schedule) {}

Mapper::Mapper(const CameraModel& camera, const MapperOptions& options, SharedMap* map,
               std::unique_ptr<MapperSchedule> own, MapperSchedule* given)
    : camera_(camera),
      options_(options),
      map_(map),
      own_schedule_(std::move(own)),
      schedule_(own_schedule_ ? own_schedule_.get() : given),
      rng_(options.seed),
      plane_rng_(options.seed),
      association_(camera, options),
      normals_(camera) {
  options.validate();
  if (options.close_loops && options.vocabulary)
    loops_.emplace(options.vocabulary, camera, LoopDetectionOptions(), options.seed);
}

void Mapper::handle_initialisation(InitialisationRequest request) {
  InitialisationReply reply = initialise_map(map_, camera_, options_, request, &rng_);
  if (reply.ok) {
    association_.clear();
    normals_.clear();
    newest_ = map_->read([](const Map& m) {
      KeyframeId last;
      for (const Keyframe& kf : m.keyframes) last = kf.id;
      return last;
    });
    local_pending_ = false;
    global_pending_ = association_pending_ = upkeep_pending_ = true;
    global_rounds_ = 0;
    refine_plane_at_ = kFirstPlaneRefinement;
    adapts_ = true;
    map_->publish();
  }
  request.reply.set_value(std::move(reply));
}

void Mapper::handle_keyframe(const KeyframeProposal& proposal) {
  const auto start = SteadyClock::now();
  const auto id = insert_keyframe(map_, camera_, options_, proposal);
  if (!id) {
    ++statistics_.keyframes_refused;
    return;
  }
  const int made = create_points(map_, camera_, options_, *id);
  map_->publish();
  newest_ = *id;
  ++statistics_.keyframes_inserted;
  statistics_.points_made += made;
  keep_time(milliseconds_since(start), &statistics_.insertion_ms);
  log::debug("keyframe ", id->index, " (frame ", proposal.frame, "): ", made, " new points");
  local_pending_ = global_pending_ = association_pending_ = upkeep_pending_ = true;
  global_rounds_ = 0;
  if (loops_) {
    loops_->add(*id);
    loops_pending_ = true;
  }
}

void Mapper::handle(MapperMessage message) {
  if (!adapts_ && handle_unadapted(&message)) return;
  if (auto* keyframe = std::get_if<KeyframeProposal>(&message)) {
    handle_keyframe(*keyframe);
  } else if (auto* counts = std::get_if<PointCounts>(&message)) {
    if (counts->map_version != map_->snapshot()->map_version) return;
    const int erased = apply_counts(map_, options_, *counts);
    statistics_.points_erased += erased;
    if (erased > 0) map_->publish();
  } else if (auto* request = std::get_if<InitialisationRequest>(&message)) {
    handle_initialisation(std::move(*request));
  } else if (auto* forget = std::get_if<ResetRequest>(&message)) {
    reset();
    forget->done.set_value();
  } else if (auto* scaling = std::get_if<ScaleRequest>(&message)) {
    scaling->reply.set_value(scale(scaling->factor));
  } else if (auto* plane = std::get_if<PlaneRequest>(&message)) {
    const MapEditReply reply =
        plane->seed ? add_plane(map_, options_, *plane->seed, &plane_rng_) : detect_plane(map_, options_, &plane_rng_);
    if (reply.ok) {
      refine_plane_at_ = 0;
      map_->publish();
    }
    plane->reply.set_value(reply);
  } else if (auto* load = std::get_if<LoadMapRequest>(&message)) {
    auto reply = std::move(load->reply);
    reply.set_value(load_map(std::move(*load)));
  } else if (auto* merge = std::get_if<MergeMapRequest>(&message)) {
    auto reply = std::move(merge->reply);
    reply.set_value(take_merged(std::move(*merge)));
  } else if (const auto* adapt = std::get_if<AdaptRequest>(&message)) {
    adapts_ = adapt->adapt;
    if (!adapts_) loops_pending_ = false;
    if (!adapts_) local_pending_ = global_pending_ = association_pending_ = upkeep_pending_ = false;
  }
}

// Of a map that stays as it is: what would change it is answered here.
bool Mapper::handle_unadapted(MapperMessage* message) {
  if (auto* scaling = std::get_if<ScaleRequest>(message)) {
    scaling->reply.set_value({false, "this map is locked"});
  } else if (auto* plane = std::get_if<PlaneRequest>(message)) {
    plane->reply.set_value({false, "this map is locked"});
  } else if (auto* merge = std::get_if<MergeMapRequest>(message)) {
    MergeMapReply refused;
    refused.reason = "this map is locked";
    merge->reply.set_value(std::move(refused));
  } else if (std::holds_alternative<KeyframeProposal>(*message)) {
    ++statistics_.keyframes_refused;
  } else if (!std::holds_alternative<PointCounts>(*message)) {
    return false;
  }
  return true;
}

LoadMapReply Mapper::load_map(LoadMapRequest request) {
  if (map_->snapshot()->map_version != request.instead_of) return {false, "the map has changed meanwhile", 0};
  reset_work();
  for (const Keyframe& kf : request.map.keyframes) newest_ = kf.id;
  adapts_ = request.adapt;
  age_counts(&request.map);
  map_->replace_map(std::move(request.map));
  map_->publish();
  return {true, "", map_->snapshot()->map_version};
}

MergeMapReply Mapper::take_merged(MergeMapRequest request) {
  MergeMapReply reply;
  const MapCopy present = map_->copy();
  if (present.map_version != request.map_version || present.world_version != request.world_version) {
    reply.reason = "the map has changed meanwhile";
    return reply;
  }
  MergeCommit commit = rebase_merged(present.map, present.world_from_first, camera_, *request.base, request.merged);
  if (!commit.reason.empty()) {
    reply.reason = std::move(commit.reason);
    return reply;
  }
  map_->warp_world(std::move(commit.map), commit.warp);
  map_->publish();
  ++statistics_.maps_merged;
  log::debug("maps merged: ", commit.keyframes_taken_along, " keyframes and ", commit.points_taken_along,
             " points have come meanwhile");
  association_.clear();
  newest_ = commit.newest;
  local_pending_ = commit.keyframes_taken_along > 0;
  global_pending_ = association_pending_ = upkeep_pending_ = true;
  global_rounds_ = 0;
  const auto snapshot = map_->snapshot();
  reply.ok = true;
  reply.world_version = snapshot->world_version;
  reply.world = snapshot->world();
  reply.keyframe_shift = commit.keyframe_shift;
  return reply;
}

void Mapper::reset() {
  map_->replace_map({});
  map_->publish();
  reset_work();
}

// Another map: nothing that was to be done to the one before is.
void Mapper::reset_work() {
  association_.clear();
  normals_.clear();
  loops_pending_ = false;
  local_pending_ = global_pending_ = association_pending_ = upkeep_pending_ = false;
  refine_plane_at_ = 0;
  adapts_ = true;
}

MapEditReply Mapper::scale(double factor) {
  if (!std::isfinite(factor) || factor < kMinScale || factor > kMaxScale) {
    return {false, "the scale factor must lie between 0.001 and 1000"};
  }
  if (map_->snapshot()->empty()) return {false, "there is no map yet"};
  SimilarityTransform change;
  change.s = factor;
  map_->move_world(change);
  map_->publish();
  return {true, ""};
}

void Mapper::after_adjustment(const AdjustmentReport& report) {
  if (!report.ran) return;
  association_.add_outliers(report.outliers);
  statistics_.points_erased += report.points_erased;
  if (report.solve.stopped) ++statistics_.adjustments_interrupted;
  if (!report.suspicious.empty()) {
    statistics_.keyframes_rejected += static_cast<int>(report.suspicious.size());
    remove_keyframes(map_, camera_, report.suspicious);
  }
  if (!report.outliers.empty()) association_pending_ = true;
  map_->publish();
}

bool Mapper::work() {
  if (!local_pending_ && !loops_pending_ && !global_pending_ && !association_pending_ && !upkeep_pending_) return false;
  const Interruption interrupt = schedule_->interruption();
  work_until(interrupt);
  schedule_->worked(interrupt);
  return true;
}

void Mapper::work_until(const Interruption& interrupt) {
  if (local_pending_) {
    const AdjustmentReport report = adjust_local(map_, camera_, options_, newest_, interrupt);
    local_pending_ = report.solve.stopped;
    ++statistics_.local_adjustments;
    keep_time(report.milliseconds, &statistics_.local_ms);
    after_adjustment(report);
    return;
  }
  if (loops_pending_) {
    look_for_loop();
    return;
  }
  if (global_pending_) {
    const AdjustmentReport report = adjust_global(map_, camera_, options_, interrupt);
    global_pending_ =
        report.solve.stopped || (report.ran && !report.solve.converged && ++global_rounds_ < kMaxGlobalRounds);
    ++statistics_.global_adjustments;
    unadjusted_measurements_ = 0;
    keep_time(report.milliseconds, &statistics_.global_ms);
    after_adjustment(report);
    return;
  }
  if (association_pending_) {
    bool idle = false;
    const int added = association_.refine(map_, kAssociationBatch, interrupt, &idle);
    statistics_.measurements_added += added;
    unadjusted_measurements_ += added;
    association_pending_ = !idle;
    if (idle && unadjusted_measurements_ > 0 && ++global_rounds_ < kMaxGlobalRounds) global_pending_ = true;
    return;
  }
  if (upkeep_pending_) {
    upkeep_pending_ = false;
    const int merged = merge_duplicates(map_, newest_);
    statistics_.points_merged += merged;
    if (merged > 0) association_pending_ = true;
    const std::vector<PointId> turned =
        options_.estimate_normals ? normals_.estimate(map_, interrupt) : std::vector<PointId>();
    // What was measured with the old warp is measured again; that takes one more adjustment, and no more than one a
    // keyframe.
    const int repeated = options_.remeasure ? remeasure_points(map_, camera_, options_, turned, interrupt) : 0;
    statistics_.normals_changed += static_cast<int>(turned.size());
    statistics_.measurements_repeated += repeated;
    if (repeated > 0) global_pending_ = true;
    refine_plane();
    statistics_.keyframes_culled += retire_keyframes(map_, camera_, options_, newest_);
    if (cull_redundant_keyframe(map_, camera_, options_, newest_)) ++statistics_.keyframes_culled;
    map_->publish();
    log::debug("upkeep: ", merged, " merged, ", turned.size(), " normals, ", repeated, " measured again");
    return;
  }
}

void Mapper::look_for_loop() {
  bool idle = false;
  const std::optional<LoopCandidate> loop = loops_->step(*map_, &idle);
  loops_pending_ = !idle;
  statistics_.loops = loops_->statistics();
  if (!loop) return;
  const LoopReport report = close_loop(map_, camera_, options_, *loop, LoopClosingOptions());
  append_bounded(report, kLoopsKept, &statistics_.loop_reports);
  const std::string where =
      std::to_string(loop->old_keyframe.index) + " and " + std::to_string(loop->new_keyframe.index);
  if (!report.closed) {
    ++statistics_.loops_refused;
    log::debug("loop between keyframes ", where, " refused: ", report.reason);
    return;
  }
  ++statistics_.loops_closed;
  statistics_.points_merged += report.points_fused;
  log::debug("loop between keyframes ", where, " closed: ", report.joint_points, " points on both sides, ",
             1e3 * report.drift_m, " mm and a scale of ", report.drift_scale, " off");
  association_.clear();
  global_pending_ = association_pending_ = upkeep_pending_ = true;
  global_rounds_ = 0;
}

// The first views know little of heights: while the map is young the dominant plane settles with it.
void Mapper::refine_plane() {
  if (refine_plane_at_ == 0 || map_->snapshot()->keyframes.size() < static_cast<std::size_t>(refine_plane_at_)) return;
  refine_dominant_plane(map_, options_, &plane_rng_);
  refine_plane_at_ = refine_plane_at_ < kLastPlaneRefinement ? 2 * refine_plane_at_ : 0;
}

bool Mapper::step() {
  if (auto message = schedule_->try_pop()) {
    handle(std::move(*message));
    return true;
  }
  return work();
}

void Mapper::run(std::stop_token stop) {
  std::stop_callback wake(stop, [this] { schedule_->interrupt(); });
  while (!stop.stop_requested()) {
    if (step()) continue;
    if (auto message = schedule_->pop(stop)) handle(std::move(*message));
  }
}

}  // namespace parallax
