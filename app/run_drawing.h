// `run --video` and `--frames`, and `live --headless --video`: what the window would show, as a video or as pictures;
// and `run --game`: a game played by its script on every frame. Drawing, playing and writing happen on a thread of
// their own.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>

#include "app/game_report.h"
#include "app/game_session.h"
#include "core/camera_model.h"
#include "core/frame.h"
#include "map/tracking_snapshot.h"
#include "tracker/tracking_types.h"

namespace parallax {

// What happens when frames come faster than they are drawn.
enum class DrawingPace {
  wait,     // draw() waits: no frame is missing (lockstep)
  keep_up,  // draw() never waits: frames are kept until the memory for them is used up, then left out and counted
};

struct RunDrawingOptions {
  std::string video_path, frames_folder;  // either may be empty; the folder is made when it is not there
  DrawingPace pace = DrawingPace::wait;
  bool manual = false;        // the key is the user's; the hints ask for it
  std::size_t most_kept = 0;  // frames; 0: as many as there is memory for
  std::optional<GameRequest> game;
  std::shared_ptr<const ModelSet> models;  // with a game: never null
  bool occlusion = true;                   // real things hide what a game puts behind them
};

// draw() and close() belong to one thread. Both throw RunError when an output cannot be written, if need be one that
// an earlier frame ran into.
class RunDrawing {
 public:
  // Throws InputError and RunError.
  RunDrawing(const CameraModel& camera, double frames_per_second, const RunDrawingOptions& options);
  // Without close(): what is queued is forgotten, and no video is left.
  ~RunDrawing();
  RunDrawing(const RunDrawing&) = delete;
  RunDrawing& operator=(const RunDrawing&) = delete;

  // Hands a frame over; images and map are shared with the caller and must not change. `map` may be null.
  void draw(const Frame& frame, const TrackingResult& tracked, const std::shared_ptr<const TrackingSnapshot>& map);
  // Draws what is queued, and finishes the video.
  void close();

  // Frames that were left out; DrawingPace::keep_up only.
  int left_out() const;
  // After close(): how the game went; nothing without one.
  const std::optional<GameOutcome>& game() const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace parallax
