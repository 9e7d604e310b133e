// Levenberg-Marquardt over cameras and points with the points eliminated (Schur complement): the engine below
// bundle_adjustment.h and bal_problem.h. Hartley and Zisserman, appendix A6; Triggs et al., Bundle Adjustment, 2000.
//
// An iteration streams twice over the observations, sorted by point, and keeps no Jacobian: the first pass linearises,
// eliminates each point and adds to the reduced camera system; the second back-substitutes and evaluates the new state.
// Rotations are changed by left increments (PTAM Eq. 6); what else a camera has, by addition.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/camera_model.h"
#include "core/interruption.h"
#include "solver/bundle_adjustment.h"
#include "solver/solver_kernels.h"

namespace parallax::solver {

LensParameters lens_parameters(const CameraModel& camera);

struct SchurProblem {
  LensParameters lens;
  std::vector<double> cameras;  // kCameraStride a camera: see solver_kernels.h
  std::span<const std::uint8_t> camera_fixed;
  std::span<Eigen::Vector3d> points;
  std::span<const BundleObservation> observations;
};

// Adjusts `cameras` and `points` in place; see adjust_bundle() for the rest.
BundleSummary solve_schur(SchurProblem& problem, const BundleOptions& options, const Interruption& stop,
                          std::vector<std::uint8_t>* outlier);

}  // namespace parallax::solver
