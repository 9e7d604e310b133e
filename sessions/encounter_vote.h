// Whether an encounter may bend the pose graph. One alone never does: it waits until others, seen from other keyframes
// nearby, tell of the same meeting. Two agree when the cycle found -> found' -> query' -> query -> found closes within
// what the odometry between them can have drifted and the encounters' own covariances. Encounters that contradict
// active ones need twice as many on their side. Buildings repeat themselves: those that agree must be seen from most of
// the keyframes on their stretch of the way, a keyframe that recognises two places equally well has no voice, and
// within a session the odometry from the one keyframe to the other has a say as far as it can be trusted.
//
// MS §4.2 leaves the choice among several candidates open; a wrong loop is what a map does not recover from.
// Not thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "sessions/session_types.h"

namespace parallax {

struct EncounterVoteOptions {
  // Encounters from different keyframes that agree, before any of them counts; within a session, and between two, where
  // no odometry leads from one to the other.
  int within_session = 3, between_sessions = 6;
  double least_density = 0.5;   // part of the keyframes on their stretch that have a voice among those that agree
  double clearly_better = 1.5;  // times the inliers of another place that the same keyframe recognises
  double reach_m = 6;           // along the way, for two to speak of the same meeting
  double gate = 22.46;          // squared Mahalanobis distance; 99.9 % of chi-square with 6 degrees of freedom
  // What odometry may have drifted, one standard deviation, beside its own covariances: of nearby encounters...
  double drift_part = 0.01;  // of the way
  double drift_rad_per_m = 0.002;
  // ... and all the way round a loop, where rotations have time to average (MS §5.1 tells of 1 to 3 percent).
  double loop_drift_part = 0.01, loop_drift_rad_per_m = 0.0003;
  double floor_m = 0.01, floor_rad = 0.003;  // of an encounter

  // Throws InputError when a value is out of range.
  void validate() const;
};

class EncounterVote {
 public:
  explicit EncounterVote(const EncounterVoteOptions& options = {});

  // Odometry between consecutive keyframes, in order, from keyframe 0 on.
  void extend(int session, const StereoConstraint& constraint);
  bool knows(const PoseKey& key) const;

  struct Verdict {
    std::vector<std::int64_t> activate, refuse;
  };
  // Both keyframes are known; ids are unique. What is to change among all encounters so far.
  Verdict add(const Encounter& encounter);
  // An encounter with the state it has had (from a database), or one whose state the user has changed.
  void restore(const Encounter& encounter);
  void forget_session(int session);

  // Odometry leads from the one to the other in both sessions: it was not lost between them.
  bool is_odometry_between(const Encounter& a, const Encounter& b) const;
  // Squared Mahalanobis distance of the cycle through two encounters between the same two sessions; infinite when the
  // odometry between them was lost.
  double disagreement(const Encounter& a, const Encounter& b) const;
  // The same of an encounter within a session and the odometry from its one keyframe to the other; 0 between sessions,
  // and where odometry was lost on the way.
  double disagreement_with_odometry(const Encounter& encounter) const;

 private:
  struct Chain {
    std::vector<RigidTransform> session_from_camera;              // odometry alone
    std::vector<double> way_m;                                    // from keyframe 0
    std::vector<double> rotation_variance, translation_variance;  // summed, of odometry
    std::vector<int> failures;                                    // so far
  };
  using Pair = std::pair<int, int>;

  static Pair pair_of(const Encounter& encounter);
  double way_between(int session, int a, int b) const;
  bool is_ambiguous(const Encounter& encounter, const std::vector<Encounter>& all) const;
  bool is_enough(const std::vector<Encounter>& all, const std::vector<std::size_t>& together, int needed) const;
  static Matrix6d drift(const Chain& chain, std::size_t i, std::size_t j, double part, double rad_per_m);

  EncounterVoteOptions options_;
  std::map<int, Chain> chains_;
  std::map<Pair, std::vector<Encounter>> encounters_;
};

}  // namespace parallax
