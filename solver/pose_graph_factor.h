// Residuals of a pose graph in 3D and how they change with the poses: a prior, a relative constraint (McDonald et al.
// 2012, Eq. 3) and an encounter between two sessions by way of their anchors (Eq. 6). Not whitened.
//
// A residual is the left increment that takes what was measured to what the poses say: predicted = exp(residual) *
// measured, translation first. Jacobians are with respect to a local increment of a pose, moved(pose, d): rotation and
// translation apart, in the pose's own frame, which to first order is pose * exp(d).
#pragma once

#include "core/se3.h"

namespace parallax::solver {

// R' = R exp(w), t' = t + R v for d = (v, w); and the d that takes one pose to another.
RigidTransform moved(const RigidTransform& pose, const Vector6d& d);
Vector6d move_between(const RigidTransform& pose, const RigidTransform& to);

// moved(origin, d + e) = moved(moved(origin, d), D e) to first order in e.
Matrix6d move_jacobian(const Vector6d& d);

// The inverse of the left Jacobian of SE(3): log(exp(e) T) = log(T) + J^-1(log T) e to first order. Rotations below 2
// pi.
Matrix6d inverse_left_jacobian(const Vector6d& log);

// Jacobians may be null.
Vector6d prior_residual(const RigidTransform& frame_from_pose, const RigidTransform& pose, Matrix6d* d_pose);
Vector6d constraint_residual(const RigidTransform& from_from_to, const RigidTransform& from, const RigidTransform& to,
                             Matrix6d* d_from, Matrix6d* d_to);
// Predicted: (anchor_from * from)^-1 * (anchor_to * to).
Vector6d encounter_residual(const RigidTransform& from_from_to, const RigidTransform& anchor_from,
                            const RigidTransform& from, const RigidTransform& anchor_to, const RigidTransform& to,
                            Matrix6d* d_anchor_from, Matrix6d* d_from, Matrix6d* d_anchor_to, Matrix6d* d_to);

}  // namespace parallax::solver
