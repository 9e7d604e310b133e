// What the tracking thread does with a frame (PTAM §5): composes features, motion model, two-stage tracking, quality,
// recovery and keyframe proposals. Not thread-safe: one thread calls it; the map is read through snapshots, and the
// mapper is spoken to through its inbox.
#pragma once

#include <memory>
#include <vector>

#include "core/frame.h"
#include "map/schedule.h"
#include "tracker/frame_features.h"
#include "tracker/initialisation.h"
#include "tracker/motion_model.h"
#include "tracker/relocaliser.h"
#include "tracker/source_trust.h"
#include "tracker/tracker_options.h"
#include "tracker/tracking_types.h"
#include "tracker/two_stage.h"

namespace parallax {

class Tracker {
 public:
  // `map` and `mapper` outlive the tracker. With `automatic_initialisation` no key press is needed.
  Tracker(const CameraModel& camera, const TrackerOptions& options, bool automatic_initialisation, const SharedMap* map,
          MapperInbox* mapper);

  // The same, with what passes between the threads going through `schedule`, which outlives the tracker.
  Tracker(const CameraModel& camera, const TrackerOptions& options, bool automatic_initialisation,
          TrackerSchedule* schedule);
  Tracker(const Tracker&) = delete;
  Tracker& operator=(const Tracker&) = delete;

  // Tracks one frame, of the camera's size. key_press: the user pressed the initialisation key at this frame.
  TrackingResult track(const Frame& frame, bool key_press = false);
  // The map that the last frame was tracked with; null before the first.
  const std::shared_ptr<const TrackingSnapshot>& map() const { return snapshot_; }

 private:
  Tracker(const CameraModel& camera, const TrackerOptions& options, bool automatic_initialisation,
          std::unique_ptr<TrackerSchedule> own, TrackerSchedule* given);

  void follow_map_changes(const Frame& frame, const TrackingSnapshot& map);
  void track_map(const Frame& frame, const TrackingSnapshot& map, TrackingResult* out);
  void recover(const Frame& frame, const TrackingSnapshot& map, TrackingResult* out);
  void report(const TwoStageResult& result, const TrackingSnapshot& map, TrackingResult* out);
  void accept(const Frame& frame, const RigidTransform& pose, TrackingResult* out);
  void note_keyframe(const TwoStageResult& result, const TrackingSnapshot& map);
  bool wants_keyframe(const Frame& frame, const TrackingSnapshot& map, const TrackingResult& out);
  void propose_keyframe(const Frame& frame, const TrackingSnapshot& map, const TwoStageResult& result,
                        TrackingResult* out);
  void count_points(const TwoStageResult& result, const TrackingSnapshot& map);

  CameraModel camera_;
  TrackerOptions options_;
  std::unique_ptr<TrackerSchedule> own_schedule_;
  TrackerSchedule* schedule_;
  std::shared_ptr<const TrackingSnapshot> snapshot_;

  FrameFeatures features_;
  Initialisation initialisation_;
  MotionModel motion_;
  TwoStageTracker two_stage_;
  Relocaliser relocaliser_;

  std::shared_ptr<const FrameImages> images_, last_images_;
  TwoStageResult result_;
  SourceTrust trust_;
  bool tracking_ = false;    // there is a map and a pose on it, or there was one or is one to be found
  bool was_on_map_ = false;  // a frame has been tracked on this map
  int bad_frames_ = 0;       // in a row
  int last_keyframe_frame_ = -1000;
  int most_found_ = 0;      // points found in one frame, the most since the last keyframe
  double scene_depth_ = 1;  // median depth of what was tracked, metres
  std::uint64_t known_map_version_ = 0, known_world_version_ = 0;
  WorldStamp known_world_;
  KeyframeId seen_from_;               // the keyframe whose points were most of those found
  std::vector<PointCount> counts_;     // dense, by point index
  std::vector<std::int32_t> touched_;  // indices with something to report
};

}  // namespace parallax
