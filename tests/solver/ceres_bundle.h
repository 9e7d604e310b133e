// The same bundle adjustment by Ceres, with analytic Jacobians: what ours is held against.
#pragma once

#include <ceres/ceres.h>

#include <memory>

#include "core/camera_model.h"
#include "core/se3.h"
#include "solver/bal_problem.h"
#include "solver/bundle_adjustment.h"

namespace parallax::testing {

// Left Jacobian of SO(3): exp(w + d) = exp(J d) exp(w) to first order.
inline Eigen::Matrix3d left_jacobian(const Eigen::Vector3d& w) {
  const double t2 = w.squaredNorm(), t = std::sqrt(t2);
  const Eigen::Matrix3d W = hat(w);
  if (t2 < 1e-10) return Eigen::Matrix3d::Identity() + 0.5 * W;
  return Eigen::Matrix3d::Identity() + (1 - std::cos(t)) / t2 * W + (t - std::sin(t)) / (t2 * t) * W * W;
}

// Parameters: pose (translation, rotation vector), point.
class CeresReprojection : public ceres::SizedCostFunction<2, 6, 3> {
 public:
  CeresReprojection(const CameraModel& camera, const BundleObservation& o) : camera_(camera), o_(o) {}
  bool Evaluate(double const* const* x, double* residual, double** jacobian) const override {
    const Eigen::Map<const Eigen::Vector3d> t(x[0]), w(x[0] + 3), point(x[1]);
    const Eigen::Matrix3d R = exp_so3(w);
    const Eigen::Vector3d rotated = R * point;
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> j;
    if (!camera_.project(rotated + t, &pixel, &j)) return false;
    const double s = 1 / o_.sigma_px;
    Eigen::Map<Eigen::Vector2d>{residual} = s * (pixel - o_.pixel);
    if (!jacobian) return true;
    using Pose = Eigen::Matrix<double, 2, 6, Eigen::RowMajor>;
    using Point = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
    if (jacobian[0]) {
      Eigen::Map<Pose> out(jacobian[0]);
      out.leftCols<3>() = s * j;
      out.rightCols<3>().noalias() = -s * j * hat(rotated) * left_jacobian(w);
    }
    if (jacobian[1]) Eigen::Map<Point>{jacobian[1]} = s * j * R;
    return true;
  }

 private:
  const CameraModel& camera_;
  const BundleObservation o_;
};

// Parameters: a BAL camera, point.
class CeresBal : public ceres::SizedCostFunction<2, 9, 3> {
 public:
  explicit CeresBal(const BundleObservation& o) : o_(o) {}
  bool Evaluate(double const* const* x, double* residual, double** jacobian) const override {
    const Eigen::Map<const Eigen::Vector3d> w(x[0]), t(x[0] + 3), point(x[1]);
    const double f = x[0][6], k1 = x[0][7], k2 = x[0][8];
    const Eigen::Matrix3d R = exp_so3(w);
    const Eigen::Vector3d rotated = R * point, P = rotated + t;
    const Eigen::Vector2d p = -P.head<2>() / P.z();
    const double r2 = p.squaredNorm(), d = 1 + r2 * (k1 + k2 * r2);
    Eigen::Map<Eigen::Vector2d>{residual} = f * d * p - o_.pixel;
    if (!jacobian) return true;
    Eigen::Matrix<double, 2, 3> perspective;
    perspective << -1 / P.z(), 0, -p.x() / P.z(), 0, -1 / P.z(), -p.y() / P.z();
    const Eigen::Matrix2d lens = f * (d * Eigen::Matrix2d::Identity() + 2 * (k1 + 2 * k2 * r2) * p * p.transpose());
    const Eigen::Matrix<double, 2, 3> j = lens * perspective;
    if (jacobian[0]) {
      Eigen::Map<Eigen::Matrix<double, 2, 9, Eigen::RowMajor>> out(jacobian[0]);
      out.leftCols<3>().noalias() = -j * hat(rotated) * left_jacobian(w);
      out.middleCols<3>(3) = j;
      out.col(6) = d * p;
      out.col(7) = f * r2 * p;
      out.col(8) = f * r2 * r2 * p;
    }
    if (jacobian[1]) Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>{jacobian[1]} = j * R;
    return true;
  }

 private:
  const BundleObservation o_;
};

struct CeresOptions {
  ceres::LinearSolverType linear = ceres::SPARSE_SCHUR;
  int threads = 1;
};

inline ceres::Solver::Options ceres_solver_options(const BundleOptions& options, const CeresOptions& with) {
  ceres::Solver::Options o;
  o.linear_solver_type = with.linear;
  o.num_threads = with.threads;
  o.max_num_iterations = options.max_iterations;
  o.function_tolerance = options.relative_cost_tolerance;
  o.gradient_tolerance = 0;
  o.parameter_tolerance = 0;
  o.initial_trust_region_radius = 1 / options.initial_lambda;
  o.logging_type = ceres::SILENT;
  return o;
}

// Fixed scale only (options.fixed_sigma).
inline BundleSummary ceres_adjust_bundle(BundleProblem* problem, const BundleOptions& options,
                                         const CeresOptions& with = {}, ceres::Solver::Summary* report = nullptr) {
  std::vector<Vector6d> poses(problem->poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) poses[i] << problem->poses[i].t, log_so3(problem->poses[i].R);
  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem ceres_problem(problem_options);
  const double c = kernel_width(options.kernel) * options.fixed_sigma;
  std::unique_ptr<ceres::LossFunction> loss;
  if (options.kernel == RobustKernel::tukey) loss = std::make_unique<ceres::TukeyLoss>(c);
  if (options.kernel == RobustKernel::huber) loss = std::make_unique<ceres::HuberLoss>(c);
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  std::vector<char> used(poses.size(), 0);
  for (const BundleObservation& o : problem->observations) {
    double *pose = poses[std::size_t(o.pose)].data(), *point = problem->points[std::size_t(o.point)].data();
    ceres_problem.AddResidualBlock(new CeresReprojection(problem->camera, o), loss.get(), pose, point);
    used[std::size_t(o.pose)] = 1;
    ordering->AddElementToGroup(point, 0);
    ordering->AddElementToGroup(pose, 1);
  }
  for (std::size_t i = 0; i < poses.size(); ++i)
    if (used[i] && problem->pose_fixed[i]) ceres_problem.SetParameterBlockConstant(poses[i].data());
  ceres::Solver::Options o = ceres_solver_options(options, with);
  o.linear_solver_ordering = ordering;
  ceres::Solver::Summary s;
  ceres::Solve(o, &ceres_problem, &s);
  for (std::size_t i = 0; i < poses.size(); ++i)
    if (used[i] && !problem->pose_fixed[i])
      problem->poses[i] = RigidTransform(exp_so3(poses[i].tail<3>()), poses[i].head<3>());
  BundleSummary summary;
  summary.initial_cost = s.initial_cost;
  summary.final_cost = s.final_cost;
  summary.iterations = int(s.iterations.size()) - 1;
  summary.converged = s.termination_type == ceres::CONVERGENCE;
  if (report) *report = s;
  return summary;
}

inline BundleSummary ceres_adjust_bal(BalProblem* problem, const BundleOptions& options,
                                      const CeresOptions& with = {}) {
  ceres::Problem ceres_problem;
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (const BundleObservation& o : problem->observations) {
    double *camera = problem->cameras[std::size_t(o.pose)].data(),
           *point = problem->points[std::size_t(o.point)].data();
    ceres_problem.AddResidualBlock(new CeresBal(o), nullptr, camera, point);
    ordering->AddElementToGroup(point, 0);
    ordering->AddElementToGroup(camera, 1);
  }
  ceres::Solver::Options o = ceres_solver_options(options, with);
  o.linear_solver_ordering = ordering;
  ceres::Solver::Summary s;
  ceres::Solve(o, &ceres_problem, &s);
  BundleSummary summary;
  summary.initial_cost = s.initial_cost;
  summary.final_cost = s.final_cost;
  summary.iterations = int(s.iterations.size()) - 1;
  summary.converged = s.termination_type == ceres::CONVERGENCE;
  return summary;
}

}  // namespace parallax::testing
