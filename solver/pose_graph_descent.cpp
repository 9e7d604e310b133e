// Gauss-Newton inside Powell's dog-leg for the batch pose-graph solver.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "solver/dog_leg.h"
#include "solver/pose_graph_steps.h"
#include "solver/sparse_elimination.h"

namespace parallax::solver {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

// An edge's residual whose square is its part of F, as it depends on local increments (v, w) of its poses: R' = R
// exp(w), t' = t + R v. |R_to - R_from R|_F^2 = 8 sin^2(angle / 2): the vector of the quaternion serves.
struct Linear {
  Vector6d residual;
  Matrix6d from, to;
};

Linear linear(const PoseGraphEdge& e, const RigidTransform& from, const RigidTransform& to) {
  Linear l;
  const Eigen::Matrix3d turn = from.R.transpose() * to.R;
  const Eigen::Vector3d way = from.R.transpose() * (to.t - from.t);
  Eigen::Quaterniond q(Eigen::Matrix3d(e.from_from_to.R.transpose() * turn));
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  const double a = std::sqrt(e.tau), b = std::sqrt(8 * e.kappa);
  l.residual << a * (way - e.from_from_to.t), b * q.vec();
  const Eigen::Matrix3d scalar = 0.5 * b * q.w() * Eigen::Matrix3d::Identity(), vector = 0.5 * b * hat(q.vec());
  l.from.setZero();
  l.to.setZero();
  l.from.topLeftCorner<3, 3>().diagonal().setConstant(-a);
  l.from.topRightCorner<3, 3>() = a * hat(way);
  l.to.topLeftCorner<3, 3>() = a * turn;
  l.from.bottomRightCorner<3, 3>() = -(scalar - vector) * e.from_from_to.R.transpose();
  l.to.bottomRightCorner<3, 3>() = scalar + vector;
  const double c = kernel_width(e.kernel);
  const double weight = kernel_weight(e.kernel, l.residual.squaredNorm() / (c * c));
  if (weight != 1) {
    // What has no weight still holds its poses together, barely.
    const double root = std::sqrt(std::max(weight, 1e-6));
    l.residual *= weight / root;
    l.from *= root;
    l.to *= root;
  }
  return l;
}

// D unknowns a pose: 6, or 3 in the plane (rows 0, 1 and 5 of the six).
template <int D>
Eigen::Matrix<double, 6, D> columns(const Matrix6d& m) {
  if constexpr (D == 6) {
    return m;
  } else {
    Eigen::Matrix<double, 6, 3> r;
    r << m.col(0), m.col(1), m.col(5);
    return r;
  }
}

template <int D>
RigidTransform stepped(const RigidTransform& pose, const Eigen::Matrix<double, D, 1>& d) {
  Vector6d six = Vector6d::Zero();
  if constexpr (D == 6)
    six = d;
  else
    six << d[0], d[1], 0, 0, 0, d[2];
  return {pose.R * exp_so3(six.tail<3>()), pose.t + pose.R * six.head<3>()};
}

template <int D>
PoseGraphSummary descend_in(PoseGraph* graph, const PoseGraphOptions& options, const Interruption& stop) {
  using Block = Eigen::Matrix<double, D, 1>;
  using Jacobian = Eigen::Matrix<double, 6, D>;
  PoseGraphSummary summary;
  const int n = static_cast<int>(graph->poses.size());
  SparseElimination tree(D);
  for (int i = 0; i < n; ++i) tree.add_variable();
  for (const PoseGraphEdge& e : graph->edges) {
    const int both[2] = {e.from, e.to};
    tree.add_element(both);
  }
  for (const int i : first_of_parts(*graph)) {
    const int one[1] = {i};
    tree.element(tree.add_element(one)).diagonal().setOnes();
  }
  double cost = summary.initial_cost = graph->cost(), radius = -1;
  Eigen::VectorXd g(n * D), scale(n * D), h(n * D), d(n * D);
  std::vector<Jacobian, Eigen::aligned_allocator<Jacobian>> from(graph->edges.size()), to(graph->edges.size());
  std::vector<RigidTransform> tried;
  std::vector<int> changed;
  bool factored = false;
  while (summary.iterations < options.max_iterations && !summary.converged) {
    if (stop.requested()) {
      summary.stopped = true;
      break;
    }
    g.setZero();
    scale.setConstant(1e-12);
    for (std::size_t k = 0; k < graph->edges.size(); ++k) {
      const PoseGraphEdge& e = graph->edges[k];
      const Linear l = linear(e, graph->poses[at(e.from)], graph->poses[at(e.to)]);
      const Jacobian a = from[k] = columns<D>(l.from), b = to[k] = columns<D>(l.to);
      auto values = tree.element(static_cast<int>(k));
      values.template block<D, D>(0, 0).noalias() = a.transpose() * a;
      values.template block<D, D>(D, 0).noalias() = b.transpose() * a;
      values.template block<D, D>(D, D).noalias() = b.transpose() * b;
      const Block ga = a.transpose() * l.residual, gb = b.transpose() * l.residual;
      values.template block<1, D>(2 * D, 0) = ga.transpose();
      values.template block<1, D>(2 * D, D) = gb.transpose();
      g.template segment<D>(e.from * D) += ga;
      g.template segment<D>(e.to * D) += gb;
      scale.template segment<D>(e.from * D) += values.template block<D, D>(0, 0).diagonal();
      scale.template segment<D>(e.to * D) += values.template block<D, D>(D, D).diagonal();
    }
    const auto outcome = factored ? tree.refactor(stop) : tree.update({}, stop);
    if (outcome.stopped) {
      summary.stopped = true;
      break;
    }
    factored = true;
    ++summary.iterations;
    tree.solve(0, &changed);
    for (int i = 0; i < n; ++i) h.template segment<D>(i * D) = tree.solution(i);
    d = -g.cwiseQuotient(scale);
    DogLegInner in;
    in.dd = d.dot(scale.cwiseProduct(d));
    in.dh = d.dot(scale.cwiseProduct(h));
    in.hh = h.dot(scale.cwiseProduct(h));
    in.gd = g.dot(d);
    in.gh = g.dot(h);
    for (std::size_t k = 0; k < graph->edges.size(); ++k)
      in.d_h_d += (from[k] * d.template segment<D>(graph->edges[k].from * D) +
                   to[k] * d.template segment<D>(graph->edges[k].to * D))
                      .squaredNorm();
    if (radius < 0) radius = std::sqrt(in.hh);
    for (;;) {
      const DogLegStep step = dog_leg_step(in, radius);
      // gain is of half of F.
      const bool small = 2 * step.gain <= options.stop_below * cost && step.along_d == 0;
      tried = graph->poses;
      for (int i = 0; i < n; ++i)
        tried[at(i)] = stepped<D>(graph->poses[at(i)], Block(step.along_d * d.template segment<D>(i * D) +
                                                             step.along_h * h.template segment<D>(i * D)));
      std::swap(tried, graph->poses);
      const double now = graph->cost();
      radius = dog_leg_radius(radius, step.length, (cost - now) / (2 * step.gain));
      if (now < cost) {
        summary.converged = small;
        cost = now;
        break;
      }
      std::swap(tried, graph->poses);
      if (small || !(radius > 1e-12 * std::sqrt(in.hh)) || stop.requested()) {
        summary.converged = small || 2 * step.gain <= 1e-9 * cost;
        summary.final_cost = cost;
        return summary;
      }
    }
  }
  for (RigidTransform& pose : graph->poses) pose.orthonormalise();
  summary.final_cost = graph->cost();
  return summary;
}

}  // namespace

PoseGraphSummary descend(PoseGraph* graph, const PoseGraphOptions& options, const Interruption& stop) {
  return graph->planar ? descend_in<3>(graph, options, stop) : descend_in<6>(graph, options, stop);
}

}  // namespace parallax::solver
