#include "sessions/encounter_vote.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <string>

#include "core/check.h"
#include "core/error.h"

namespace parallax {
namespace {

constexpr std::size_t kMostCompared = 50;  // active encounters that a new one is held against, the nearest

void require_vote(bool ok, const char* key, double found, const char* expected) {
  if (ok) return;
  throw InputError("vote option " + std::string(key) + ": found " + std::to_string(found) + ", expected " + expected);
}

// How a covariance of a left increment of T passes on to A T B: by the adjoint of A.
Matrix6d carried(const RigidTransform& A, const Matrix6d& covariance) {
  const Matrix6d adjoint = A.adjoint();
  return adjoint * covariance * adjoint.transpose();
}

double squared_distance(const RigidTransform& off, const Matrix6d& covariance) {
  const Vector6d residual = off.log();
  const double squared = residual.dot(covariance.ldlt().solve(residual));
  return std::isfinite(squared) ? squared : std::numeric_limits<double>::infinity();
}

Matrix6d diagonal(double translation_variance, double rotation_variance) {
  Vector6d d;
  d << Eigen::Vector3d::Constant(translation_variance), Eigen::Vector3d::Constant(rotation_variance);
  return d.asDiagonal();
}

}  // namespace

void EncounterVoteOptions::validate() const {
  require_vote(within_session >= 1, "within_session", within_session, "1 or more");
  require_vote(between_sessions >= 1, "between_sessions", between_sessions, "1 or more");
  require_vote(least_density >= 0 && least_density <= 1, "least_density", least_density, "0 to 1");
  require_vote(clearly_better >= 1, "clearly_better", clearly_better, "1 or more");
  require_vote(reach_m > 0, "reach_m", reach_m, "above 0");
  require_vote(gate > 0, "gate", gate, "above 0");
  require_vote(drift_part >= 0 && drift_part < 1, "drift_part", drift_part, "0 to below 1");
  require_vote(drift_rad_per_m >= 0, "drift_rad_per_m", drift_rad_per_m, "0 or more");
  require_vote(loop_drift_part >= 0 && loop_drift_part < 1, "loop_drift_part", loop_drift_part, "0 to below 1");
  require_vote(loop_drift_rad_per_m >= 0, "loop_drift_rad_per_m", loop_drift_rad_per_m, "0 or more");
  require_vote(floor_m > 0 && floor_rad > 0, "floor_m, floor_rad", std::min(floor_m, floor_rad), "above 0");
}

EncounterVote::EncounterVote(const EncounterVoteOptions& options) : options_(options) { options_.validate(); }

void EncounterVote::extend(int session, const StereoConstraint& constraint) {
  Chain& chain = chains_[session];
  if (chain.session_from_camera.empty()) {
    PARALLAX_CHECK(constraint.from == 0, "the first constraint of a session does not begin with its first keyframe");
    chain.session_from_camera.emplace_back();
    chain.way_m.push_back(0);
    chain.rotation_variance.push_back(0);
    chain.translation_variance.push_back(0);
    chain.failures.push_back(0);
  }
  PARALLAX_CHECK(constraint.from + 1 == constraint.to && constraint.to == static_cast<int>(chain.way_m.size()),
                 "a constraint out of turn");
  chain.session_from_camera.push_back(chain.session_from_camera.back() * constraint.from_from_to);
  chain.session_from_camera.back().orthonormalise();
  chain.way_m.push_back(chain.way_m.back() + constraint.from_from_to.t.norm());
  chain.translation_variance.push_back(chain.translation_variance.back() +
                                       constraint.covariance.topLeftCorner<3, 3>().trace());
  chain.rotation_variance.push_back(chain.rotation_variance.back() +
                                    constraint.covariance.bottomRightCorner<3, 3>().trace());
  chain.failures.push_back(chain.failures.back() + (constraint.after_failure ? 1 : 0));
}

bool EncounterVote::knows(const PoseKey& key) const {
  const auto chain = chains_.find(key.session);
  return chain != chains_.end() && key.keyframe >= 0 && key.keyframe < static_cast<int>(chain->second.way_m.size());
}

EncounterVote::Pair EncounterVote::pair_of(const Encounter& encounter) {
  return {encounter.found.session, encounter.query.session};
}

double EncounterVote::way_between(int session, int a, int b) const {
  const Chain& chain = chains_.at(session);
  return std::abs(chain.way_m[static_cast<std::size_t>(a)] - chain.way_m[static_cast<std::size_t>(b)]);
}

Matrix6d EncounterVote::drift(const Chain& chain, std::size_t i, std::size_t j, double part, double rad_per_m) {
  const double way = std::abs(chain.way_m[i] - chain.way_m[j]);
  const double rotation =
      std::abs(chain.rotation_variance[i] - chain.rotation_variance[j]) + std::pow(rad_per_m * way, 2);
  const double translation = std::abs(chain.translation_variance[i] - chain.translation_variance[j]) +
                             std::pow(part * way, 2) + rotation * way * way / 3;
  return diagonal(translation, rotation);
}

bool EncounterVote::is_odometry_between(const Encounter& a, const Encounter& b) const {
  const std::vector<int>& found = chains_.at(a.found.session).failures;
  const std::vector<int>& query = chains_.at(a.query.session).failures;
  const auto at = [](const std::vector<int>& failures, const PoseKey& key) {
    return failures[static_cast<std::size_t>(key.keyframe)];
  };
  return at(found, a.found) == at(found, b.found) && at(query, a.query) == at(query, b.query);
}

double EncounterVote::disagreement(const Encounter& a, const Encounter& b) const {
  if (!is_odometry_between(a, b)) return std::numeric_limits<double>::infinity();
  const Chain& found = chains_.at(a.found.session);
  const Chain& query = chains_.at(a.query.session);
  const auto fa = static_cast<std::size_t>(a.found.keyframe), fb = static_cast<std::size_t>(b.found.keyframe);
  const auto qa = static_cast<std::size_t>(a.query.keyframe), qb = static_cast<std::size_t>(b.query.keyframe);
  const RigidTransform fa_from_fb = found.session_from_camera[fa].inverse() * found.session_from_camera[fb];
  const RigidTransform qb_from_qa = query.session_from_camera[qb].inverse() * query.session_from_camera[qa];
  // fa <- fb <- qb <- qa <- fa: the identity when both are right.
  const RigidTransform fa_from_qb = fa_from_fb * b.found_from_query, fa_from_qa = fa_from_qb * qb_from_qa;
  const RigidTransform cycle = fa_from_qa * a.found_from_query.inverse();
  const Matrix6d floor = diagonal(options_.floor_m * options_.floor_m, options_.floor_rad * options_.floor_rad);
  return squared_distance(
      cycle, drift(found, fa, fb, options_.drift_part, options_.drift_rad_per_m) + carried(fa_from_fb, b.covariance) +
                 carried(fa_from_qb, drift(query, qa, qb, options_.drift_part, options_.drift_rad_per_m)) +
                 a.covariance + 2 * floor);
}

double EncounterVote::disagreement_with_odometry(const Encounter& encounter) const {
  if (!encounter.within_session()) return 0;
  const Chain& chain = chains_.at(encounter.found.session);
  const auto f = static_cast<std::size_t>(encounter.found.keyframe),
             q = static_cast<std::size_t>(encounter.query.keyframe);
  if (chain.failures[f] != chain.failures[q]) return 0;
  const RigidTransform found_from_query = chain.session_from_camera[f].inverse() * chain.session_from_camera[q];
  const Matrix6d floor = diagonal(options_.floor_m * options_.floor_m, options_.floor_rad * options_.floor_rad);
  return squared_distance(
      found_from_query * encounter.found_from_query.inverse(),
      drift(chain, f, q, options_.loop_drift_part, options_.loop_drift_rad_per_m) + encounter.covariance + floor);
}

// Another place is recognised about as well by the same keyframe.
bool EncounterVote::is_ambiguous(const Encounter& encounter, const std::vector<Encounter>& all) const {
  return std::any_of(all.begin(), all.end(), [&](const Encounter& other) {
    return other.id != encounter.id && other.query == encounter.query && other.state != EncounterState::off &&
           encounter.inliers < options_.clearly_better * other.inliers && is_odometry_between(other, encounter) &&
           disagreement(other, encounter) > options_.gate;
  });
}

bool EncounterVote::is_enough(const std::vector<Encounter>& all, const std::vector<std::size_t>& together,
                              int needed) const {
  std::set<int> voices;
  for (const std::size_t i : together)
    if (!is_ambiguous(all[i], all)) voices.insert(all[i].query.keyframe);
  if (static_cast<int>(voices.size()) < needed) return false;
  const int stretch = *voices.rbegin() - *voices.begin() + 1;
  return static_cast<double>(voices.size()) >= options_.least_density * stretch;
}

EncounterVote::Verdict EncounterVote::add(const Encounter& encounter) {
  PARALLAX_CHECK(knows(encounter.found) && knows(encounter.query), "an encounter of keyframes that are not known");
  std::vector<Encounter>& all = encounters_[pair_of(encounter)];
  Verdict verdict;
  if (disagreement_with_odometry(encounter) > options_.gate) {
    all.push_back(encounter);
    all.back().state = EncounterState::refused;
    verdict.refuse.push_back(encounter.id);
    return verdict;
  }
  const auto distance = [&](const Encounter& other) {
    return std::max(way_between(encounter.found.session, encounter.found.keyframe, other.found.keyframe),
                    way_between(encounter.query.session, encounter.query.keyframe, other.query.keyframe));
  };
  // Those in the graph that are nearest: what it agrees with it joins, what it contradicts it has to outvote. With
  // those beyond a loss of motion it can do neither.
  std::vector<std::pair<double, std::size_t>> active;
  for (std::size_t i = 0; i < all.size(); ++i)
    if (all[i].state == EncounterState::active && is_odometry_between(all[i], encounter))
      active.emplace_back(distance(all[i]), i);
  std::sort(active.begin(), active.end());
  if (active.size() > kMostCompared) active.resize(kMostCompared);
  int supporters = 0;
  std::vector<std::size_t> rivals;
  for (const auto& [way, i] : active) {
    if (disagreement(all[i], encounter) > options_.gate)
      rivals.push_back(i);
    else if (way <= options_.reach_m)
      ++supporters;
  }
  all.push_back(encounter);
  Encounter& mine = all.back();
  mine.state = EncounterState::waiting;
  if (supporters > static_cast<int>(rivals.size())) {
    mine.state = EncounterState::active;
    verdict.activate.push_back(mine.id);
    return verdict;
  }
  // With the others that wait: those that agree with it and with each other, the best supported first.
  std::vector<std::size_t> others;
  for (std::size_t i = 0; i + 1 < all.size(); ++i)
    if (all[i].state == EncounterState::waiting && distance(all[i]) <= options_.reach_m &&
        disagreement(all[i], mine) <= options_.gate)
      others.push_back(i);
  std::stable_sort(others.begin(), others.end(),
                   [&](std::size_t a, std::size_t b) { return all[a].inliers > all[b].inliers; });
  std::vector<std::size_t> together{all.size() - 1};
  for (const std::size_t i : others)
    if (std::all_of(together.begin() + 1, together.end(),
                    [&](std::size_t j) { return disagreement(all[i], all[j]) <= options_.gate; }))
      together.push_back(i);
  const int needed = std::max(encounter.within_session() ? options_.within_session : options_.between_sessions,
                              2 * static_cast<int>(rivals.size()));
  if (!is_enough(all, together, needed)) return verdict;
  for (const std::size_t i : together) {
    all[i].state = EncounterState::active;
    verdict.activate.push_back(all[i].id);
  }
  for (const std::size_t i : rivals) {
    all[i].state = EncounterState::refused;
    verdict.refuse.push_back(all[i].id);
  }
  std::sort(verdict.activate.begin(), verdict.activate.end());
  return verdict;
}

void EncounterVote::restore(const Encounter& encounter) {
  std::vector<Encounter>& all = encounters_[pair_of(encounter)];
  const auto found = std::find_if(all.begin(), all.end(), [&](const Encounter& e) { return e.id == encounter.id; });
  if (found == all.end())
    all.push_back(encounter);
  else
    *found = encounter;
}

void EncounterVote::forget_session(int session) {
  chains_.erase(session);
  std::erase_if(encounters_,
                [&](const auto& entry) { return entry.first.first == session || entry.first.second == session; });
}

}  // namespace parallax
