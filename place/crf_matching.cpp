#include "place/crf_matching.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/descriptor_search.h"

namespace parallax {
namespace {

constexpr int kMostBits = 96;            // further descriptors are no candidates
constexpr float kBitsScale = 64;         // so many bits are 1
constexpr float kMostOctaves = 3;        // of the ratio of sizes
constexpr float kLengthSigmas = 6;       // where the difference of 3D lengths saturates
constexpr float kLengthFloor_m = 0.02F;  // of an edge's length, however well its ends are known
constexpr float kPixelFloor = 4;         // added to the lengths of edges in the image
constexpr std::size_t kStoredPair = 3;

std::size_t at_pair(int vertex, int parent_state, int state) {
  return static_cast<std::size_t>((vertex * kCrfCandidates + parent_state - 1) * kCrfCandidates + state - 1) *
         kStoredPair;
}

std::size_t at_local(int vertex, int state) {
  return static_cast<std::size_t>((vertex * kCrfCandidates + state - 1) * kCrfLocal);
}

// An edge of the near graph in one scene: its length and how well it is known. A depth is known less well than a
// direction; the edge takes of the depth's error what lies along it.
struct MetricEdge {
  float length = 0, variance = 0;
};
MetricEdge metric_edge(const StereoScene& scene, std::size_t i, std::size_t j) {
  const Eigen::Vector3f edge = scene.points[i] - scene.points[j];
  MetricEdge out;
  out.length = edge.norm();
  const float along = out.length > 1e-6F ? edge.z() / out.length : 1.0F;
  const float si = scene.depth_sigma[i], sj = scene.depth_sigma[j];
  out.variance = along * along * (si * si + sj * sj);
  return out;
}

std::vector<BinaryDescriptor> descriptors_at(const StereoScene& scene, const std::vector<std::int32_t>& rows) {
  std::vector<BinaryDescriptor> out;
  out.reserve(rows.size());
  for (const std::int32_t row : rows) out.push_back(scene.features[static_cast<std::size_t>(row)].descriptor);
  return out;
}

void fill_near_pair(const StereoScene& from, const StereoScene& to, std::size_t i, std::size_t parent, std::size_t b,
                    std::size_t b_parent, float* out) {
  const MetricEdge here = metric_edge(from, i, parent), there = metric_edge(to, b, b_parent);
  const float sigma = std::sqrt(here.variance + there.variance + kLengthFloor_m * kLengthFloor_m);
  out[0] = std::min(std::abs(here.length - there.length) / (kLengthSigmas * sigma), 1.0F);
  out[1] = std::min(std::abs(std::log((here.length + kLengthFloor_m) / (there.length + kLengthFloor_m))), 1.0F);
}

void fill_far_pair(const StereoScene& from, const StereoScene& to, std::size_t i, std::size_t parent, std::size_t b,
                   std::size_t b_parent, float* out) {
  const Eigen::Vector2f here = from.features[i].pixel - from.features[parent].pixel;
  const Eigen::Vector2f there = to.features[b].pixel - to.features[b_parent].pixel;
  const float l = here.norm(), m = there.norm(), sum = l + m + 2 * kPixelFloor;
  out[0] = std::min(2 * std::abs(l - m) / sum, 1.0F);
  out[1] = std::min((here - there).norm() / sum * 2, 1.0F);
}

}  // namespace

CrfProblem make_crf_problem(const StereoScene& from, const StereoScene& to, SceneGraph graph) {
  const bool near = graph == SceneGraph::near;
  const FeatureTree& tree = near ? from.near_tree : from.far_tree;
  const std::vector<std::int32_t>& others = (near ? to.near_tree : to.far_tree).feature;
  CrfProblem out;
  out.parent = tree.parent;
  out.feature = tree.feature;
  const std::size_t n = tree.feature.size();
  out.states.assign(n, 1);
  out.candidate.assign(n * kCrfCandidates, -1);
  out.local.assign(n * kCrfCandidates * kCrfLocal, 0);
  out.pair.assign(n * kCrfCandidates * kCrfCandidates * kStoredPair, 0);
  const DescriptorSet set(descriptors_at(to, others));
  std::vector<std::uint16_t> distances;
  for (int v = 0; v < out.size() && !others.empty(); ++v) {
    const auto i = static_cast<std::size_t>(tree.feature[static_cast<std::size_t>(v)]);
    std::array<std::pair<int, std::int32_t>, kCrfCandidates> best;  // bits, row
    best.fill({kMostBits + 1, -1});
    if (set.distances(from.features[i].descriptor, &distances) <= kMostBits) {
      for (std::size_t k = 0; k < others.size(); ++k) {
        std::pair<int, std::int32_t> one{distances[k], others[k]};
        if (one >= best.back()) continue;
        best.back() = one;
        for (std::size_t s = kCrfCandidates - 1; s > 0 && best[s] < best[s - 1]; --s) std::swap(best[s], best[s - 1]);
      }
    }
    int& states = out.states[static_cast<std::size_t>(v)];
    for (const auto& [bits, row] : best) {
      if (row < 0) break;
      const int state = states++;
      out.candidate[static_cast<std::size_t>(v * kCrfCandidates + state - 1)] = row;
      float* local = out.local.data() + at_local(v, state);
      const float d = static_cast<float>(bits) / kBitsScale;
      local[0] = 1;
      local[1] = d;
      local[2] = d * d;
      local[3] = std::min(std::abs(std::log2(from.size[i] / to.size[static_cast<std::size_t>(row)])), kMostOctaves);
    }
    const int parent = tree.parent[static_cast<std::size_t>(v)];
    if (parent < 0) continue;
    const auto at_parent = static_cast<std::size_t>(tree.feature[static_cast<std::size_t>(parent)]);
    for (int sp = 1; sp < out.states[static_cast<std::size_t>(parent)]; ++sp) {
      for (int s = 1; s < states; ++s) {
        const std::int32_t b = out.candidate_at(v, s), b_parent = out.candidate_at(parent, sp);
        float* pair = out.pair.data() + at_pair(v, sp, s);
        (near ? fill_near_pair : fill_far_pair)(from, to, i, at_parent, static_cast<std::size_t>(b),
                                                static_cast<std::size_t>(b_parent), pair);
        pair[2] = b == b_parent ? 1.0F : 0.0F;
      }
    }
  }
  return out;
}

std::array<double, kCrfLocal> local_features(const CrfProblem& problem, int vertex, int state) {
  std::array<double, kCrfLocal> out{};
  if (state == 0) return out;
  const float* local = problem.local.data() + at_local(vertex, state);
  for (std::size_t k = 0; k < out.size(); ++k) out[k] = local[k];
  return out;
}

std::array<double, kCrfPair> pair_features(const CrfProblem& problem, int vertex, int parent_state, int state) {
  if (parent_state == 0 || state == 0) return {0, 0, 0, 0, parent_state == state ? 0.0 : 1.0};
  const float* pair = problem.pair.data() + at_pair(vertex, parent_state, state);
  return {1, pair[0], pair[1], pair[2], 0};
}

TreeField make_field(const CrfProblem& problem, const std::array<double, kCrfWeights>& weight) {
  TreeField field(problem.parent, kCrfStates);
  field.states = problem.states;
  for (int v = 0; v < problem.size(); ++v) {
    const int states = problem.states[static_cast<std::size_t>(v)],
              parent = problem.parent[static_cast<std::size_t>(v)];
    for (int s = 1; s < states; ++s) {
      const auto f = local_features(problem, v, s);
      double sum = 0;
      for (std::size_t k = 0; k < f.size(); ++k) sum += weight[k] * f[k];
      field.local_at(v, s) = sum;
    }
    if (parent < 0) continue;
    for (int sp = 0; sp < problem.states[static_cast<std::size_t>(parent)]; ++sp) {
      for (int s = 0; s < states; ++s) {
        const auto f = pair_features(problem, v, sp, s);
        double sum = 0;
        for (std::size_t k = 0; k < f.size(); ++k) sum += weight[kCrfLocal + k] * f[k];
        field.pair_at(v, sp, s) = sum;
      }
    }
  }
  return field;
}

CrfMatch match_by_crf(const StereoScene& from, const StereoScene& to, SceneGraph graph, const CrfGraphModel& model,
                      bool likelihood) {
  CrfMatch out;
  const CrfProblem problem = make_crf_problem(from, to, graph);
  out.vertices = problem.size();
  const TreeField field = make_field(problem, model.weight);
  std::vector<std::int32_t> assignment;
  const double score = best_assignment(field, &assignment);
  for (int v = 0; v < problem.size(); ++v) {
    const int state = assignment[static_cast<std::size_t>(v)];
    if (state == 0) continue;
    out.pairs.emplace_back(problem.feature[static_cast<std::size_t>(v)], problem.candidate_at(v, state));
  }
  std::sort(out.pairs.begin(), out.pairs.end());
  if (likelihood) out.negative_log = std::max(0.0, log_partition(field) - score);
  return out;
}

int missing_features(const CrfMatch& match, const CrfMatch& before) {
  int missing = 0;
  auto at = match.pairs.begin();
  for (const auto& pair : before.pairs) {
    while (at != match.pairs.end() && at->first < pair.first) ++at;
    missing += at == match.pairs.end() || at->first != pair.first ? 1 : 0;
  }
  return missing;
}

double crf_eta(const CrfMatch& match, const CrfMatch& before, const CrfGraphModel& model) {
  const auto n = static_cast<int>(before.pairs.size());
  if (n < kLeastExplained) return std::numeric_limits<double>::quiet_NaN();
  const double found = -std::log(model.explained), missing = -std::log1p(-model.explained);
  const int m = missing_features(match, before);
  return ((n - m) * found + m * missing) / (n * found);
}

}  // namespace parallax
