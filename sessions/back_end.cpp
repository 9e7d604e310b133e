#include "sessions/back_end.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/check.h"
#include "core/error.h"
#include "place/stereo_scene.h"
#include "sessions/session_optimiser.h"
#include "sessions/session_schema.h"

namespace parallax {
namespace {

[[noreturn]] void refuse_message(const std::string& session, const std::string& what, int found, int expected) {
  throw InputError("session " + session + ": found " + what + " " + std::to_string(found) + ", expected " +
                   std::to_string(expected));
}

// What the database and the graph both take; less is known of nothing real.
bool is_sound(const StereoConstraint& constraint) {
  constexpr double kLeastVariance = 1e-20, kMost = 1e9;
  if (!session_file::is_sound(constraint.from_from_to) || constraint.from_from_to.t.norm() > kMost ||
      !session_file::is_covariance(constraint.covariance, true))
    return false;
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(constraint.covariance, Eigen::EigenvaluesOnly);
  return eigen.info() == Eigen::Success && eigen.eigenvalues()[0] >= kLeastVariance && eigen.eigenvalues()[5] <= kMost;
}

}  // namespace

void BackEndOptions::validate() const {
  places.validate();
  vote.validate();
  if (keyframes_per_save < 1)
    throw InputError("back end option keyframes_per_save: found " + std::to_string(keyframes_per_save) +
                     ", expected 1 or more");
}

BackEnd::BackEnd(SessionDatabase* database, std::shared_ptr<const Vocabulary> vocabulary, const CrfModel& crf,
                 const BackEndOptions& options)
    : database_(database),
      vocabulary_(vocabulary),
      options_(options),
      crf_(crf),
      places_(std::move(vocabulary), crf, options.places),
      vote_(options.vote),
      graph_(options.graph) {
  options_.validate();
  if (database_) restore(database_->read());
}

void BackEnd::restore(const SessionDocument& document) {
  build_session_graph(document, &graph_);
  for (const SessionState& state : document.sessions) {
    sessions_[state.id].state = state;
    places_.begin_session(state.id, state.start.camera);
    next_session_ = std::max(next_session_, state.id + 1);
  }
  for (const SessionPose& pose : document.poses) {
    Session& of = session(pose.key.session);
    of.poses.push_back(pose);
    of.saved.push_back(pose.session_from_camera);
    restore_place(pose);
  }
  for (const auto& [number, constraint] : document.constraints) vote_.extend(number, constraint);
  for (const Encounter& encounter : document.encounters) {
    encounters_[encounter.id] = encounter;
    next_encounter_ = std::max(next_encounter_, encounter.id + 1);
    if (can_be_voted_on(encounter))
      vote_.restore(encounter);
    else
      not_in_graph_.push_back(encounter.id);
  }
  if (!sessions_.empty()) graph_.optimise();
}

StereoScene BackEnd::stored_scene(const PoseKey& key) {
  SessionFeatures kept = database_->features(key);
  StereoScene scene;
  scene.features = std::move(kept.features);
  scene.right_px = std::move(kept.right_px);
  return scene;
}

void BackEnd::restore_place(const SessionPose& pose) {
  if (database_) places_.restore({pose.key.session, pose.key.keyframe}, pose.time, stored_scene(pose.key));
}

int BackEnd::recognise_again() {
  if (!database_) return 0;
  save();
  std::set<std::pair<PoseKey, PoseKey>> known;
  for (const auto& [id, encounter] : encounters_) known.insert({encounter.found, encounter.query});
  PlaceRecogniser fresh(vocabulary_, crf_, options_.places);
  BackEndAnswer answer;
  int added = 0;
  for (const auto& [number, of] : sessions_) {
    fresh.begin_session(number, of.state.start.camera);
    for (const SessionPose& pose : of.poses)
      for (const PlaceEncounter& place : fresh.add({number, pose.key.keyframe}, pose.time, stored_scene(pose.key))) {
        const std::optional<std::int64_t> id = take_place(place, known);
        if (id) ++added;
      }
  }
  places_ = std::move(fresh);
  add_waiting_encounters(&answer);
  finish();
  return added;
}

// An encounter that is new and wanted.
std::optional<std::int64_t> BackEnd::take_place(const PlaceEncounter& place,
                                                const std::set<std::pair<PoseKey, PoseKey>>& known) {
  Encounter encounter;
  encounter.found = {place.found.session, place.found.keyframe};
  encounter.query = {place.query.session, place.query.keyframe};
  if (encounter.within_session() ? !options_.loops : !options_.meetings) return std::nullopt;
  if (!place.refused.empty()) {
    if (options_.keep_refused) refused_places_.push_back(place);
    return std::nullopt;
  }
  if (known.contains({encounter.found, encounter.query})) return std::nullopt;
  encounter.id = next_encounter_++;
  encounter.found_from_query = place.found_from_query;
  encounter.covariance = place.covariance;
  encounter.bow = place.bow;
  encounter.crf_near = place.crf_near;
  encounter.crf_far = place.crf_far;
  encounter.matches = place.matches;
  encounter.inliers = place.inliers;
  encounters_[encounter.id] = encounter;
  not_in_graph_.push_back(encounter.id);
  changed_.insert(encounter.id);  // durable with its keyframe, which nobody sends again once it is
  return encounter.id;
}

BackEnd::Session& BackEnd::session(int number) {
  const auto found = sessions_.find(number);
  if (found == sessions_.end())
    throw InputError("session number: found " + std::to_string(number) + ", expected one that has begun");
  return found->second;
}

SessionState BackEnd::begin(const SessionStart& start) {
  if (!session_file::is_sound(start.camera) || !session_file::is_sound(start.rectified_from_left) ||
      !(start.frames_per_second >= 0) || !std::isfinite(start.frames_per_second))
    throw InputError("session " + start.name + ": found a camera that is none, expected a rectified pair");
  SessionState state;
  if (database_) {
    state = database_->begin_session(start);
  } else {
    state.id = next_session_;
    state.start = start;
    const auto is_taken = [&](const std::string& name) {
      return std::any_of(sessions_.begin(), sessions_.end(),
                         [&](const auto& entry) { return entry.second.state.start.name == name; });
    };
    for (int n = 2; is_taken(state.start.name); ++n) state.start.name = start.name + "-" + std::to_string(n);
  }
  state.component = state.id;
  next_session_ = state.id + 1;
  sessions_[state.id].state = state;
  graph_.add_session(state.id);
  places_.begin_session(state.id, start.camera);
  return state;
}

std::optional<SessionState> BackEnd::resume(const std::string& name, SessionPose* last) {
  for (auto& [number, of] : sessions_) {
    if (of.state.start.name != name) continue;
    save();
    const int kept = of.poses.empty() ? 0 : graph_.poses(number);
    if (static_cast<int>(of.poses.size()) > kept) {
      std::erase_if(not_in_graph_, [&, n = number](std::int64_t id) {
        const Encounter& e = encounters_.at(id);
        const bool gone =
            (e.found.session == n && e.found.keyframe >= kept) || (e.query.session == n && e.query.keyframe >= kept);
        if (gone) encounters_.erase(id);
        return gone;
      });
      of.poses.resize(static_cast<std::size_t>(kept));
      of.saved.resize(static_cast<std::size_t>(kept));
      if (database_) database_->truncate_session(number, kept);
      places_.forget_session(number);
      places_.begin_session(number, of.state.start.camera);
      for (const SessionPose& pose : of.poses) restore_place(pose);
    }
    if (last && !of.poses.empty()) {
      *last = of.poses.back();
      last->session_from_camera = graph_.session_from_camera(last->key);
    }
    of.state.ended = false;
    return of.state;
  }
  return std::nullopt;
}

BackEndAnswer BackEnd::answer_for(int number) const {
  const Session& of = sessions_.at(number);
  BackEndAnswer answer;
  answer.session = number;
  answer.keyframes = static_cast<int>(of.poses.size());
  answer.in_graph = graph_.poses(number);
  answer.component = graph_.component(number);
  answer.global_from_session = graph_.global_from_session(number);
  return answer;
}

BackEndAnswer BackEnd::add(int number, const SessionKeyframe& keyframe) {
  Session& of = session(number);
  if (keyframe.index < static_cast<int>(of.poses.size())) return answer_for(number);
  if (keyframe.index > static_cast<int>(of.poses.size()))
    refuse_message(of.state.start.name, "keyframe", keyframe.index, static_cast<int>(of.poses.size()));
  const StereoCamera& camera = of.state.start.camera;
  if (keyframe.left.cols != camera.width || keyframe.left.rows != camera.height ||
      keyframe.right.size() != keyframe.left.size())
    refuse_message(of.state.start.name, "images of width", keyframe.left.cols, camera.width);
  if (!session_file::is_sound(keyframe.session_from_camera))
    throw InputError("session " + of.state.start.name + ", keyframe " + std::to_string(keyframe.index) +
                     ": found a pose that is none, expected a rotation and a translation");

  const auto begin = SteadyClock::now();
  StereoScene scene = make_stereo_scene(camera, keyframe.left, keyframe.right, *vocabulary_, options_.places.scene);
  if (database_) {
    SessionBatch::NewKeyframe kept{keyframe, {scene.features, scene.right_px}};
    if (!options_.keep_images) kept.keyframe.left = kept.keyframe.right = GreyImage();
    batch_of(number).keyframes.push_back(std::move(kept));
  }
  const std::vector<PlaceEncounter> found = places_.add({number, keyframe.index}, keyframe.time, std::move(scene));
  const double ms = milliseconds_since(begin);
  of.poses.push_back(
      {{number, keyframe.index}, keyframe.frame, keyframe.time, keyframe.after_failure, keyframe.session_from_camera});
  of.saved.push_back(keyframe.session_from_camera);
  ++unsaved_keyframes_;
  BackEndAnswer answer = answer_for(number);
  for (const PlaceEncounter& place : found) answer.loop |= take_place(place, {}).has_value();
  note_time({{number, keyframe.index}, SessionModule::place_recognition, ms, answer.loop});
  if (unsaved_keyframes_ >= options_.keyframes_per_save) save();
  return answer;
}

BackEndAnswer BackEnd::add(int number, const SessionWindow& window) {
  Session& of = session(number);
  int next = graph_.poses(number);
  SessionWindow fresh;
  for (const StereoConstraint& constraint : window.constraints) {
    if (constraint.to < next) continue;
    if (constraint.to != next || constraint.from + 1 != constraint.to)
      refuse_message(of.state.start.name, "a constraint to keyframe", constraint.to, next);
    if (constraint.to >= static_cast<int>(of.poses.size()))
      refuse_message(of.state.start.name, "keyframes before a window's constraints", static_cast<int>(of.poses.size()),
                     constraint.to + 1);
    if (!is_sound(constraint))
      throw InputError("session " + of.state.start.name + ", constraint to keyframe " + std::to_string(constraint.to) +
                       ": found numbers that are no motion with a covariance, expected one");
    fresh.constraints.push_back(constraint);
    ++next;
  }
  if (fresh.constraints.empty()) return answer_for(number);
  for (const SessionPoint& point : window.points)
    if (point.camera.allFinite() && point.keyframe >= 0 && point.keyframe < next && point.poses >= 0)
      fresh.points.push_back(point);

  const auto begin = SteadyClock::now();
  for (const StereoConstraint& constraint : fresh.constraints) {
    graph_.add_constraint(number, constraint);
    vote_.extend(number, constraint);
  }
  BackEndAnswer answer = answer_for(number);
  add_waiting_encounters(&answer);
  graph_.update();
  const int last = fresh.constraints.back().to;
  note_time({{number, last}, SessionModule::pose_graph, milliseconds_since(begin), answer.loop});
  if (database_) batch_of(number).windows.push_back(std::move(fresh));
  const std::vector<SessionMeeting> meetings = std::move(answer.meetings);
  const bool loop = answer.loop;
  answer = answer_for(number);
  answer.meetings = meetings;
  answer.loop = loop;
  save();
  return answer;
}

// A session's first keyframe is in the graph from the beginning, but nothing is known of its way before the first
// window.
bool BackEnd::can_be_voted_on(const Encounter& encounter) const {
  return graph_.contains(encounter.found) && graph_.contains(encounter.query) && vote_.knows(encounter.found) &&
         vote_.knows(encounter.query);
}

// Those whose keyframes are now both in the graph, in the order in which they were found.
void BackEnd::add_waiting_encounters(BackEndAnswer* answer) {
  std::vector<std::int64_t> still;
  for (const std::int64_t id : not_in_graph_) {
    const Encounter& encounter = encounters_.at(id);
    if (can_be_voted_on(encounter))
      take_encounter(encounter, answer);
    else
      still.push_back(id);
  }
  not_in_graph_ = std::move(still);
}

void BackEnd::take_encounter(const Encounter& encounter, BackEndAnswer* answer) {
  const EncounterVote::Verdict verdict = vote_.add(encounter);
  changed_.insert(encounter.id);
  for (const std::int64_t id : verdict.refuse) {
    Encounter& refused = encounters_.at(id);
    refused.state = EncounterState::refused;
    changed_.insert(id);
    if (graph_.has_encounter(id)) graph_.set_active(id, false);
  }
  for (const std::int64_t id : verdict.activate) {
    Encounter& accepted = encounters_.at(id);
    accepted.state = EncounterState::active;
    changed_.insert(id);
    answer->loop = true;
    if (graph_.component(accepted.found.session) != graph_.component(accepted.query.session)) {
      const PoseKey& other = accepted.found.session == answer->session ? accepted.query : accepted.found;
      answer->meetings.push_back({accepted, sessions_.at(other.session).state.start.name});
    }
    if (graph_.has_encounter(id))
      graph_.set_active(id, true);
    else
      graph_.add_encounter(accepted);
  }
}

void BackEnd::add(const std::vector<SessionTiming>& timings) {
  for (const SessionTiming& timing : timings)
    if (!sessions_.contains(timing.key.session) || timing.key.keyframe < 0 || !(timing.ms >= 0) ||
        !std::isfinite(timing.ms))
      throw InputError("timing: found one of no session or no time, expected milliseconds of a session that has begun");
  for (const SessionTiming& timing : timings) note_time(timing);
}

void BackEnd::note_time(const SessionTiming& timing) {
  timings_.push_back(timing);
  if (database_) batch_of(timing.key.session).timings.push_back(timing);
}

void BackEnd::end(int number) {
  session(number).state.ended = true;
  save();
}

void BackEnd::switch_encounter(std::int64_t id, bool on) {
  const auto found = encounters_.find(id);
  if (found == encounters_.end())
    throw InputError("encounter: found " + std::to_string(id) + ", expected the number of one that is there");
  Encounter& encounter = found->second;
  if (std::find(not_in_graph_.begin(), not_in_graph_.end(), id) != not_in_graph_.end())
    throw InputError("encounter " + std::to_string(id) + ": its keyframes are not in the graph yet");
  encounter.state = on ? EncounterState::active : EncounterState::off;
  changed_.insert(id);
  vote_.restore(encounter);
  if (graph_.has_encounter(id))
    graph_.set_active(id, on);
  else if (on)
    graph_.add_encounter(encounter);
}

PoseGraphStep BackEnd::finish() {
  const PoseGraphStep step = graph_.optimise();
  gather_moved(true);
  for (auto& [number, of] : sessions_)
    if (!graph_.anchor_covariance(number, &of.state.anchor_covariance)) of.state.anchor_covariance.setZero();
  save();
  return step;
}

SessionBatch& BackEnd::batch_of(int number) {
  SessionBatch& batch = batches_[number];
  batch.session = number;
  return batch;
}

// What has moved since it was written, as far as it is worth it.
void BackEnd::gather_moved(bool all) {
  saves_since_moved_ = 0;
  const double least_m = all ? 0 : options_.moved_m, least_rad = all ? 0 : options_.moved_rad;
  for (auto& [number, of] : sessions_) {
    const int known = std::min(graph_.poses(number), static_cast<int>(of.poses.size()));
    for (int i = 0; i < known; ++i) {
      const auto at = static_cast<std::size_t>(i);
      const RigidTransform& now = graph_.session_from_camera({number, i});
      of.poses[at].session_from_camera = now;
      const RigidTransform& before = of.saved[at];
      // Twice the sine of half the angle is |R - R'| / sqrt(2).
      if ((now.t - before.t).norm() <= least_m && (now.R - before.R).norm() <= least_rad * std::sqrt(2.0)) continue;
      of.saved[at] = now;
      if (database_) batch_of(number).moved.push_back(of.poses[at]);
    }
  }
}

void BackEnd::save() {
  if (++saves_since_moved_ >= options_.saves_per_moved) gather_moved(false);
  if (!database_) return;
  SessionBatch last;  // what speaks of several sessions comes after all of them
  for (const std::int64_t id : changed_) last.encounters.push_back(encounters_.at(id));
  for (auto& [number, of] : sessions_) {
    of.state.component = graph_.component(number);
    of.state.global_from_session = graph_.global_from_session(number);
    last.states.push_back(of.state);
  }
  std::vector<SessionBatch> all;
  for (const auto& [number, batch] : batches_) all.push_back(batch);  // kept until it is durable
  if (!last.states.empty()) {
    last.session = last.states.front().id;
    all.push_back(std::move(last));
  }
  database_->save(all);
  batches_.clear();
  unsaved_keyframes_ = 0;
  changed_.clear();
}

BackEndView BackEnd::view() const {
  BackEndView out;
  for (const auto& [number, of] : sessions_) {
    out.sessions.push_back(of.state);
    out.sessions.back().component = graph_.component(number);
    out.sessions.back().global_from_session = graph_.global_from_session(number);
    for (const SessionPose& pose : of.poses) {
      if (!graph_.contains(pose.key)) break;
      out.poses.push_back(pose);
      out.poses.back().session_from_camera = graph_.session_from_camera(pose.key);
    }
  }
  for (const auto& [id, encounter] : encounters_) out.encounters.push_back(encounter);
  return out;
}

}  // namespace parallax
