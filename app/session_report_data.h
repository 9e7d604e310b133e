// What a report on sessions tells, gathered from a run or from a database, and the figures of its tables.
//
// Milliseconds, seconds, metres. Plain values and functions; one thread.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/map_picture.h"
#include "app/session_view_scene.h"
#include "app/slam_sessions.h"

namespace parallax {

// What is known of a session's frames, when it was run just now.
struct SessionFrames {
  int read = 0, dropped = 0, failures = 0;
  double wall_seconds = 0;
};

struct SessionReportData {
  std::string program;                                        // "parallax 1.2.3"
  std::string origin;                                         // what the report is on: a run, or a database's path
  std::vector<std::pair<std::string, std::string>> settings;  // empty: not known
  BackEndView view;
  SessionScene scene;
  std::vector<SessionTiming> timings;
  std::map<int, SessionFrames> frames;        // by session; those that are not here: not known
  std::map<std::string, int> refused_places;  // candidates that place recognition refused, by reason
  bool refused_places_known = false;
  std::vector<std::pair<std::string, std::string>> warnings;  // session, text
  bool warnings_known = false;
  std::vector<std::string> not_known;  // remarks on what could not be had, for the reader
  std::optional<FloorPlan> floor_plan;
};

// After run_slam_sessions(): a database that was written is read again. Throws what reading it throws.
SessionReportData report_on_run(const SlamSessionsResult& run, const SlamSessionsOptions& options);

SessionReportData report_on_database(SessionDatabase* database);

// What is drawn of a run: with points and spreads. `database`: the path of the one that was written, or empty. Maps are
// made of the images that it has (some 60 ms a keyframe, of at most 300), else of features.
SessionScene scene_of_run(const SlamSessionsResult& run, const std::string& database);

// A row of MS Table 2.
struct ModuleTimes {
  std::size_t count = 0;
  double mean_ms = 0, variance_ms2 = 0, worst_ms = 0;
  PoseKey worst_at;
  double sum_s = 0;
};
ModuleTimes times_of_module(const SessionReportData& data, SessionModule module, std::optional<bool> loop = {});

// A column of MS Table 1, of one session.
struct SessionCounts {
  int poses = 0, failures = 0;
  double seconds = 0, path_m = 0;
  int loops = 0;     // within the session, in the graph
  int meetings = 0;  // with other sessions, in the graph; each counts for both
};
SessionCounts counts_of_session(const SessionReportData& data, int session);
// Of all: meetings count once.
SessionCounts counts_of_all(const SessionReportData& data);

// Session time at which each session begins when all are put one after the other, those with times only.
std::map<int, double> session_offsets(const SessionReportData& data);

// Seconds spent on a module so far, against session time put one after the other.
std::vector<CanvasPoint> cumulative_times(const SessionReportData& data, SessionModule module);

const char* name_of(SessionModule module);

}  // namespace parallax
