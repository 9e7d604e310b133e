#include "solver/pose_graph.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "core/error.h"
#include "solver/pose_graph_steps.h"

namespace parallax {
namespace {

double part_of(const PoseGraphEdge& e, const RigidTransform& from, const RigidTransform& to) {
  const double squared = e.kappa * (to.R - from.R * e.from_from_to.R).squaredNorm() +
                         e.tau * (to.t - from.t - from.R * e.from_from_to.t).squaredNorm();
  const double c = kernel_width(e.kernel);
  return c * c * kernel_cost(e.kernel, squared / (c * c));
}

void check(const PoseGraph& graph) {
  const int n = static_cast<int>(graph.poses.size());
  for (std::size_t i = 0; i < graph.edges.size(); ++i) {
    const PoseGraphEdge& e = graph.edges[i];
    const auto refuse = [&](const char* what) {
      throw InputError("pose graph: edge " + std::to_string(i) + ": " + what);
    };
    if (e.from < 0 || e.from >= n || e.to < 0 || e.to >= n)
      refuse("found a pose that is not there, expected one that is");
    if (e.from == e.to) refuse("found one pose twice, expected two poses");
    if (!e.from_from_to.R.allFinite() || !e.from_from_to.t.allFinite())
      refuse("found a transform that is not finite, expected numbers");
    if (!(e.kappa > 0) || !(e.tau > 0) || !std::isfinite(e.kappa) || !std::isfinite(e.tau))
      refuse("found a precision that is not positive, expected a positive one");
  }
  for (const RigidTransform& pose : graph.poses)
    if (!pose.R.allFinite() || !pose.t.allFinite())
      throw InputError("pose graph: found a pose that is not finite, expected numbers");
}

}  // namespace

double PoseGraph::cost() const {
  double sum = 0;
  for (const PoseGraphEdge& e : edges)
    sum += part_of(e, poses[static_cast<std::size_t>(e.from)], poses[static_cast<std::size_t>(e.to)]);
  return sum;
}

void PoseGraphOptions::validate() const {
  const auto require = [](bool ok, const char* text) {
    if (!ok) throw InputError(std::string("pose graph options: ") + text);
  };
  require(max_iterations >= 1, "max_iterations must be at least 1");
  require(stop_below > 0 && stop_below < 1, "stop_below must be in (0, 1)");
  require(certify_below > 0 && certify_below < 1, "certify_below must be in (0, 1)");
  require(most_dimensions >= 3 && most_dimensions <= 12, "most_dimensions must be in [3, 12]");
}

PoseGraph pose_graph_of(const GraphFile& file, std::vector<std::int64_t>* ids) {
  PoseGraph graph;
  graph.planar = file.planar;
  std::map<std::int64_t, int> row;
  for (const GraphVertex& v : file.vertices) row[v.id] = 0;
  for (const GraphEdge& e : file.edges) row[e.from] = row[e.to] = 0;
  if (ids != nullptr) ids->clear();
  for (auto& [id, index] : row) {
    index = static_cast<int>(graph.poses.size());
    graph.poses.emplace_back();
    if (ids != nullptr) ids->push_back(id);
  }
  std::vector<std::vector<int>> edges_of(graph.poses.size());
  for (const GraphEdge& from : file.edges) {
    PoseGraphEdge e;
    e.from = row[from.from];
    e.to = row[from.to];
    e.from_from_to = from.from_from_to;
    e.from_from_to.orthonormalise();
    if (file.planar) {
      const Eigen::Matrix2d t = from.information.topLeftCorner<2, 2>();
      e.tau = 2 / t.inverse().trace();
      e.kappa = from.information(5, 5);
    } else {
      const Eigen::Matrix3d t = from.information.topLeftCorner<3, 3>(), R = from.information.bottomRightCorner<3, 3>();
      e.tau = 3 / t.inverse().trace();
      e.kappa = 3 / (2 * R.inverse().trace());
    }
    edges_of[static_cast<std::size_t>(e.from)].push_back(static_cast<int>(graph.edges.size()));
    edges_of[static_cast<std::size_t>(e.to)].push_back(static_cast<int>(graph.edges.size()));
    graph.edges.push_back(e);
  }
  // Breadth first from the vertices with values, in the order of their numbers; then from what has none.
  std::vector<std::uint8_t> placed(graph.poses.size(), 0);
  std::vector<int> queue;
  for (const GraphVertex& v : file.vertices) {
    graph.poses[static_cast<std::size_t>(row[v.id])] = v.frame_from_vertex;
    placed[static_cast<std::size_t>(row[v.id])] = 1;
  }
  for (std::size_t i = 0; i < placed.size(); ++i)
    if (placed[i]) queue.push_back(static_cast<int>(i));
  for (std::size_t head = 0, next = 0; next <= graph.poses.size();) {
    if (head == queue.size()) {
      if (next < graph.poses.size() && !placed[next]) {
        placed[next] = 1;
        queue.push_back(static_cast<int>(next));
      }
      ++next;
      continue;
    }
    const int i = queue[head++];
    for (const int k : edges_of[static_cast<std::size_t>(i)]) {
      const PoseGraphEdge& e = graph.edges[static_cast<std::size_t>(k)];
      const auto other = static_cast<std::size_t>(e.from == i ? e.to : e.from);
      if (placed[other]) continue;
      graph.poses[other] =
          graph.poses[static_cast<std::size_t>(i)] * (e.from == i ? e.from_from_to : e.from_from_to.inverse());
      graph.poses[other].orthonormalise();
      placed[other] = 1;
      queue.push_back(static_cast<int>(other));
    }
  }
  return graph;
}

PoseGraphSummary solve_pose_graph(PoseGraph* graph, const PoseGraphOptions& options, const Interruption& stop) {
  options.validate();
  check(*graph);
  PoseGraphSummary total;
  total.initial_cost = total.final_cost = graph->cost();
  total.dimensions = graph->planar ? 2 : 3;
  if (graph->edges.empty()) {
    total.converged = true;
    return total;
  }
  const bool robust = std::any_of(graph->edges.begin(), graph->edges.end(),
                                  [](const PoseGraphEdge& e) { return e.kernel != RobustKernel::none; });
  // Descends from `start`, and keeps what it finds if that is better than the best until then.
  PoseGraph best = *graph;
  const auto try_start = [&](PoseGraph start) {
    const PoseGraphSummary s = solver::descend(&start, options, stop);
    total.iterations += s.iterations;
    total.stopped = s.stopped;
    if (!(s.final_cost < total.final_cost)) return false;
    total.final_cost = s.final_cost;
    total.converged = s.converged;
    best = std::move(start);
    return true;
  };
  std::vector<Eigen::RowVectorXd> direction;
  const auto certified = [&] {
    if (!options.certify || robust || total.stopped) return true;
    const solver::Certificate c = solver::certify(best, solver::lifted(best), total.final_cost,
                                                  options.certify_below * total.final_cost, &direction, stop);
    total.stopped = c.stopped;
    total.certified = c.certified;
    total.lower_bound = c.lower_bound;
    return c.certified || c.stopped;
  };
  bool done = false;
  if (options.find_start) {
    PoseGraph start = *graph;
    total.stopped = !solver::place_linearly(&start, stop);
    if (!total.stopped) try_start(std::move(start));
    done = options.certify && !robust && certified();
  }
  if (!done && !total.stopped && try_start(*graph)) done = certified();
  if (!options.find_start && !done && direction.empty()) done = certified();
  if (!done && !total.stopped && options.certify && !robust && !direction.empty()) {
    PoseGraph start = best;
    const int reached = solver::climb(&start, direction, options, stop);
    total.stopped = reached == 0;
    total.dimensions = std::max(total.dimensions, reached);
    if (!total.stopped && try_start(std::move(start))) certified();
  }
  *graph = std::move(best);
  return total;
}

}  // namespace parallax
