// libFuzzer target: pose graphs in g2o's text form; what is read is written and read again, and solved, in batch and
// incrementally, however ill-posed.
#include <Eigen/LU>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "core/error.h"
#include "core/graph_file.h"
#include "solver/incremental_pose_graph.h"
#include "solver/pose_graph.h"

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace parallax;
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    const GraphFile file = parse_graph(text, "graph.g2o");
    const GraphFile again = parse_graph(format_graph(file), "written.g2o");
    require(again.vertices.size() == file.vertices.size() && again.edges.size() == file.edges.size());
    require(again.fixed == file.fixed &&
            (again.planar == file.planar || file.vertices.size() + file.edges.size() == 0));
    if (file.vertices.size() > 30 || file.edges.size() > 60) return 0;
    PoseGraph graph = pose_graph_of(file);
    IncrementalPoseGraph incremental;
    for (const RigidTransform& pose : graph.poses)
      if (incremental.add_pose(pose) < 0) return 0;
    for (const PoseGraphEdge& e : graph.edges) {
      Matrix6d covariance = Matrix6d::Identity();
      covariance.topLeftCorner<3, 3>() /= e.tau;
      covariance.bottomRightCorner<3, 3>() /= e.kappa;
      incremental.add_constraint(e.from, e.to, e.from_from_to, covariance, RobustKernel::huber);
      incremental.update();
    }
    for (int i = 0; i < incremental.poses(); ++i)
      require(incremental.pose(i).R.allFinite() && incremental.pose(i).t.allFinite());
    PoseGraphOptions options;
    options.max_iterations = 5;
    options.most_dimensions = 4;
    const PoseGraphSummary summary = solve_pose_graph(&graph, options);
    require(!(summary.final_cost > summary.initial_cost));
  } catch (const InputError& error) {
    require(std::string(error.what()).find('\n') == std::string::npos);
  }
  return 0;
}
