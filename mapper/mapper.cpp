#include "mapper/mapper.h"

#include "core/log.h"
#include "mapper/initialiser.h"
#include "mapper/keyframe_insertion.h"
#include "mapper/map_maintenance.h"
#include "mapper/point_creation.h"
#include "mapper/remeasure.h"

namespace parallax {
namespace {

// Points looked at in one unit of data association refinement.
constexpr int kAssociationBatch = 200;
// Adjustments in a row that may each find new outliers or measurements before the mapper rests.
constexpr int kMaxGlobalRounds = 4;

}  // namespace

Mapper::Mapper(const CameraModel& camera, const MapperOptions& options, SharedMap* map, MapperInbox* inbox)
    : camera_(camera),
      options_(options),
      map_(map),
      inbox_(inbox),
      rng_(options.seed),
      association_(camera, options),
      normals_(camera) {
  options.validate();
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
  statistics_.insertion_ms.push_back(static_cast<float>(milliseconds_since(start)));
  log::debug("keyframe ", id->index, " (frame ", proposal.frame, "): ", made, " new points");
  local_pending_ = global_pending_ = association_pending_ = upkeep_pending_ = true;
  global_rounds_ = 0;
}

void Mapper::handle(MapperMessage message) {
  if (auto* keyframe = std::get_if<KeyframeProposal>(&message)) {
    handle_keyframe(*keyframe);
  } else if (auto* counts = std::get_if<PointCounts>(&message)) {
    if (counts->map_version != map_->snapshot()->map_version) return;
    const int erased = apply_counts(map_, options_, *counts);
    statistics_.points_erased += erased;
    if (erased > 0) map_->publish();
  } else if (auto* request = std::get_if<InitialisationRequest>(&message)) {
    handle_initialisation(std::move(*request));
  } else if (auto* reset = std::get_if<ResetRequest>(&message)) {
    map_->write([](Map& m) { m.clear(); });
    map_->note_new_map();
    map_->publish();
    association_.clear();
    normals_.clear();
    local_pending_ = global_pending_ = association_pending_ = upkeep_pending_ = false;
    reset->done.set_value();
  }
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
  if (local_pending_) {
    const AdjustmentReport report = adjust_local(map_, camera_, options_, newest_, inbox_->interrupt_token());
    local_pending_ = report.solve.stopped;
    ++statistics_.local_adjustments;
    statistics_.local_ms.push_back(static_cast<float>(report.milliseconds));
    after_adjustment(report);
    return true;
  }
  if (global_pending_) {
    const AdjustmentReport report = adjust_global(map_, camera_, options_, inbox_->interrupt_token());
    global_pending_ =
        report.solve.stopped || (report.ran && !report.solve.converged && ++global_rounds_ < kMaxGlobalRounds);
    ++statistics_.global_adjustments;
    unadjusted_measurements_ = 0;
    statistics_.global_ms.push_back(static_cast<float>(report.milliseconds));
    after_adjustment(report);
    return true;
  }
  if (association_pending_) {
    bool idle = false;
    const int added = association_.refine(map_, kAssociationBatch, inbox_->interrupt_token(), &idle);
    statistics_.measurements_added += added;
    unadjusted_measurements_ += added;
    association_pending_ = !idle;
    if (idle && unadjusted_measurements_ > 0 && ++global_rounds_ < kMaxGlobalRounds) global_pending_ = true;
    return true;
  }
  if (upkeep_pending_) {
    upkeep_pending_ = false;
    const int merged = merge_duplicates(map_, camera_, options_, newest_);
    statistics_.points_merged += merged;
    if (merged > 0) association_pending_ = true;
    const std::stop_token interrupt = inbox_->interrupt_token();
    const std::vector<PointId> turned =
        options_.estimate_normals ? normals_.estimate(map_, interrupt) : std::vector<PointId>();
    // What was measured with the old warp is measured again; that takes one more adjustment, and no more than one a
    // keyframe.
    const int repeated = options_.remeasure ? remeasure_points(map_, camera_, options_, turned, interrupt) : 0;
    statistics_.normals_changed += static_cast<int>(turned.size());
    statistics_.measurements_repeated += repeated;
    if (repeated > 0) global_pending_ = true;
    if (cull_redundant_keyframe(map_, camera_, options_, newest_)) ++statistics_.keyframes_culled;
    map_->publish();
    log::debug("upkeep: ", merged, " merged, ", turned.size(), " normals, ", repeated, " measured again");
    return true;
  }
  return false;
}

bool Mapper::step() {
  if (auto message = inbox_->try_pop()) {
    handle(std::move(*message));
    return true;
  }
  return work();
}

void Mapper::run(std::stop_token stop) {
  std::stop_callback wake(stop, [this] { inbox_->interrupt(); });
  while (!stop.stop_requested()) {
    if (step()) continue;
    if (auto message = inbox_->pop(stop)) handle(std::move(*message));
  }
}

}  // namespace parallax
