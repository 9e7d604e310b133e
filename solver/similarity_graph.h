// A graph of similarity transforms: nodes are frames against a common world, edges are measured transforms between two
// of them; least squares over the nodes by Levenberg-Marquardt on the sparse normal equations. What closes a loop with
// the drift of scale in it (Strasdat, Montiel and Davison, Scale Drift-Aware Large Scale Monocular SLAM, RSS 2010).
//
// Arrays and indices; units of the caller. Not for two threads on one graph at once.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/interruption.h"
#include "core/se3.h"
#include "solver/robust_kernel.h"

namespace parallax {

using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix7d = Eigen::Matrix<double, 7, 7>;

// Seven numbers to a transform: (translation, rotation vector, logarithm of the scale), taken apart from each other,
// and back. Not the group's logarithm: its parts keep their units, which is what weights are given in.
Vector7d similarity_vector(const SimilarityTransform& transform);
SimilarityTransform similarity_of_vector(const Vector7d& vector);

// node_a * node_b^-1 was measured as `a_from_b`. The residual is similarity_vector(a_from_b^-1 * node_a * node_b^-1),
// weighted by the information (symmetric, positive definite).
struct SimilarityEdge {
  int a = -1, b = -1;  // rows of the nodes
  SimilarityTransform a_from_b;
  Matrix7d information = Matrix7d::Identity();
  RobustKernel kernel = RobustKernel::none;  // its width is that of robust_kernel.h, in standard deviations
};

struct SimilarityGraph {
  std::vector<SimilarityTransform> nodes;  // node_from_world
  std::vector<std::uint8_t> fixed;         // as many as nodes; at least one is fixed in every connected part
  std::vector<SimilarityEdge> edges;
};

struct SimilarityGraphOptions {
  int max_iterations = 50;
  double stop_below = 1e-10;  // relative change of the cost
};

struct SimilarityGraphSummary {
  double initial_cost = 0, final_cost = 0;
  int iterations = 0;
  bool converged = false, stopped = false,
       failed = false;  // failed: nothing was found that lowers the cost, not finite
};

// Residual of an edge, and how it changes with node' = similarity_of_vector(d) * node for either of its nodes (may be
// null).
Vector7d similarity_residual(const SimilarityTransform& a_from_b, const SimilarityTransform& node_a,
                             const SimilarityTransform& node_b, Matrix7d* d_a, Matrix7d* d_b);

// Half the sum of the weighted squares, through the edges' kernels.
double similarity_cost(const SimilarityGraph& graph);

// Moves the nodes that are not fixed.
SimilarityGraphSummary adjust_similarity_graph(SimilarityGraph* graph, const SimilarityGraphOptions& options,
                                               const Interruption& stop);

}  // namespace parallax
