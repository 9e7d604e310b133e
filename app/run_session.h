// One run of the tracker and mapper on a source: two threads at the pace of the time stamps, or lockstep.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "camera/frame_source.h"
#include "map/map_document.h"
#include "map/shared_map.h"
#include "mapper/mapper.h"
#include "tracker/tracker.h"

namespace parallax {

enum class Pace { realtime, lockstep };

// TrackingSnapshot::map_version of RunOptions::initial_map.
inline constexpr std::uint64_t kInitialMapVersion = 1;

struct RunOptions {
  Pace pace = Pace::realtime;
  // Realtime: how fast time passes. 0.1: frames arrive ten times slower than their time stamps say, for a machine or a
  // build that is slow.
  double speed = 1.0;
  // Frame numbers of the two key presses; nothing: chosen automatically...
  std::optional<std::pair<int, int>> key_presses;
  // ...unless a user presses the key (LiveSession::press_initialise).
  bool manual_initialisation = false;
  // RunResult::frames: all, or the newest so many at least (a session without an end).
  std::size_t kept_frames = std::numeric_limits<std::size_t>::max();
  bool keep_trajectory = true;  // RunResult::poses when kept_frames is bounded: some 10 MB an hour
  TrackerOptions tracker;
  MapperOptions mapper;
  bool merge_maps = true;  // several maps: those that meet are merged (app/session_maps)
  // The session begins with this map, and with finding itself on it; null: with none.
  std::shared_ptr<const MapDocument> initial_map;

  bool automatic_initialisation() const { return !key_presses && !manual_initialisation; }
};

// What became of the frames that the tracker got, kept or not.
struct FrameCounts {
  int tracked = 0, good = 0, poor = 0, lost = 0, relocalised = 0, losses = 0, before_map = 0;
  bool lost_now = false;  // as of the last frame
  // Of all frames: the longest that one took, by the clock and in processor time.
  float slowest_ms = 0, slowest_cpu_ms = 0;
  void add(const TrackingResult& result);
};

// A tracked frame, for the trajectory of a session whose frames are not all kept.
struct TrackedPose {
  Timestamp time{0};
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // camera_from_world
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  int world = 0;  // row of RunResult::worlds
};
struct TrackedWorld {
  std::uint64_t map_version = 0;
  SimilarityTransform world_from_first;
};

struct RunResult {
  std::vector<TrackingResult> frames;   // delivered to the tracker, without points and trails
  std::vector<SourceWarning> warnings;  // of the source
  int frames_read = 0;
  int frames_dropped = 0;    // realtime: the tracker was not ready for them
  int frames_delivered = 0;  // to the tracker, kept or not
  int frames_tracked = 0;    // of those, with a pose
  FrameCounts counts;
  std::vector<TrackedPose> poses;  // every tracked frame, when RunOptions::kept_frames may leave some out
  std::vector<TrackedWorld> worlds;
  double wall_seconds = 0;
  MapperStatistics mapper;
  Map map;                                         // as it was at the end
  std::shared_ptr<const MapDocument> initial_map;  // what the session began with, when the map is still that one
  SimilarityTransform world_from_first;
  WorldWarps warps;
  std::uint64_t map_version = 0;
  LockTimes lock_times;
  std::vector<float> snapshot_waits_ms;
};

// Called on the tracking thread after each frame, with the frame, the result with its points, and the map that it was
// tracked with (never null).
using FrameObserver =
    std::function<void(const Frame&, const TrackingResult&, const std::shared_ptr<const TrackingSnapshot>&)>;

// Somebody who looks on and may change the map between frames (several maps). Everything is called on the tracking
// thread.
class SessionCompanion {
 public:
  virtual ~SessionCompanion() = default;
  // Before the first frame. `work` lets the mapper take what was sent, in lockstep; empty: it has a thread.
  virtual void begin(SharedMap* map, MapperInbox* inbox, std::function<void()> work) = 0;
  virtual void frame(const Frame& frame, const TrackingResult& tracked) = 0;
  // After the last frame: nothing is sent any more. And when the mapper has finished its work; the map goes afterwards.
  // A second call does nothing.
  virtual void end() = 0;
  virtual void finish() = 0;
};

// Runs to the end of the source. Mapping goes on after the last frame until there is nothing left to do (in realtime:
// for at most a few seconds).
RunResult run_session(FrameSource* source, const CameraModel& camera, const RunOptions& options,
                      const FrameObserver& observer, SessionCompanion* companion = nullptr);

}  // namespace parallax
