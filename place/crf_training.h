// Learning the weights of CRF-Matching: the exact likelihood of labelled associations, which trees allow (Sutton and
// McCallum 2007), with a Gaussian prior, by L-BFGS (Nocedal 1980); and what makes likelihoods of scenes comparable.
//
// Plain functions, safe from any thread; deterministic.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/se3.h"
#include "place/crf_matching.h"

namespace parallax {

// Two scenes and the right state of each vertex. Pairs of scenes that show different places have state 0 throughout.
struct LabelledProblem {
  CrfProblem problem;
  std::vector<std::int32_t> state;
};

// Labels by known geometry. `points` are the true 3D points of the features of `from` and of `to`, each in its own left
// camera's frame, metres, NaN where not known (such a vertex is an outlier). Right is the candidate nearest to where
// the point is in `to`, at most `tolerance_px` of its level away, if it shows that point (to a tenth of its depth).
LabelledProblem label_problem(const StereoScene& from, const StereoScene& to, SceneGraph graph,
                              std::span<const Eigen::Vector3d> points, std::span<const Eigen::Vector3d> to_points,
                              const StereoCamera& to_camera, const RigidTransform& to_from_from,
                              double tolerance_px = 3);

struct CrfTrainingOptions {
  double prior_sigma = 10;  // standard deviation of a weight
  int iterations = 200;     // at most
  double tolerance = 1e-6;  // of the gradient's largest entry, relative to the number of vertices

  void validate() const;  // throws InputError naming the field
};

using CrfWeights = std::array<double, kCrfWeights>;

// The negative log-posterior of the weights, convex, and its gradient.
double crf_objective(std::span<const LabelledProblem> data, const CrfWeights& weight, double prior_sigma,
                     CrfWeights* gradient);

// The weights of the least objective. Throws InputError when there is no vertex with a candidate.
CrfWeights train_crf_weights(std::span<const LabelledProblem> data, const CrfTrainingOptions& options);

// A scene asked for with trained weights: of the features that the scene a second before explains, how many a candidate
// does not.
struct CrfEvidence {
  bool same_place = false;
  int explained_before = 0, missing = 0;
};

// The CrfGraphModel::explained that separates pairs of one place from others best at eta = beta (MS Eq. 5): the least
// sum of the two rates of errors, of which refusing the same place counts `refusal_weight` times (what is refused is
// lost, what is not has geometry to pass); of equally good ones the middle. 0.505 to 0.995.
double choose_explained(std::span<const CrfEvidence> evidence, double beta, double refusal_weight);

}  // namespace parallax
