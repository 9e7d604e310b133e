// A lower bound of a pose graph's cost, from Lagrangian duality (Rosen et al., SE-Sync, IJRR 2019, §3.3).
#include <Eigen/Cholesky>
#include <cmath>
#include <random>

#include "solver/pose_graph_steps.h"
#include "solver/sparse_elimination.h"

namespace parallax::solver {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

// The edge's quadratic form over the rows [Y_from p_from Y_to p_to].
Eigen::MatrixXd form_of(const PoseGraphEdge& e, int d) {
  Eigen::MatrixXd translation = Eigen::MatrixXd::Zero(2 * (d + 1), 1), rotation = Eigen::MatrixXd::Zero(2 * (d + 1), d);
  translation.col(0).head(d) = -e.from_from_to.t.head(d);
  translation(d, 0) = -1;
  translation(2 * d + 1, 0) = 1;
  rotation.topRows(d) = -e.from_from_to.R.topLeftCorner(d, d);
  rotation.middleRows(d + 1, d).setIdentity();
  return e.tau * translation * translation.transpose() + e.kappa * rotation * rotation.transpose();
}

}  // namespace

std::vector<LiftedPose> lifted(const PoseGraph& graph) {
  const int d = graph.planar ? 2 : 3;
  std::vector<LiftedPose> poses;
  for (const RigidTransform& pose : graph.poses) {
    LiftedPose x(d, d + 1);
    x << pose.R.topLeftCorner(d, d), pose.t.head(d);
    poses.push_back(x);
  }
  return poses;
}

double lifted_cost(const PoseGraph& graph, const std::vector<LiftedPose>& poses) {
  const int d = graph.planar ? 2 : 3;
  double sum = 0;
  for (const PoseGraphEdge& e : graph.edges) {
    const LiftedPose &from = poses[at(e.from)], &to = poses[at(e.to)];
    sum += e.kappa * (to.leftCols(d) - from.leftCols(d) * e.from_from_to.R.topLeftCorner(d, d)).squaredNorm() +
           e.tau * (to.col(d) - from.col(d) - from.leftCols(d) * e.from_from_to.t.head(d)).squaredNorm();
  }
  return sum;
}

Certificate certify(const PoseGraph& graph, const std::vector<LiftedPose>& poses, double cost, double gap,
                    std::vector<Eigen::RowVectorXd>* direction, const Interruption& stop) {
  const int d = graph.planar ? 2 : 3, n = static_cast<int>(poses.size()), block = d + 1;
  Certificate result;
  SparseElimination tree(block);
  for (int i = 0; i < n; ++i) tree.add_variable();
  // Q, and Q X^T, of which the multipliers are made.
  std::vector<Eigen::MatrixXd> gradient(poses.size(), Eigen::MatrixXd::Zero(poses[0].rows(), block));
  double largest = 0;
  for (const PoseGraphEdge& e : graph.edges) {
    const int both[2] = {e.from, e.to};
    const Eigen::MatrixXd form = form_of(e, d);
    auto values = tree.element(tree.add_element(both));
    values.topRows(2 * block) = form;
    values.bottomRows(1).setZero();
    Eigen::MatrixXd x(poses[0].rows(), 2 * block);
    x << poses[at(e.from)], poses[at(e.to)];
    const Eigen::MatrixXd product = x * form;
    gradient[at(e.from)] += product.leftCols(block);
    gradient[at(e.to)] += product.rightCols(block);
    largest = std::max(largest, form.diagonal().maxCoeff());
  }
  std::vector<Eigen::MatrixXd> multiplier;
  std::vector<int> own;
  for (int i = 0; i < n; ++i) {
    const Eigen::MatrixXd m = poses[at(i)].leftCols(d).transpose() * gradient[at(i)].leftCols(d);
    multiplier.push_back(0.5 * (m + m.transpose()));
    const int one[1] = {i};
    own.push_back(tree.add_element(one));
  }
  std::vector<std::uint8_t> first(poses.size(), 0);
  for (const int i : first_of_parts(graph)) first[at(i)] = 1;
  bool factored = false;
  // 1: positive definite with eta, 0: not, -1: stopped.
  const auto positive = [&](double eta) {
    for (int i = 0; i < n; ++i) {
      auto values = tree.element(own[at(i)]);
      values.setZero();
      values.topLeftCorner(d, d) = eta * Eigen::MatrixXd::Identity(d, d) - multiplier[at(i)];
      // The position of the first pose is free; fixing it at 0 takes nothing away.
      if (first[at(i)]) values(d, d) = largest;
    }
    const auto outcome = factored ? tree.refactor(stop) : tree.update({}, stop);
    if (outcome.stopped) return -1;
    factored = true;
    return outcome.lost == 0 ? 1 : 0;
  };
  double eta = gap / (static_cast<double>(n) * d);
  int found = positive(eta);
  result.stopped = found < 0;
  result.certified = found == 1;
  if (result.certified) result.lower_bound = cost - gap;
  if (found != 0) return result;
  // The smallest shift by powers of ten that makes it positive is the bound that there is.
  for (int k = 0; k < 40 && found == 0; ++k) {
    eta *= 4;
    found = positive(eta);
  }
  result.stopped = found < 0;
  if (found != 1) return result;
  result.lower_bound = std::max(0.0, cost - eta * n * d);
  if (direction == nullptr) return result;
  // Inverse iteration on S x = (lambda + eta) M x, M the identity on the rotations.
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  Eigen::VectorXd x(n * block);
  for (Eigen::Index i = 0; i < x.size(); ++i) x[i] = i % block == d ? 0 : normal(random);
  constexpr int kIterations = 30;
  for (int k = 0; k < kIterations; ++k) {
    if (stop.requested()) {
      result.stopped = true;
      return result;
    }
    for (int i = 0; i < n; ++i) x[i * block + d] = 0;
    x /= x.norm();
    tree.solve_in_place(&x);
  }
  double norm = 0;
  for (int i = 0; i < n; ++i) norm += x.segment(i * block, d).squaredNorm();
  x /= std::sqrt(norm);
  direction->clear();
  for (int i = 0; i < n; ++i) direction->emplace_back(x.segment(i * block, block).transpose());
  return result;
}

}  // namespace parallax::solver
