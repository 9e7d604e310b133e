// The parts of the batch pose-graph solver. Internal to solver/.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/interruption.h"
#include "solver/pose_graph.h"

namespace parallax::solver {

// One pose of every connected part, the first by number.
std::vector<int> first_of_parts(const PoseGraph& graph);

// Poses by linear least squares (Martinec and Pajdla 2007; Carlone et al. 2015): rotations as matrices without their
// constraints, made rotations afterwards, then translations. First poses of parts stay. False when stopped.
bool place_linearly(PoseGraph* graph, const Interruption& stop);
// Only the translations, given the rotations.
bool place_translations(PoseGraph* graph, const Interruption& stop);

// Gauss-Newton inside a dog-leg to a local optimum.
PoseGraphSummary descend(PoseGraph* graph, const PoseGraphOptions& options, const Interruption& stop);

// Poses of a graph in r >= d dimensions (d is 2 or 3): (Y p), r x (d + 1), with orthonormal columns in Y. d x (d + 1)
// for poses as they are.
using LiftedPose = Eigen::MatrixXd;
std::vector<LiftedPose> lifted(const PoseGraph& graph);
double lifted_cost(const PoseGraph& graph, const std::vector<LiftedPose>& poses);

// Whether the dual certificate matrix (SE-Sync, Eq. 34, with the translations left in) plus eta times the identity on
// the rotations is positive definite: then nothing has a cost below the present one less eta times the number of
// rotations' columns. Where not, and `direction` is given, it gets the direction of the most negative curvature: a row
// of d + 1 a pose.
struct Certificate {
  bool certified = false, stopped = false;
  double lower_bound = 0;
};
Certificate certify(const PoseGraph& graph, const std::vector<LiftedPose>& poses, double cost, double gap,
                    std::vector<Eigen::RowVectorXd>* direction, const Interruption& stop);

// Riemannian staircase: descends in r = d + 1, d + 2... dimensions from the poses along `direction` until certified or
// most_dimensions is reached, and projects the result to poses (to be refined by descend()). The dimensions reached;
// 0 when stopped.
int climb(PoseGraph* graph, std::vector<Eigen::RowVectorXd> direction, const PoseGraphOptions& options,
          const Interruption& stop);

}  // namespace parallax::solver
