// The back end of the multi-session system (MS Fig. 1 and 3): keyframes of any number of sessions go through place
// recognition, encounters are put to the vote, windows extend the pose graph, and all of it is kept in the database.
// Step by step: it has no thread. One caller at a time (a worker of app/, or the process `parallax backend`).
//
// What arrives twice is passed over; what does not continue what is there is refused by InputError and changes
// nothing.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/interruption.h"
#include "place/place_recogniser.h"
#include "sessions/encounter_vote.h"
#include "sessions/session_database.h"
#include "sessions/session_graph.h"

namespace parallax {

struct BackEndOptions {
  PlaceRecogniserOptions places;
  EncounterVoteOptions vote;
  SessionGraphOptions graph;
  bool loops = true;            // within a session
  bool meetings = true;         // between sessions
  bool keep_images = true;      // in the database
  bool keep_refused = false;    // what place recognition refused, in memory: some ten a keyframe
  int keyframes_per_save = 30;  // at most so many wait to be written; a window's end writes as well
  // Estimates are written anew so often only, and those that moved by less not before the end: they follow from what
  // is written at once.
  int saves_per_moved = 20;
  double moved_m = 1e-3, moved_rad = 1e-3;

  // Throws InputError when a value is out of range.
  void validate() const;
};

// Two sessions have met: one that a front end works on, and the one of this name.
struct SessionMeeting {
  Encounter encounter;
  std::string other;
};

// What became of a keyframe or a window.
struct BackEndAnswer {
  int session = 0;
  int keyframes = 0;  // of this session that have arrived
  int in_graph = 0;   // that the graph holds
  bool loop = false;  // an encounter was accepted geometrically: the window may be handed over (MS §3.2)
  // Sessions that this one has met just now for the first time, and where.
  std::vector<SessionMeeting> meetings;
  RigidTransform global_from_session;
  int component = 0;
};

// All that there is to see, as it stands.
struct BackEndView {
  std::vector<SessionState> sessions;
  std::vector<SessionPose> poses;  // by key; in the graph
  std::vector<Encounter> encounters;
};

class BackEnd {
 public:
  // `database` may be null: nothing is kept then; it outlives this. What it holds is taken up. Throws InputError.
  BackEnd(SessionDatabase* database, std::shared_ptr<const Vocabulary> vocabulary, const CrfModel& crf,
          const BackEndOptions& options);

  // A new session. Its name is made unique.
  SessionState begin(const SessionStart& start);
  // A session that was begun before and has not ended, or has: keyframes that never came into the graph are dropped,
  // and the last one that did is where it goes on (frame, time, pose). Nothing when the name is unknown.
  std::optional<SessionState> resume(const std::string& name, SessionPose* last);

  // Place recognition. Keyframes of a session come in order.
  BackEndAnswer add(int session, const SessionKeyframe& keyframe);
  // The pose graph; the window's keyframes have arrived before.
  BackEndAnswer add(int session, const SessionWindow& window);
  // Times of the front end, for the report.
  void add(const std::vector<SessionTiming>& timings);
  void end(int session);

  // Undo and redo; by id. InputError when there is no such encounter.
  void switch_encounter(std::int64_t id, bool on);
  // Asks for every keyframe of the database again, in order: sessions that came from another database have not met
  // yet. How many encounters were found that were not known.
  int recognise_again();
  // All to convergence, and everything written.
  PoseGraphStep finish();
  // What waits is written; durable when it returns.
  void save();

  BackEndView view() const;
  const SessionGraph& graph() const { return graph_; }
  const std::vector<SessionTiming>& timings() const { return timings_; }
  // Candidates that place recognition refused, with what it found, when they are kept.
  const std::vector<PlaceEncounter>& refused_places() const { return refused_places_; }

 private:
  struct Session {
    SessionState state;
    std::vector<SessionPose> poses;     // that have arrived
    std::vector<RigidTransform> saved;  // as the database has them
  };
  void restore(const SessionDocument& document);
  void restore_place(const SessionPose& pose);
  StereoScene stored_scene(const PoseKey& key);
  std::optional<std::int64_t> take_place(const PlaceEncounter& place,
                                         const std::set<std::pair<PoseKey, PoseKey>>& known);
  void add_waiting_encounters(BackEndAnswer* answer);
  bool can_be_voted_on(const Encounter& encounter) const;
  void take_encounter(const Encounter& encounter, BackEndAnswer* answer);
  void note_time(const SessionTiming& timing);
  void gather_moved(bool all);
  BackEndAnswer answer_for(int number) const;
  Session& session(int number);
  SessionBatch& batch_of(int number);

  SessionDatabase* database_;
  std::shared_ptr<const Vocabulary> vocabulary_;
  BackEndOptions options_;
  CrfModel crf_;
  PlaceRecogniser places_;
  EncounterVote vote_;
  SessionGraph graph_;
  std::map<int, Session> sessions_;
  std::map<std::int64_t, Encounter> encounters_;
  std::vector<std::int64_t> not_in_graph_;  // encounters whose keyframes have not been handed over
  std::vector<SessionTiming> timings_;
  std::vector<PlaceEncounter> refused_places_;
  // What waits to be written.
  std::map<int, SessionBatch> batches_;
  std::set<std::int64_t> changed_;
  int unsaved_keyframes_ = 0, saves_since_moved_ = 0;
  std::int64_t next_encounter_ = 1;
  int next_session_ = 1;
};

}  // namespace parallax
