// CRF-Matching (Ramos, Fox and Durrant-Whyte 2007; Cadena et al. 2010, 2011; MS §4.1): the features of a scene are
// associated with those of another jointly. The conditional random field is the minimum spanning tree of the first
// scene's near or far features; a vertex is an outlier or one of its candidates in the other scene. Potentials
// are log-linear (place/crf_model.h), inference is exact (place/crf_tree.h).
//
// Plain functions, safe from any thread.
#pragma once

#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "place/crf_model.h"
#include "place/crf_tree.h"
#include "place/stereo_scene.h"

namespace parallax {

// What is known of two scenes before any weight: candidates, and the features of the potentials.
struct CrfProblem {
  std::vector<std::int32_t> parent;     // of each vertex
  std::vector<std::int32_t> feature;    // of each vertex: row of the first scene's features
  std::vector<std::int32_t> candidate;  // [vertex][state - 1]: row of the second scene's features
  std::vector<std::int32_t> states;     // of each vertex: one more than it has candidates
  std::vector<float> local;             // [vertex][state - 1][kCrfLocal]
  std::vector<float> pair;  // [vertex][parent's state - 1][state - 1][3]: length, shape, shared; both matched

  int size() const { return static_cast<int>(parent.size()); }
  std::int32_t candidate_at(int vertex, int state) const {
    return candidate[static_cast<std::size_t>(vertex * kCrfCandidates + state - 1)];
  }
};

// Candidates are the nearest by descriptor, at most 96 bits away, of equally near ones the earlier.
CrfProblem make_crf_problem(const StereoScene& from, const StereoScene& to, SceneGraph graph);

// The features of the potentials of a state, and of a pair of states (0: outlier), as crf_model.h lists them.
std::array<double, kCrfLocal> local_features(const CrfProblem& problem, int vertex, int state);
std::array<double, kCrfPair> pair_features(const CrfProblem& problem, int vertex, int parent_state, int state);

TreeField make_field(const CrfProblem& problem, const std::array<double, kCrfWeights>& weight);

struct CrfMatch {
  int vertices = 0;
  double negative_log = NAN;               // log Z - score of the best association
  std::vector<std::pair<int, int>> pairs;  // of that: row of a feature in the first scene, in the second; in order
};

// `likelihood`: negative_log too, else NaN.
CrfMatch match_by_crf(const StereoScene& from, const StereoScene& to, SceneGraph graph, const CrfGraphModel& model,
                      bool likelihood = false);

// Fewer features that the scene a second before explains say nothing.
inline constexpr int kLeastExplained = 12;

// Eq. 5 for scene t: `match` against a candidate t', `before` against the scene a second before, t-1. Lambda is the
// negative log-likelihood of the best association if both showed one place: of the features that t-1 explains (most
// are not found again in any other scene), those that are matched have the probability model.explained, the missing
// ones what is left. With e of n explained, Lambda(t, t') = -e log p - (n - e) log(1 - p), Lambda(t, t-1) = -n log p.
// NaN: t-1 explains too few.
//
// The likelihood of the association within the field, CrfMatch::negative_log, says how sure it is, not how good: that
// nothing matches is the surest of all.
double crf_eta(const CrfMatch& match, const CrfMatch& before, const CrfGraphModel& model);

// Features that `before` explains and `match` does not.
int missing_features(const CrfMatch& match, const CrfMatch& before);

}  // namespace parallax
