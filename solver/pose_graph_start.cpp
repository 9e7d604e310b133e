// The linear start of the batch pose-graph solver.
#include <Eigen/LU>
#include <Eigen/SVD>

#include "solver/pose_graph_steps.h"
#include "solver/sparse_elimination.h"

namespace parallax::solver {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

}  // namespace

std::vector<int> first_of_parts(const PoseGraph& graph) {
  std::vector<int> part(graph.poses.size());
  for (std::size_t i = 0; i < part.size(); ++i) part[i] = static_cast<int>(i);
  const auto find = [&](int i) {
    while (part[at(i)] != i) i = part[at(i)] = part[at(part[at(i)])];
    return i;
  };
  for (const PoseGraphEdge& e : graph.edges) {
    const int a = find(e.from), b = find(e.to);
    part[at(std::max(a, b))] = std::min(a, b);
  }
  std::vector<int> first;
  for (std::size_t i = 0; i < part.size(); ++i)
    if (part[i] == static_cast<int>(i)) first.push_back(static_cast<int>(i));
  return first;
}

bool place_translations(PoseGraph* graph, const Interruption& stop) {
  const int d = graph->planar ? 2 : 3;
  SparseElimination tree(1, d);
  for (std::size_t i = 0; i < graph->poses.size(); ++i) tree.add_variable();
  for (const PoseGraphEdge& e : graph->edges) {
    const int both[2] = {e.from, e.to};
    auto values = tree.element(tree.add_element(both));
    values << e.tau, 0, -e.tau, e.tau, Eigen::MatrixXd::Zero(d, 2);
    const Eigen::Vector3d way = e.tau * (graph->poses[at(e.from)].R * e.from_from_to.t);
    values.bottomRows(d).col(0) = way.head(d);
    values.bottomRows(d).col(1) = -way.head(d);
  }
  for (const int i : first_of_parts(*graph)) {
    const int one[1] = {i};
    auto values = tree.element(tree.add_element(one));
    values(0, 0) = 1;
    values.bottomRows(d).col(0) = -graph->poses[at(i)].t.head(d);
  }
  if (tree.update({}, stop).stopped) return false;
  std::vector<int> changed;
  tree.solve(0, &changed);
  for (std::size_t i = 0; i < graph->poses.size(); ++i)
    graph->poses[i].t.head(d) = tree.solution(static_cast<int>(i)).row(0).transpose();
  return true;
}

bool place_linearly(PoseGraph* graph, const Interruption& stop) {
  // Unknown are the transposes of the rotations: R_to^T = R^T R_from^T, a column at a time.
  const int d = graph->planar ? 2 : 3;
  SparseElimination tree(d, d);
  for (std::size_t i = 0; i < graph->poses.size(); ++i) tree.add_variable();
  for (const PoseGraphEdge& e : graph->edges) {
    const int both[2] = {e.from, e.to};
    auto values = tree.element(tree.add_element(both));
    values.setZero();
    values.topRows(2 * d).diagonal().setConstant(e.kappa);
    values.block(d, 0, d, d) = -e.kappa * e.from_from_to.R.topLeftCorner(d, d).transpose();
  }
  for (const int i : first_of_parts(*graph)) {
    const int one[1] = {i};
    auto values = tree.element(tree.add_element(one));
    values.setZero();
    values.topRows(d).diagonal().setOnes();
    values.bottomRows(d) = -graph->poses[at(i)].R.topLeftCorner(d, d);
  }
  if (tree.update({}, stop).stopped) return false;
  std::vector<int> changed;
  tree.solve(0, &changed);
  for (std::size_t i = 0; i < graph->poses.size(); ++i) {
    RigidTransform& pose = graph->poses[i];
    const Eigen::MatrixXd R = tree.solution(static_cast<int>(i)).transpose();
    if (d == 2) {
      const double angle = std::atan2(R(1, 0) - R(0, 1), R(0, 0) + R(1, 1));
      pose.R = exp_so3(Eigen::Vector3d(0, 0, angle));
      continue;
    }
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(Eigen::Matrix3d(R), Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Vector3d sign(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
    pose.R = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  }
  return place_translations(graph, stop);
}

}  // namespace parallax::solver
