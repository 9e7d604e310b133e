// The residual of a prior on two poses of a window (RelativePosePrior, solver/window_smoothing.h). Internal to solver/.
#pragma once

#include "solver/window_smoothing.h"

namespace parallax::solver {

// (t, log R) of camera_b_from_camera_a * b_from_a^-1, and its derivatives with respect to move_pose() of either pose,
// when both are asked for.
Vector6d prior_residual(const RelativePosePrior& prior, const RigidTransform& camera_a, const RigidTransform& camera_b,
                        Matrix6d* d_a, Matrix6d* d_b);

}  // namespace parallax::solver
