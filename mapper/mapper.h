// What the mapping thread does (PTAM §6, Fig. 2), one unit of work a call, the most urgent first: messages, a new
// keyframe, local adjustment, loops, global adjustment, data association refinement. Not thread-safe: one thread calls
// it; it is the map's only structural writer. Run it in a loop of its own, or step by step between frames (lockstep).
#pragma once

#include <memory>
#include <optional>
#include <random>
#include <stop_token>
#include <string>
#include <vector>

#include "map/schedule.h"
#include "mapper/data_association.h"
#include "mapper/loop_closing.h"
#include "mapper/loop_detection.h"
#include "mapper/map_adjustment.h"
#include "mapper/mapper_options.h"
#include "mapper/normal_estimation.h"

namespace parallax {

// What it has done so far; read it when the mapper is at rest.
struct MapperStatistics {
  int keyframes_inserted = 0, keyframes_refused = 0, keyframes_culled = 0, keyframes_rejected = 0;
  int points_made = 0, points_erased = 0, points_merged = 0, measurements_added = 0;
  int normals_changed = 0, measurements_repeated = 0;
  int local_adjustments = 0, global_adjustments = 0, adjustments_interrupted = 0;
  std::vector<float> insertion_ms, local_ms, global_ms;  // the newest 20,000 at least
  LoopDetectionStatistics loops;                         // found: those that geometry agreed to
  int loops_closed = 0, loops_refused = 0;
  std::vector<LoopReport> loop_reports;  // the newest 20 at least
  int maps_merged = 0;
};

class Mapper {
 public:
  // `map` and `inbox` outlive the mapper.
  Mapper(const CameraModel& camera, const MapperOptions& options, SharedMap* map, MapperInbox* inbox);

  // The same, with messages and interruptions going through `schedule`, which outlives the mapper.
  Mapper(const CameraModel& camera, const MapperOptions& options, SharedMap* map, MapperSchedule* schedule);
  Mapper(const Mapper&) = delete;
  Mapper& operator=(const Mapper&) = delete;

  // Does one unit of work; false when there was nothing to do.
  bool step();

  // Waits for messages and works until stopped.
  void run(std::stop_token stop);

  const MapperStatistics& statistics() const { return statistics_; }

 private:
  Mapper(const CameraModel& camera, const MapperOptions& options, SharedMap* map, std::unique_ptr<MapperSchedule> own,
         MapperSchedule* given);

  void handle(MapperMessage message);
  void handle_keyframe(const KeyframeProposal& proposal);
  void handle_initialisation(InitialisationRequest request);
  void after_adjustment(const AdjustmentReport& report);
  bool work();
  void work_until(const Interruption& interrupt);
  void reset();
  void refine_plane();
  void look_for_loop();
  void reset_work();
  bool handle_unadapted(MapperMessage* message);
  LoadMapReply load_map(LoadMapRequest request);
  MergeMapReply take_merged(MergeMapRequest request);
  MapEditReply scale(double factor);

  CameraModel camera_;
  MapperOptions options_;
  SharedMap* map_;
  std::unique_ptr<MapperSchedule> own_schedule_;
  MapperSchedule* schedule_;
  std::mt19937_64 rng_, plane_rng_;
  DataAssociation association_;
  NormalEstimation normals_;
  std::optional<LoopDetection> loops_;  // nothing when they are turned off
  MapperStatistics statistics_;

  KeyframeId newest_;
  bool adapts_ = true;  // false: a map that stays as it is was loaded
  bool loops_pending_ = false;
  bool local_pending_ = false, global_pending_ = false, association_pending_ = false, upkeep_pending_ = false;
  int global_rounds_ = 0;
  int refine_plane_at_ = 0;          // keyframes; 0: no more, the user has chosen or it is known well
  int unadjusted_measurements_ = 0;  // added by data association since the last global adjustment
};

}  // namespace parallax
