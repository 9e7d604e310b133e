// The minimal relative pose problem: all real essential matrices of five ray pairs (Nister, An Efficient Solution to
// the Five-Point Relative Pose Problem, PAMI 2004; Stewenius, Engels and Nister 2006; PTAM §6.1).
//
// The essential matrix is a combination of the four null vectors of the 5x9 epipolar system; its ten cubic constraints
// are reduced to one polynomial of degree ten, whose real roots are isolated between the roots of its derivatives and
// polished on the constraints themselves. Plain functions on plain values; safe from any thread; no allocation.
#pragma once

#include <Eigen/Core>
#include <array>

#include "core/se3.h"

namespace parallax {

struct FivePointSolutions {
  std::array<Eigen::Matrix3d, 10> essential;  // ray2^T E ray1 = 0, Frobenius norm 1, sign arbitrary
  int count = 0;
};

// Rays of each camera in any scale (not zero). Gives no solution when the system is degenerate beyond repair (fewer
// than five different pairs may still give some).
void solve_five_point(const std::array<Eigen::Vector3d, 5>& rays1, const std::array<Eigen::Vector3d, 5>& rays2,
                      FivePointSolutions* solutions);

// The four poses of an essential matrix (|t| = 1): the two rotations, each with +t and -t (Nister 2004, Theorem 2).
std::array<RigidTransform, 4> poses_of_essential(const Eigen::Matrix3d& essential);

// E = hat(t) R.
Eigen::Matrix3d essential_of_pose(const RigidTransform& second_from_first);

}  // namespace parallax
