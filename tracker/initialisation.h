// The tracking thread's side of initialisation (PTAM §6.1): trails from the first key press, a request to the mapper at
// the second, and the first pose on the new map. Without key presses it chooses both frames itself and keeps trying.
#pragma once

#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/frame.h"
#include "map/schedule.h"
#include "map/tracking_snapshot.h"
#include "tracker/tracker_options.h"
#include "tracker/tracking_types.h"

namespace parallax {

// Not thread-safe; belongs to the tracking thread.
class Initialisation {
 public:
  Initialisation(const CameraModel& camera, const TrackerOptions& options, bool automatic, TrackerSchedule* schedule);

  struct Step {
    TrackingState state = TrackingState::waiting;
    std::string message;
    std::optional<RigidTransform> first_pose;  // set when the map is there and this frame's pose on it is known
  };

  // One frame before there is a map. key_press: the user's. `give_away` is told of images that the mapper gets.
  // `map` is looked at once the mapper has said that it is there.
  Step step(const Frame& frame, const std::shared_ptr<const FrameImages>& images, bool key_press,
            const TrackingSnapshot& map,
            const std::function<void(const std::shared_ptr<const FrameImages>&)>& give_away);

  // The mapper is making a map, or has made one, for this.
  bool expects_map() const { return pending_ || accepted_; }

  void reset();
  std::vector<std::array<Eigen::Vector2f, 2>> trails_for_drawing() const;

 private:
  void start(const Frame& frame, const std::shared_ptr<const FrameImages>& images);
  void follow(const std::shared_ptr<const FrameImages>& images);
  bool request(const Frame& frame, const std::shared_ptr<const FrameImages>& images,
               const std::function<void(const std::shared_ptr<const FrameImages>&)>& give_away);
  bool motion_is_worth_a_try(const Frame& frame);
  std::optional<RigidTransform> pose_from_trails(const TrackingSnapshot& map) const;

  CameraModel camera_;
  TrackerOptions options_;
  bool automatic_;
  TrackerSchedule* schedule_;

  TrailTracker trails_;
  std::shared_ptr<const FrameImages> first_, last_;
  int first_frame_ = -1;
  Timestamp first_time_{0};
  double next_motion_px_ = 0;  // automatic: tried again at this median trail length
  std::optional<std::future<InitialisationReply>> pending_;
  std::optional<InitialisationReply> accepted_;
  std::string refusal_;  // why the last try came to nothing: said until the next key press
};

}  // namespace parallax
