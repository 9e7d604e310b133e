// Pose graphs, beside the figures of docs/pose-graph.md: batch (cost and time to the optimum, Ceres beside it), a pose
// at a time (milliseconds an update), and growth on a simulated building.
//
//   bench_pose_graph [batch] [ceres] [incremental] [growth [POSES [FILE.csv|FILE.svg]]] [FILE.g2o...]
//
// Without words: batch and incremental over the graphs of the data folder. Times are of this thread.
#include "solver/pose_graph.h"

#include <ceres/ceres.h>

#include <Eigen/LU>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <map>
#include <string>
#include <vector>

#include "app/session_report_svg.h"
#include "core/file_io.h"
#include "core/graph_file.h"
#include "core/time.h"
#include "solver/incremental_pose_graph.h"
#include "tests/solver/simulated_building.h"

using namespace parallax;

namespace {

double thread_ms() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) * 1e3 + static_cast<double>(t.tv_nsec) * 1e-6;
}

std::string name_of(const std::string& path) { return path.substr(path.find_last_of('/') + 1); }

// The residual of half of F for a quaternion and a position, with Ceres' own derivatives.
struct ChordalResidual {
  PoseGraphEdge e;
  template <class T>
  bool operator()(const T* qa, const T* ta, const T* qb, const T* tb, T* r) const {
    const Eigen::Map<const Eigen::Quaternion<T>> a(qa), b(qb);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> pa(ta), pb(tb);
    Eigen::Map<Eigen::Matrix<T, 3, 1>> rt(r), rr(r + 3);
    const Eigen::Quaternion<T> z(Eigen::Quaterniond(e.from_from_to.R).template cast<T>());
    const Eigen::Matrix<T, 3, 1> way = e.from_from_to.t.template cast<T>();
    rt = T(std::sqrt(2 * e.tau)) * (a.conjugate() * (pb - pa) - way);
    rr = T(std::sqrt(16 * e.kappa)) * (z.conjugate() * (a.conjugate() * b)).vec();
    return true;
  }
};

void run_ceres(const PoseGraph& graph) {
  std::vector<Eigen::Quaterniond> q;
  std::vector<Eigen::Vector3d> t;
  for (const RigidTransform& pose : graph.poses) {
    q.push_back(pose.quaternion());
    t.push_back(pose.t);
  }
  ceres::Problem problem;
  auto* manifold = new ceres::EigenQuaternionManifold;
  for (const PoseGraphEdge& e : graph.edges) {
    const auto a = static_cast<std::size_t>(e.from), b = static_cast<std::size_t>(e.to);
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<ChordalResidual, 6, 4, 3, 4, 3>(new ChordalResidual{e}),
                             nullptr, q[a].coeffs().data(), t[a].data(), q[b].coeffs().data(), t[b].data());
    problem.SetManifold(q[a].coeffs().data(), manifold);
    problem.SetManifold(q[b].coeffs().data(), manifold);
  }
  problem.SetParameterBlockConstant(q[0].coeffs().data());
  problem.SetParameterBlockConstant(t[0].data());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.max_num_iterations = 200;
  options.function_tolerance = 1e-10;
  ceres::Solver::Summary summary;
  const double start = thread_ms();
  ceres::Solve(options, &problem, &summary);
  std::printf("  %-22s F %14.7f  %9.1f ms  %3zu iterations (Ceres, from the file's start)\n", "", summary.final_cost,
              thread_ms() - start, summary.iterations.size());
}

void batch(const std::string& path, bool with_ceres) {
  const GraphFile file = read_graph_file(path);
  PoseGraph graph = pose_graph_of(file);
  const PoseGraph start = graph;
  const auto wall = SteadyClock::now();
  const double begin = thread_ms();
  const PoseGraphSummary s = solve_pose_graph(&graph);
  std::printf("  %-22s F %14.7f  %9.1f ms (wall %.1f)  %3d iterations  %s, bound %.7f, %zu poses, %zu edges\n",
              name_of(path).c_str(), s.final_cost, thread_ms() - begin, milliseconds_since(wall), s.iterations,
              s.certified ? "certified" : "not certified", s.lower_bound, graph.poses.size(), graph.edges.size());
  if (with_ceres && !graph.planar) run_ceres(start);
  std::fflush(stdout);
}

struct Times {
  std::vector<double> ms;
  void print(const char* name, const char* rest) {
    std::vector<double> sorted = ms;
    std::sort(sorted.begin(), sorted.end());
    double sum = 0;
    for (const double t : ms) sum += t;
    const std::size_t n = sorted.size();
    std::printf("  %-22s median %7.3f  p95 %7.3f  worst %7.1f  mean %7.3f ms%s\n", name, sorted[n / 2],
                sorted[std::min(n - 1, n * 95 / 100)], sorted.back(), sum / static_cast<double>(n), rest);
    std::fflush(stdout);
  }
};

// Of a left increment, from the file's right one; what a 2D edge leaves open is held tightly.
Matrix6d covariance_of(const GraphEdge& e, bool planar) {
  Matrix6d information = e.information;
  if (planar) information.diagonal().segment<3>(2).setConstant(1e4);
  const Matrix6d adjoint = e.from_from_to.adjoint(), c = adjoint * information.inverse() * adjoint.transpose();
  return 0.5 * (c + c.transpose());
}

void incremental(const std::string& path) {
  const GraphFile file = read_graph_file(path);
  std::vector<std::int64_t> ids;
  const PoseGraph rows = pose_graph_of(file, &ids);
  std::map<std::int64_t, int> row;
  for (std::size_t i = 0; i < ids.size(); ++i) row[ids[i]] = static_cast<int>(i);
  std::vector<std::vector<const GraphEdge*>> by_pose(ids.size());
  for (const GraphEdge& e : file.edges)
    by_pose[static_cast<std::size_t>(std::max(row[e.from], row[e.to]))].push_back(&e);
  IncrementalPoseGraph graph;
  Times times;
  for (int i = 0; i < static_cast<int>(ids.size()); ++i) {
    const auto& edges = by_pose[static_cast<std::size_t>(i)];
    // From the pose before, if an edge leads there.
    const GraphEdge* chain = nullptr;
    for (const GraphEdge* e : edges)
      if (chain == nullptr || std::min(row[e->from], row[e->to]) == i - 1) chain = e;
    RigidTransform initial;
    if (chain != nullptr)
      initial = row[chain->from] < i ? graph.pose(row[chain->from]) * chain->from_from_to
                                     : graph.pose(row[chain->to]) * chain->from_from_to.inverse();
    initial.orthonormalise();
    const double begin = thread_ms();
    graph.add_pose(initial);
    if (i == 0) graph.add_prior(0, initial, Matrix6d::Identity() * 1e-6);
    for (const GraphEdge* e : edges)
      graph.add_constraint(row[e->from], row[e->to], e->from_from_to, covariance_of(*e, file.planar));
    graph.update();
    times.ms.push_back(thread_ms() - begin);
  }
  const double end = graph.cost(), begin = thread_ms();
  const double best = graph.optimise().cost;
  char rest[120];
  std::snprintf(rest, sizeof rest, "  cost %.4f, batch from there %.4f in %.1f ms", end, best, thread_ms() - begin);
  times.print(name_of(path).c_str(), rest);
}

// Each update a dot, and the mean of the last 200 as a line.
std::string growth_plot(const std::vector<double>& ms) {
  PlotSeries each{"an update", {0x56, 0xb4, 0xe9}, false, false, {}};
  PlotSeries mean{"mean of 200", {0xd5, 0x5e, 0x00}, true, false, {}};
  constexpr std::size_t kMean = 200;
  double sum = 0;
  for (std::size_t i = 0; i < ms.size(); ++i) {
    each.points.push_back({static_cast<double>(i + 1), ms[i]});
    sum += ms[i] - (i < kMean ? 0 : ms[i - kMean]);
    if ((i + 1) % kMean == 0) mean.points.push_back({static_cast<double>(i + 1), sum / kMean});
  }
  PlotAxes axes;
  axes.width = SvgWidth::fixed;
  axes.id = "growth";
  axes.title = "pose graph, processor time an update";
  axes.x_label = "poses";
  axes.y_label = "ms";
  return plot_element({each, mean}, axes);
}

void growth(int poses, const std::string& file) {
  testing::SimulatedBuildingOptions options;
  options.poses = poses;
  const auto building = testing::make_building(options, 1);
  std::printf("simulated building: %d poses, %zu constraints\n", poses, building.measurements.size());
  IncrementalPoseGraph graph;
  Times all, some;
  std::string table = "poses,ms,work,eliminated,changed,waiting\n";
  std::size_t m = 0;
  for (int i = 0; i < poses; ++i) {
    const double begin = thread_ms();
    RigidTransform initial = building.truth[0];
    if (i > 0) initial = graph.pose(i - 1) * building.measurements[m].from_from_to;
    initial.orthonormalise();
    graph.add_pose(initial);
    if (i == 0) graph.add_prior(0, building.truth[0], Matrix6d::Identity() * 1e-6);
    for (; m < building.measurements.size() && building.measurements[m].to == i; ++m)
      graph.add_constraint(building.measurements[m].from, i, building.measurements[m].from_from_to,
                           building.measurements[m].covariance);
    const PoseGraphStep step = graph.update();
    const double ms = thread_ms() - begin;
    all.ms.push_back(ms);
    some.ms.push_back(ms);
    char line[120];
    std::snprintf(line, sizeof line, "%d,%.4f,%.0f,%d,%d,%d\n", i + 1, ms, step.work, step.eliminated, step.changed,
                  step.waiting);
    table += line;
    if ((i + 1) % 2000 == 0) {
      some.print(("up to " + std::to_string(i + 1)).c_str(), "");
      some.ms.clear();
    }
  }
  all.print("all", "");
  const double end = graph.cost();
  double begin = thread_ms();
  const double best = graph.optimise().cost;
  std::printf("  cost %.4f, batch from there %.4f in %.0f ms\n", end, best, thread_ms() - begin);
  Matrix6d covariance;
  begin = thread_ms();
  graph.marginal(poses - 1, &covariance);
  const double last = thread_ms() - begin;
  begin = thread_ms();
  graph.marginal(poses / 3, &covariance);
  std::printf("  covariance of the last pose %.2f ms, of one long ago %.2f ms\n", last, thread_ms() - begin);
  if (file.ends_with(".svg")) table = growth_plot(all.ms);
  if (!file.empty()) write_file_atomically(file, [&](std::ostream& out) { out << table; });
}

}  // namespace

int main(int argc, char** argv) {
  bool do_batch = false, do_ceres = false, do_incremental = false, any = false;
  std::vector<std::string> files;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "growth") {
      const bool number = i + 1 < argc && std::atoi(argv[i + 1]) > 0;
      const int poses = number ? std::atoi(argv[++i]) : 20000;
      const std::string next = i + 1 < argc ? argv[i + 1] : "";
      const bool is_file = next.ends_with(".csv") || next.ends_with(".svg");
      growth(poses, is_file ? next : "");
      i += is_file ? 1 : 0;
      any = true;
    } else if (word == "batch" || word == "ceres") {
      do_batch = true;
      do_ceres = do_ceres || word == "ceres";
    } else if (word == "incremental") {
      do_incremental = true;
    } else {
      files.push_back(word);
    }
  }
  if (!any && !do_batch && !do_incremental) do_batch = do_incremental = true;
  if (files.empty())
    for (const char* name : {"intel", "manhattan", "MIT", "sphere2500", "parking-garage", "smallGrid3D"})
      files.push_back(std::string(PARALLAX_DATA_DIR) + "/graphs/" + name + ".g2o");
  if (do_batch) std::printf("batch, from no guess, with the certificate\n");
  for (const std::string& file : files)
    if (do_batch) batch(file, do_ceres);
  if (do_incremental) std::printf("a pose at a time\n");
  for (const std::string& file : files)
    if (do_incremental) incremental(file);
}
