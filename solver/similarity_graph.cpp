#include "solver/similarity_graph.h"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <cmath>

#include "core/check.h"

namespace parallax {
namespace {

// Damping: multiples of the diagonal.
constexpr double kFirstDamping = 1e-6, kLargestDamping = 1e8, kDampingUp = 10, kDampingDown = 0.1;
// The smallest diagonal that damping is a multiple of.
constexpr double kLeastDiagonal = 1e-9;

// Inverse of the left Jacobian of SO(3): how the rotation vector changes when a small rotation is multiplied from the
// left. Finite up to a full turn.
Eigen::Matrix3d left_jacobian_inverse(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  const Eigen::Matrix3d W = hat(w);
  double c = 1.0 / 12;
  if (angle > 1e-4) {
    const double half = 0.5 * angle;
    c = (1 - half * std::cos(half) / std::sin(half)) / (angle * angle);
  }
  return Eigen::Matrix3d::Identity() - 0.5 * W + c * W * W;
}

double kernel_scale(RobustKernel kernel) { return kernel_width(kernel) * kernel_width(kernel); }

double edge_cost(const SimilarityEdge& edge, const std::vector<SimilarityTransform>& nodes) {
  const Vector7d r = similarity_residual(edge.a_from_b, nodes[static_cast<std::size_t>(edge.a)],
                                         nodes[static_cast<std::size_t>(edge.b)], nullptr, nullptr);
  const double c2 = kernel_scale(edge.kernel);
  return 0.5 * c2 * kernel_cost(edge.kernel, r.dot(edge.information * r) / c2);
}

double cost_of(const std::vector<SimilarityEdge>& edges, const std::vector<SimilarityTransform>& nodes) {
  double sum = 0;
  for (const SimilarityEdge& edge : edges) sum += edge_cost(edge, nodes);
  return sum;
}

// The lower triangle of the normal equations over the nodes that move.
class NormalEquations {
 public:
  explicit NormalEquations(const SimilarityGraph& graph) : graph_(graph), row_(graph.nodes.size(), -1) {
    int rows = 0;
    for (std::size_t i = 0; i < graph.nodes.size(); ++i)
      if (!graph.fixed[i]) row_[i] = 7 * rows++;
    matrix_.resize(7 * rows, 7 * rows);
    gradient_.resize(7 * rows);
  }

  int size() const { return static_cast<int>(gradient_.size()); }
  int row_of(std::size_t node) const { return row_[node]; }

  void build() {
    entries_.clear();
    gradient_.setZero();
    for (int i = 0; i < size(); ++i) entries_.emplace_back(i, i, 0.0);
    for (const SimilarityEdge& edge : graph_.edges) add(edge);
    matrix_.setFromTriplets(entries_.begin(), entries_.end());
    diagonal_ = matrix_.diagonal().cwiseMax(kLeastDiagonal);
  }

  // The step of the damped equations; false when they cannot be solved.
  bool solve(double damping, Eigen::VectorXd* step) {
    Eigen::SparseMatrix<double> damped = matrix_;
    for (int i = 0; i < size(); ++i) damped.coeffRef(i, i) += damping * diagonal_[i];
    if (!analysed_) solver_.analyzePattern(damped);
    analysed_ = true;
    solver_.factorize(damped);
    if (solver_.info() != Eigen::Success) return false;
    *step = solver_.solve(-gradient_);
    return step->allFinite();
  }

 private:
  void add(const SimilarityEdge& edge) {
    const auto a = static_cast<std::size_t>(edge.a), b = static_cast<std::size_t>(edge.b);
    Matrix7d d_a, d_b;
    const Vector7d r = similarity_residual(edge.a_from_b, graph_.nodes[a], graph_.nodes[b], &d_a, &d_b);
    const double weight = kernel_weight(edge.kernel, r.dot(edge.information * r) / kernel_scale(edge.kernel));
    const Matrix7d information = weight * edge.information;
    const int row_a = row_[a], row_b = row_[b];
    if (row_a >= 0) {
      add_block(row_a, row_a, d_a.transpose() * information * d_a);
      gradient_.segment<7>(row_a) += d_a.transpose() * (information * r);
    }
    if (row_b >= 0) {
      add_block(row_b, row_b, d_b.transpose() * information * d_b);
      gradient_.segment<7>(row_b) += d_b.transpose() * (information * r);
    }
    if (row_a < 0 || row_b < 0) return;
    if (row_a > row_b) {
      add_block(row_a, row_b, d_a.transpose() * information * d_b);
    } else {
      add_block(row_b, row_a, d_b.transpose() * information * d_a);
    }
  }
  void add_block(int row, int column, const Matrix7d& block) {
    for (int i = 0; i < 7; ++i)
      for (int j = 0; j < 7; ++j)
        if (row + i >= column + j) entries_.emplace_back(row + i, column + j, block(i, j));
  }

  const SimilarityGraph& graph_;
  std::vector<int> row_;
  std::vector<Eigen::Triplet<double>> entries_;
  Eigen::SparseMatrix<double> matrix_;
  Eigen::VectorXd gradient_, diagonal_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower> solver_;
  bool analysed_ = false;
};

}  // namespace

Vector7d similarity_vector(const SimilarityTransform& transform) {
  Vector7d out;
  out << transform.t, log_so3(transform.R), std::log(transform.s);
  return out;
}

SimilarityTransform similarity_of_vector(const Vector7d& vector) {
  return {std::exp(vector[6]), exp_so3(vector.segment<3>(3)), vector.head<3>()};
}

Vector7d similarity_residual(const SimilarityTransform& a_from_b, const SimilarityTransform& node_a,
                             const SimilarityTransform& node_b, Matrix7d* d_a, Matrix7d* d_b) {
  const SimilarityTransform now = node_a * node_b.inverse();
  const Vector7d residual = similarity_vector(a_from_b.inverse() * now);
  const Eigen::Vector3d angle = residual.segment<3>(3);
  const Eigen::Matrix3d b_from_a = a_from_b.R.transpose();
  if (d_a) {
    d_a->setZero();
    const Eigen::Matrix3d unit = b_from_a / a_from_b.s;
    d_a->block<3, 3>(0, 0) = unit;
    d_a->block<3, 3>(0, 3) = -unit * hat(now.t);
    d_a->block<3, 1>(0, 6) = unit * now.t;
    d_a->block<3, 3>(3, 3) = left_jacobian_inverse(angle) * b_from_a;
    (*d_a)(6, 6) = 1;
  }
  if (d_b) {
    d_b->setZero();
    d_b->block<3, 3>(0, 0) = -(now.s / a_from_b.s) * (b_from_a * now.R);
    d_b->block<3, 3>(3, 3) = -left_jacobian_inverse(-angle);
    (*d_b)(6, 6) = -1;
  }
  return residual;
}

double similarity_cost(const SimilarityGraph& graph) { return cost_of(graph.edges, graph.nodes); }

SimilarityGraphSummary adjust_similarity_graph(SimilarityGraph* graph, const SimilarityGraphOptions& options,
                                               const Interruption& stop) {
  PARALLAX_CHECK(graph->fixed.size() == graph->nodes.size(), "every node is fixed or not");
  for (const SimilarityEdge& edge : graph->edges) {
    const int nodes = static_cast<int>(graph->nodes.size());
    PARALLAX_CHECK(edge.a >= 0 && edge.b >= 0 && edge.a < nodes && edge.b < nodes && edge.a != edge.b,
                   "an edge joins two nodes");
  }
  SimilarityGraphSummary out;
  double cost = out.initial_cost = out.final_cost = similarity_cost(*graph);
  NormalEquations equations(*graph);
  if (equations.size() == 0) {
    out.converged = true;
    return out;
  }
  double damping = kFirstDamping;
  while (out.iterations < options.max_iterations && !out.converged && !out.failed) {
    if (stop.requested()) {
      out.stopped = true;
      break;
    }
    ++out.iterations;
    equations.build();
    for (bool lower = false; !lower;) {
      Eigen::VectorXd step;
      std::vector<SimilarityTransform> moved = graph->nodes;
      double moved_cost = INFINITY;
      if (equations.solve(damping, &step)) {
        for (std::size_t i = 0; i < moved.size(); ++i)
          if (equations.row_of(i) >= 0)
            moved[i] = similarity_of_vector(step.segment<7>(equations.row_of(i))) * moved[i];
        moved_cost = cost_of(graph->edges, moved);
      }
      lower = moved_cost <= cost;
      if (lower) {
        out.converged = cost - moved_cost <= options.stop_below * cost;
        graph->nodes = std::move(moved);
        cost = moved_cost;
        damping = std::max(kDampingDown * damping, 1e-12);
      } else {
        damping *= kDampingUp;
        if (!(damping < kLargestDamping)) {
          // At the limit of the arithmetic nothing is lower; before any step it is a failure.
          out.failed = out.iterations == 1;
          out.converged = !out.failed;
          break;
        }
      }
    }
  }
  for (SimilarityTransform& node : graph->nodes) {
    RigidTransform rotation(node.R, Eigen::Vector3d::Zero());
    rotation.orthonormalise();
    node.R = rotation.R;
  }
  out.final_cost = cost;
  return out;
}

}  // namespace parallax
