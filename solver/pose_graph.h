// Batch optimisation of a pose graph, 2D or 3D, by its chordal cost
//   F = sum over the edges of kappa |R_to - R_from R|_F^2 + tau |t_to - t_from - R_from t|^2
// (Rosen, Carlone, Bandeira and Leonard, SE-Sync, IJRR 2019; no factor 1/2): a linear start that needs no guess, Gauss-
// Newton steps inside Powell's dog-leg on the sparse normal equations, a certificate that there is nothing lower, and
// where there is none, descent in a space of more dimensions and back.
//
// A 2D graph's poses turn about z and stay at z = 0. Poses are frame_from_pose; metres and radians. Plain values; one
// thread; same input, same bits. What is not connected to pose 0 is held at one pose of its own.
#pragma once

#include <vector>

#include "core/graph_file.h"
#include "core/interruption.h"
#include "core/se3.h"
#include "solver/robust_kernel.h"

namespace parallax {

struct PoseGraphEdge {
  int from = -1, to = -1;  // rows of the poses, different
  RigidTransform from_from_to;
  double kappa = 1, tau = 1;                 // precisions of rotation and translation, positive
  RobustKernel kernel = RobustKernel::none;  // through which the edge's part of F counts, in standard deviations
};

struct PoseGraph {
  bool planar = false;
  std::vector<RigidTransform> poses;
  std::vector<PoseGraphEdge> edges;
  double cost() const;  // F
};

// The graph of a g2o file, its vertices (those named by edges included) sorted by number, with the precisions of
// SE-Sync: tau = d / tr(Omega_t^-1), kappa = Omega_theta in 2D and 3 / (2 tr(Omega_R^-1)) in 3D. Vertices without a
// value in the file are placed along edges from those that have one. `ids` (may be null) gets the numbers of the
// vertices.
PoseGraph pose_graph_of(const GraphFile& file, std::vector<std::int64_t>* ids = nullptr);

struct PoseGraphOptions {
  // Starts from the linear (chordal) solution instead of the poses given; the better of both if that is not certified.
  bool find_start = true;
  // Tries to certify the result, and looks for a better one if that fails. Not with robust kernels.
  bool certify = true;
  int max_iterations = 200;
  double stop_below = 1e-10;    // relative decrease of F that a step promises
  double certify_below = 1e-5;  // relative gap between F and what is proven to be a lower bound of it
  int most_dimensions = 7;      // to which the search for a better optimum may rise

  void validate() const;  // throws InputError
};

struct PoseGraphSummary {
  double initial_cost = 0, final_cost = 0;
  int iterations = 0;  // linear systems solved on the way, not counting those of the certificate
  bool converged = false, stopped = false;
  bool certified = false;  // no poses have an F below lower_bound
  double lower_bound = 0;
  int dimensions = 0;  // the highest that the search rose to; 2 or 3: it was not needed
};

// Throws InputError for edges that are not usable (same or unknown poses, not finite, precisions that are not
// positive). Stopped: the best poses found until then.
PoseGraphSummary solve_pose_graph(PoseGraph* graph, const PoseGraphOptions& options = {},
                                  const Interruption& stop = {});

}  // namespace parallax
