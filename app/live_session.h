// A live session: camera thread, tracking thread, mapping thread, and the recorder's, around one map. The window's
// thread asks for the newest frame and says what the user did; it never holds up tracking.
//
// Every public member is safe from any thread.
#pragma once

#include <chrono>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>

#include "app/run_session.h"
#include "camera/frame_source.h"
#include "map/messages.h"
#include "map/tracking_snapshot.h"

namespace parallax {

class SessionRecorder;

// One frame, tracked, with the map as the tracker saw it: immutable and shared, handed over to whoever draws.
struct LiveFrame {
  Frame frame;
  TrackingResult tracked;  // with points and trails
  std::shared_ptr<const TrackingSnapshot> map;
  double frames_per_second = 0;  // of tracking, over about the last second
};

// A change of the map that the user asks for. Scale: the world is multiplied about its origin.
struct ScaleEdit {
  double factor = 1;
};
// The dominant plane is looked for again; with a seed point (world), the plane around it is added and made the dominant
// one.
struct PlaneEdit {
  std::optional<Eigen::Vector3d> seed;
};
using EditReply = MapEditReply;  // ok, or a reason for the user

class LiveSession {
 public:
  // Starts the threads. `recorder` may be null (app/session_recorder.h). A source that is no LiveCamera is played at
  // its time stamps (over options.speed). The initialisation key decides when options.manual_initialisation is set.
  // options.kept_frames bounds RunResult::frames. `stop_source` is called by stop() to wake a source that is waiting
  // for its camera (LiveCamera::stop); may be empty.
  LiveSession(std::shared_ptr<FrameSource> source, const CameraModel& camera, const RunOptions& options,
              std::unique_ptr<SessionRecorder> recorder, std::function<void()> stop_source);
  ~LiveSession();  // stop()
  LiveSession(const LiveSession&) = delete;
  LiveSession& operator=(const LiveSession&) = delete;

  // The newest frame that was tracked; null before the first. Never waits for a frame.
  std::shared_ptr<const LiveFrame> newest() const;
  // Waits for a frame newer than `index`, at most so long; null when none came.
  std::shared_ptr<const LiveFrame> wait_for_newer(int index, std::chrono::milliseconds at_most) const;

  // The initialisation key: taken by the next frame.
  void press_initialise();
  // Everything mapped is forgotten; ready when it is.
  std::future<void> reset();
  std::future<EditReply> edit(const ScaleEdit& edit);
  std::future<EditReply> edit(const PlaneEdit& edit);

  // For those that change the map from outside (app/session_maps.h); lives as long as this.
  MapperInbox& inbox();

  // A copy of the map, taken under its lock (images are shared, not copied): for the map view and for saving.
  Map copy_map() const;
  MapCopy copy_map_and_world() const;

  struct Statistics {
    int frames_read = 0, frames_dropped = 0;
    int recorder_frames_dropped = 0;
    bool recording = false;
    bool source_ended = false;
  };
  Statistics statistics() const;
  // Why a thread failed (a full disk, a camera that broke for good): one line, once; empty: all is well.
  std::string take_failure();

  // Ends the threads and the recording, and returns what the run was, as run_session does. Callable once.
  RunResult stop();

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace parallax
