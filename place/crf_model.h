// The learned part of CRF-Matching (MS §4.1): weights of the log-linear potentials for near and far features, and what
// makes two likelihoods comparable. Kept as text (assets/vocabulary/matching.crf), made by `parallax vocabulary
// train-crf`.
//
// Immutable once made, then safe from any thread.
#pragma once

#include <array>
#include <string>
#include <string_view>

namespace parallax {

enum class SceneGraph { near, far };

// A vertex is an outlier (state 0) or one of its candidates: the features of the other scene, of the same kind, whose
// descriptors are nearest.
inline constexpr int kCrfCandidates = 4;
inline constexpr int kCrfStates = kCrfCandidates + 1;

// What the potentials are made of; an outlier's local features are zero.
//   local, of a match:
//     match               1
//     descriptor          differing bits / 64
//     descriptor_squared  the square of that
//     size                near: |log2| of the ratio of the metric sizes, far: of the sizes in pixels; at most 3
//   pairwise, along an edge of the tree:
//     both                1 when both ends are matched
//     length              both matched: difference of the edge's lengths in the two scenes, in standard deviations
//                         (near, metres) or relative to their sum (far, pixels); saturates at 1
//     shape               both matched: near: |log| of the ratio of the lengths, far: difference of the two pixel
//                         vectors relative to their lengths; saturates at 1
//     shared              both matched to one and the same feature: 1
//     boundary            one end matched, the other not: 1
inline constexpr int kCrfLocal = 4, kCrfPair = 5, kCrfWeights = kCrfLocal + kCrfPair;
inline constexpr std::array<const char*, kCrfWeights> kCrfWeightNames = {
    "match", "descriptor", "descriptor_squared", "size", "both", "length", "shape", "shared", "boundary"};

struct CrfGraphModel {
  std::array<double, kCrfWeights> weight{};  // finite
  // Probability that a feature which the scene a second before explains is explained by another scene of the same
  // place. From 0.5 to 1, exclusive.
  double explained = 0.7;
};

struct CrfModel {
  CrfGraphModel near, far;

  const CrfGraphModel& of(SceneGraph graph) const { return graph == SceneGraph::near ? near : far; }
  CrfGraphModel& of(SceneGraph graph) { return graph == SceneGraph::near ? near : far; }

  // Throws InputError, one line with file and line, for anything that is not a whole model.
  static CrfModel load(const std::string& path);
  static CrfModel parse(std::string_view text, const std::string& name);
  // Throws RunError. The same model gives the same bytes, and reads back to the last bit.
  void save(const std::string& path) const;
  std::string text() const;
};

}  // namespace parallax
