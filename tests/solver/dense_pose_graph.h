// A slow, dense pose graph to hold the incremental one against: residuals written down once more, Jacobians by central
// differences of fourth order, all unknowns in one matrix.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <functional>
#include <vector>

#include "core/se3.h"
#include "solver/robust_kernel.h"

namespace parallax::testing {

struct DenseFactor {
  std::vector<int> poses;  // 1: prior, 2: constraint, 4: encounter
  RigidTransform measured;
  Matrix6d covariance;
  RobustKernel kernel = RobustKernel::none;
  bool active = true;
};

struct DensePoseGraph {
  std::vector<RigidTransform> poses;
  std::vector<DenseFactor> factors;

  // Left increment from what was measured to what the poses say.
  static Vector6d residual(const DenseFactor& f, const std::vector<RigidTransform>& x) {
    const auto pose = [&](std::size_t i) { return x[static_cast<std::size_t>(f.poses[i])]; };
    RigidTransform predicted = pose(0);
    if (f.poses.size() == 2) predicted = pose(0).inverse() * pose(1);
    if (f.poses.size() == 4) predicted = (pose(0) * pose(1)).inverse() * (pose(2) * pose(3));
    return (predicted * f.measured.inverse()).log();
  }
  double squared(const DenseFactor& f) const {
    const Vector6d e = residual(f, poses);
    return e.dot(f.covariance.ldlt().solve(e));
  }
  double cost() const {
    double sum = 0;
    for (const DenseFactor& f : factors) {
      const double c = kernel_width(f.kernel);
      if (f.active) sum += 0.5 * c * c * kernel_cost(f.kernel, squared(f) / (c * c));
    }
    return sum;
  }

  // J^T W J and J^T W r for left increments of all poses.
  void linearise(Eigen::MatrixXd* H, Eigen::VectorXd* g) const {
    const int n = 6 * static_cast<int>(poses.size());
    H->setZero(n, n);
    g->setZero(n);
    for (const DenseFactor& f : factors) {
      if (!f.active) continue;
      const double c = kernel_width(f.kernel);
      const Matrix6d W = kernel_weight(f.kernel, squared(f) / (c * c)) * f.covariance.inverse();
      Eigen::MatrixXd J = Eigen::MatrixXd::Zero(6, n);
      for (const int i : f.poses)
        for (int k = 0; k < 6; ++k) {
          const auto at = [&](double h) {
            std::vector<RigidTransform> moved = poses;
            RigidTransform& pose = moved[static_cast<std::size_t>(i)];
            pose = RigidTransform::exp(h * Vector6d::Unit(k)) * pose;
            return residual(f, moved);
          };
          constexpr double h = 1e-3;
          J.col(6 * i + k) = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h);
        }
      *H += J.transpose() * W * J;
      *g += J.transpose() * W * residual(f, poses);
    }
  }

  // Levenberg-Marquardt; what nothing determines stays.
  void optimise() {
    double damping = 1e-9, now = cost();
    Eigen::MatrixXd H;
    Eigen::VectorXd g;
    for (int iteration = 0; iteration < 60; ++iteration) {
      linearise(&H, &g);
      bool lower = false;
      for (int k = 0; k < 12 && !lower; ++k) {
        Eigen::MatrixXd damped = H;
        for (int i = 0; i < damped.rows(); ++i) damped(i, i) += damping * H(i, i) + 1e-12;
        const Eigen::VectorXd step = damped.ldlt().solve(-g);
        const std::vector<RigidTransform> before = poses;
        for (std::size_t i = 0; i < poses.size(); ++i)
          poses[i] = RigidTransform::exp(step.segment<6>(6 * static_cast<int>(i))) * poses[i];
        const double after = cost();
        if (after < now) {
          lower = true;
          damping = std::max(1e-12, damping * 0.1);
          if (now - after < 1e-13 * now) return;
          now = after;
        } else {
          poses = before;
          damping *= 10;
        }
      }
      if (!lower) return;
    }
  }

  // All of the covariance of left increments.
  Eigen::MatrixXd covariance() const {
    Eigen::MatrixXd H;
    Eigen::VectorXd g;
    linearise(&H, &g);
    return H.llt().solve(Eigen::MatrixXd::Identity(H.rows(), H.cols()));
  }
};

}  // namespace parallax::testing
