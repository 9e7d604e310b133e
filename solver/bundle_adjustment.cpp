#include "solver/bundle_adjustment.h"

#include <algorithm>

#include "core/check.h"
#include "solver/schur_solver.h"

namespace parallax {

using solver::kCameraStride;
using RowMatrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

BundleSummary adjust_bundle(BundleProblem* problem, const BundleOptions& options, const Interruption& stop,
                            std::vector<std::uint8_t>* outlier) {
  PARALLAX_CHECK(problem->poses.size() == problem->pose_fixed.size(), "poses and pose_fixed of different size");
  solver::SchurProblem schur;
  schur.lens = solver::lens_parameters(problem->camera);
  schur.cameras.assign(problem->poses.size() * kCameraStride, 0.0);
  for (std::size_t i = 0; i < problem->poses.size(); ++i) {
    double* camera = schur.cameras.data() + i * kCameraStride;
    Eigen::Map<RowMatrix>{camera} = problem->poses[i].R;
    Eigen::Map<Eigen::Vector3d>{camera + 9} = problem->poses[i].t;
  }
  schur.camera_fixed = problem->pose_fixed;
  schur.points = problem->points;
  schur.observations = problem->observations;
  const BundleSummary summary = solver::solve_schur(schur, options, stop, outlier);
  if (summary.failed) return summary;
  for (std::size_t i = 0; i < problem->poses.size(); ++i) {
    const double* camera = schur.cameras.data() + i * kCameraStride;
    RigidTransform pose(Eigen::Matrix3d(Eigen::Map<const RowMatrix>(camera)),
                        Eigen::Map<const Eigen::Vector3d>(camera + 9));
    if (problem->pose_fixed[i] || (pose.R == problem->poses[i].R && pose.t == problem->poses[i].t)) continue;
    pose.orthonormalise();
    problem->poses[i] = pose;
  }
  return summary;
}

}  // namespace parallax
