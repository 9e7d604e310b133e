// The live source, its feed and the session that tracks it, for the window: opened in parallel with the window, begun
// when a lens is known, begun anew with another lens.
//
// The window's thread calls everything; nothing here waits for a frame.
#pragma once

#include <future>
#include <memory>
#include <optional>
#include <string>

#include "app/live_feed.h"
#include "app/live_options.h"
#include "app/live_session.h"
#include "app/map_saver.h"
#include "app/session_maps.h"
#include "app/source.h"
#include "app/user_settings.h"

namespace parallax {

class LiveEngine {
 public:
  LiveEngine(const LiveOptions& options, const UserSettings& settings, const ProgramState& state);
  ~LiveEngine();
  LiveEngine(const LiveEngine&) = delete;
  LiveEngine& operator=(const LiveEngine&) = delete;

  // Begins to open the source, on a thread of its own.
  void open();
  // True once, when it is open. Throws what opening failed of.
  bool poll_opened();
  // Waits for it, at most so long.
  void wait_opening(std::chrono::milliseconds at_most) const;
  bool is_open() const { return feed_ != nullptr; }
  LiveFeed& feed() { return *feed_; }
  const LiveSource& source() const { return feed_->source(); }
  // Why another source than the one asked for was opened, in one sentence; empty: it is the one.
  const std::string& opening_remark() const { return opening_remark_; }

  // Begins a session with this lens; what was mapped before is forgotten. `estimated`: the lens is a guess.
  // `record_path` empty: no recording. Throws RunError when the recording cannot be made, and InputError when the map
  // file that was asked for cannot be gone on with.
  void begin(const CameraModel& lens, bool estimated, const std::string& record_path);
  // Ends the session; what it was is kept in last_result().
  void end();
  LiveSession* session() const { return session_.get(); }
  const CameraModel& lens() const { return lens_; }
  bool lens_is_estimated() const { return estimated_; }
  const std::string& record_path() const { return record_path_; }
  // Keeps the map of the session in a file; null: it is not kept.
  MapSaver* saver() const { return saver_.get(); }
  // Where maps are kept by themselves; null: they are not.
  const std::shared_ptr<const MapLibrary>& library() const { return library_; }
  // Knows the stored maps again; null without a library, and while the session is recorded: what came from elsewhere
  // could not be played again.
  SessionMaps* maps() const { return maps_.get(); }
  // Why there is none though there is a library, once; empty: nothing to say.
  std::string take_maps_problem() { return std::exchange(maps_problem_, {}); }
  // What the session began with; null: with no map.
  const std::shared_ptr<const MapDocument>& initial_map() const { return run_options_.initial_map; }
  const RunOptions& run_options() const { return run_options_; }
  const std::optional<RunResult>& last_result() const { return last_result_; }

 private:
  void begin_maps();

  LiveOptions options_;
  UserSettings settings_;
  ProgramState state_;
  RunOptions run_options_;
  std::future<std::pair<LiveSource, std::string>> opening_;
  std::unique_ptr<LiveFeed> feed_;
  std::unique_ptr<LiveSession> session_;
  std::unique_ptr<MapSaver> saver_;  // of the session: goes first
  std::shared_ptr<const MapLibrary> library_;
  std::unique_ptr<SessionMaps> maps_;  // of session and saver: goes before them
  std::string maps_problem_;
  CameraModel lens_;
  bool estimated_ = false;
  bool begun_ = false;
  std::string opening_remark_, record_path_;
  std::optional<RunResult> last_result_;
};

// The recorder of a session, with what the camera is set to. Throws RunError when the file cannot be made.
std::unique_ptr<SessionRecorder> open_recorder(const std::string& path, const LiveSource& source,
                                               const MapSaverOptions& saving = {});

// Where a live session keeps its maps by itself; null: nowhere. In the window the user's folder unless the settings or
// the command line say otherwise; without one only where the command line says.
std::shared_ptr<const MapLibrary> open_live_library(const LiveOptions& options, const UserSettings& settings);
MapSaverOptions begin_library(const std::shared_ptr<const MapLibrary>& library, const CameraModel& lens);

// The camera to open when none is named: the settings', the last one when it is still there, the first found, the
// synthetic desk; and a sentence about it where that may surprise. By hand: the synthetic desk is held by the user.
std::pair<LiveSource, std::string> open_wanted_source(const LiveOptions& options, const UserSettings& settings,
                                                      const ProgramState& state, LiveSourceOptions source_options);

}  // namespace parallax
