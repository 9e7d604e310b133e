// Stereo sessions with their back end: one after the other, or at once on threads of their own (MS Fig. 3).
//
// Called on the main thread; returns when all sessions have ended, the graph is optimised and the database written.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "app/slam_link.h"
#include "app/slam_maps.h"
#include "app/slam_session.h"
#include "app/stereo_input.h"
#include "sessions/back_end.h"

namespace parallax {

class SlamWatcher;

struct SlamSessionPlan {
  std::string source, name, calibration;
  SourceOptions source_options;
  SlamMaps* maps = nullptr;  // filled, when there is one
};

struct SlamSessionsOptions {
  SlamOptions slam;
  BackEndOptions back_end;
  SlamLinkOptions link;
  std::string database;  // empty: nothing is kept
  bool at_once = false, resume = false;
  SlamWatcher* watcher = nullptr;  // looks on, when there is one
  int covariances = 0;             // of so many keyframes of each session, spread evenly, the last among them
};

struct SlamSessionOutcome {
  SlamResult result;                      // keyframes: as the pose graph has them, in the session's frame
  std::vector<StereoSessionPose> before;  // as the windows alone had them
  SessionState state;                     // of the first part
  std::vector<SlamLinkPart> parts;        // several when the motion was lost and that begins a session
  std::vector<SessionMeeting> meetings;
  Trajectory truth;
  double frames_per_second = 0;

  // Final trajectory in the global frame.
  Trajectory global_trajectory() const;
};

struct SlamSessionsResult {
  std::vector<SlamSessionOutcome> sessions;  // as planned
  BackEndView view;                          // of all that the database holds
  std::vector<PlaceEncounter> refused;       // by place recognition
  std::vector<SessionTiming> timings;
  // Of a left increment of global_from_camera, translation first; as many as were asked for.
  std::map<PoseKey, Matrix6d> covariances;
};

// The back end with the words and weights that the program comes with. `database` may be null.
std::unique_ptr<BackEnd> make_back_end(SessionDatabase* database, const BackEndOptions& options);

// What a session is called after its source: the last part of a path; what is no letter or number becomes a dash.
std::string session_name_of(const std::string& source);

// Of session `k` (0, 1...) called while it runs: frames so far, of all (below 1: unknown), the tracker's state.
using SlamProgress = std::function<void(std::size_t k, int done, int total, const std::string& state)>;

// `link`: makes a session's link to a back end elsewhere; empty: one of its own, with the database. Throws InputError
// and RunError; sessions that have ended by then are in the database.
SlamSessionsResult run_slam_sessions(const std::vector<SlamSessionPlan>& plans, const SlamSessionsOptions& options,
                                     const SlamLinkMaker& link = {}, const SlamProgress& progress = {});

}  // namespace parallax
