// Out of a local optimum by way of more dimensions (Boumal, A Riemannian low-rank method for optimization over
// semidefinite matrices with block-diagonal constraints, 2015; Rosen et al., SE-Sync, IJRR 2019, Alg. 1).
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <cmath>

#include "solver/pose_graph_steps.h"
#include "solver/sparse_elimination.h"

namespace parallax::solver {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

// The nearest matrix with orthonormal columns.
Eigen::MatrixXd orthonormal(const Eigen::MatrixXd& m) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(m, Eigen::ComputeThinU | Eigen::ComputeThinV);
  return svd.matrixU() * svd.matrixV().transpose();
}

// An orthonormal basis of the directions in which Y can move, r d x k, columns of Y stacked.
Eigen::MatrixXd tangent_basis(const Eigen::MatrixXd& Y) {
  const auto r = Y.rows(), d = Y.cols();
  Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(r * d, d * (d - 1) / 2 + (r - d) * d);
  const Eigen::MatrixXd Q = Eigen::HouseholderQR<Eigen::MatrixXd>(Y).householderQ();
  Eigen::Index k = 0;
  for (Eigen::Index a = 0; a < d; ++a)
    for (Eigen::Index b = a + 1; b < d; ++b, ++k) {
      basis.col(k).segment(a * r, r) = Y.col(b) * std::sqrt(0.5);
      basis.col(k).segment(b * r, r) = -Y.col(a) * std::sqrt(0.5);
    }
  for (Eigen::Index a = 0; a < d; ++a)
    for (Eigen::Index b = d; b < r; ++b, ++k) basis.col(k).segment(a * r, r) = Q.col(b);
  return basis;
}

// Levenberg-Marquardt in r dimensions. False when stopped.
bool descend_lifted(const PoseGraph& graph, std::vector<LiftedPose>* poses, const PoseGraphOptions& options,
                    const Interruption& stop) {
  const int d = graph.planar ? 2 : 3, n = static_cast<int>(poses->size()), r = static_cast<int>(poses->front().rows());
  const int turns = d * (d - 1) / 2 + (r - d) * d, block = turns + r;
  SparseElimination tree(block);
  for (int i = 0; i < n; ++i) tree.add_variable();
  for (const PoseGraphEdge& e : graph.edges) {
    const int both[2] = {e.from, e.to};
    tree.add_element(both);
  }
  std::vector<int> own;
  for (int i = 0; i < n; ++i) {
    const int one[1] = {i};
    own.push_back(tree.add_element(one));
  }
  double cost = lifted_cost(graph, *poses), damping = 1e-6;
  bool factored = false;
  std::vector<Eigen::MatrixXd> basis(poses->size());
  std::vector<int> changed;
  for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
    for (int i = 0; i < n; ++i) basis[at(i)] = tangent_basis((*poses)[at(i)].leftCols(d));
    std::vector<Eigen::VectorXd> diagonal(poses->size(), Eigen::VectorXd::Zero(block));
    for (std::size_t k = 0; k < graph.edges.size(); ++k) {
      const PoseGraphEdge& e = graph.edges[k];
      const LiftedPose &from = (*poses)[at(e.from)], &to = (*poses)[at(e.to)];
      const Eigen::MatrixXd R = e.from_from_to.R.topLeftCorner(d, d);
      const Eigen::VectorXd t = e.from_from_to.t.head(d);
      const double a = std::sqrt(e.kappa), b = std::sqrt(e.tau);
      Eigen::MatrixXd J = Eigen::MatrixXd::Zero(r * d + r, 2 * block);
      Eigen::VectorXd residual(r * d + r);
      const Eigen::MatrixXd turn = a * (to.leftCols(d) - from.leftCols(d) * R);
      residual << turn.reshaped(), b * (to.col(d) - from.col(d) - from.leftCols(d) * t);
      for (int q = 0; q < turns; ++q) {
        const Eigen::MatrixXd Z = basis[at(e.from)].col(q).reshaped(r, d);
        J.col(q) << (-a * (Z * R)).reshaped(), -b * (Z * t);
      }
      J.block(r * d, turns, r, r).diagonal().setConstant(-b);
      J.block(0, block, r * d, turns) = a * basis[at(e.to)];
      J.block(r * d, block + turns, r, r).diagonal().setConstant(b);
      auto values = tree.element(static_cast<int>(k));
      values.topRows(2 * block).noalias() = J.transpose() * J;
      values.bottomRows(1).noalias() = residual.transpose() * J;
      diagonal[at(e.from)] += values.diagonal().head(block);
      diagonal[at(e.to)] += values.diagonal().segment(block, block);
    }
    bool lower = false;
    double promised = 0, now = cost;
    for (int attempt = 0; attempt < 20 && !lower; ++attempt) {
      if (stop.requested()) return false;
      for (int i = 0; i < n; ++i) {
        auto values = tree.element(own[at(i)]);
        values.setZero();
        // The damping holds what turning and moving everything leaves free, too.
        values.topRows(block).diagonal() = damping * diagonal[at(i)];
      }
      const auto outcome = factored ? tree.refactor(stop) : tree.update({}, stop);
      if (outcome.stopped) return false;
      factored = true;
      tree.solve(0, &changed);
      std::vector<LiftedPose> tried = *poses;
      double moved = 0;
      for (int i = 0; i < n; ++i) {
        const Eigen::VectorXd step = tree.solution(i);
        moved = std::max(moved, step.cwiseAbs().maxCoeff());
        LiftedPose& x = tried[at(i)];
        x.leftCols(d) = orthonormal(x.leftCols(d) + (basis[at(i)] * step.head(turns)).reshaped(r, d));
        x.col(d) += step.tail(r);
      }
      now = lifted_cost(graph, tried);
      promised = cost - now;
      if (now < cost) {
        lower = true;
        *poses = std::move(tried);
        damping = std::max(1e-9, 0.2 * damping);
      } else {
        damping *= 8;
        if (moved < 1e-12) break;
      }
    }
    cost = now < cost ? now : cost;
    if (!lower || promised <= options.stop_below * cost) break;
  }
  return true;
}

// Poses of d dimensions nearest to the lifted ones, in the d dimensions in which these have their most.
void project(const std::vector<LiftedPose>& poses, PoseGraph* graph) {
  const int d = graph->planar ? 2 : 3, r = static_cast<int>(poses.front().rows());
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(r, r);
  for (const LiftedPose& x : poses) sum += x.leftCols(d) * x.leftCols(d).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(sum);
  Eigen::MatrixXd axes = eigen.eigenvectors().rightCols(d);
  // Of the two mirror images the one in which more poses are rotations.
  int right = 0;
  for (const LiftedPose& x : poses) right += (axes.transpose() * x.leftCols(d)).determinant() > 0 ? 1 : -1;
  if (right < 0) axes.col(0) *= -1;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Eigen::MatrixXd m = axes.transpose() * poses[i].leftCols(d);
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::VectorXd sign = Eigen::VectorXd::Ones(d);
    if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0) sign[d - 1] = -1;
    graph->poses[i].R.topLeftCorner(d, d) = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  }
}

}  // namespace

int climb(PoseGraph* graph, std::vector<Eigen::RowVectorXd> direction, const PoseGraphOptions& options,
          const Interruption& stop) {
  const int d = graph->planar ? 2 : 3;
  std::vector<LiftedPose> poses = lifted(*graph);
  const RigidTransform first = graph->poses.front();
  int r = d;
  double cost = lifted_cost(*graph, poses);
  for (;;) {
    ++r;
    // A little along the direction, in the new dimension: as far as the cost falls most.
    const auto along = [&](double length) {
      std::vector<LiftedPose> tried;
      for (std::size_t i = 0; i < poses.size(); ++i) {
        LiftedPose x(r, d + 1);
        x << poses[i], length * direction[i];
        x.leftCols(d) = orthonormal(x.leftCols(d));
        tried.push_back(std::move(x));
      }
      return tried;
    };
    const double size = std::sqrt(static_cast<double>(poses.size()));
    double best = 1e300, best_length = 1e-3 * size;
    for (double length = 1.0 * size; length > 1e-6 * size; length *= 0.5) {
      const double c = lifted_cost(*graph, along(length));
      if (c < best) {
        best = c;
        best_length = length;
      } else if (best < cost) {
        break;
      }
    }
    poses = along(best_length);
    if (!descend_lifted(*graph, &poses, options, stop)) return 0;
    cost = lifted_cost(*graph, poses);
    if (r >= options.most_dimensions) break;
    const Certificate c = certify(*graph, poses, cost, options.certify_below * cost, &direction, stop);
    if (c.stopped) return 0;
    if (c.certified || direction.empty()) break;
  }
  project(poses, graph);
  // Back to where the first pose was.
  const Eigen::Matrix3d turn = first.R * graph->poses.front().R.transpose();
  for (RigidTransform& pose : graph->poses) pose.R = turn * pose.R;
  graph->poses.front().t = first.t;
  return place_translations(graph, stop) ? r : 0;
}

}  // namespace parallax::solver
