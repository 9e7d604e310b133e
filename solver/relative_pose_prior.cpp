#include "solver/relative_pose_prior.h"

#include <cmath>

namespace parallax::solver {

Vector6d prior_residual(const RelativePosePrior& prior, const RigidTransform& camera_a, const RigidTransform& camera_b,
                        Matrix6d* d_a, Matrix6d* d_b) {
  const RigidTransform b_from_a = camera_b * camera_a.inverse(), error = b_from_a * prior.b_from_a.inverse();
  const Eigen::Vector3d turn = log_so3(error.R);
  Vector6d e;
  e << error.t, turn;
  if (!d_a || !d_b) return e;
  // log(exp(w) R) = log R + J w with the inverse left Jacobian of the rotations.
  const double squared = turn.squaredNorm(), half = 0.5 * std::sqrt(squared);
  const double factor =
      squared < 1e-6 ? 1.0 / 12 + squared / 720 : (1 - half * std::cos(half) / std::sin(half)) / squared;
  const Eigen::Matrix3d W = hat(turn);
  d_b->setZero();
  d_b->topLeftCorner<3, 3>().setIdentity();
  d_b->topRightCorner<3, 3>() = -hat(error.t);
  d_b->bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() - 0.5 * W + factor * W * W;
  d_a->noalias() = -*d_b * b_from_a.adjoint();
  return e;
}

}  // namespace parallax::solver
