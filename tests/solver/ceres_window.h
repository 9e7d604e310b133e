// The same window by Ceres, with points of three Euclidean coordinates: what ours is held against.
#pragma once

#include <ceres/ceres.h>

#include <memory>

#include "solver/window_smoothing.h"
#include "tests/solver/ceres_bundle.h"

namespace parallax::testing {

// Parameters: pose (translation, rotation vector), point.
class CeresStereo : public ceres::SizedCostFunction<3, 6, 3> {
 public:
  CeresStereo(const StereoCamera& camera, const StereoObservation& o) : camera_(camera), o_(o) {}
  bool Evaluate(double const* const* x, double* residual, double** jacobian) const override {
    const Eigen::Map<const Eigen::Vector3d> t(x[0]), w(x[0] + 3), point(x[1]);
    const Eigen::Matrix3d R = exp_so3(w);
    const Eigen::Vector3d rotated = R * point, p = rotated + t;
    Eigen::Vector3d pixel;
    if (!camera_.project(p, &pixel)) return false;
    const double s = 1 / o_.sigma_px, i = s / p.z(), fx = camera_.focal_px.x() * i, fy = camera_.focal_px.y() * i;
    Eigen::Vector3d r = s * (pixel - o_.pixel);
    Eigen::Matrix3d j;
    j << fx, 0, -fx * p.x() / p.z(), fx, 0, -fx * (p.x() - camera_.baseline_m) / p.z(), 0, fy, -fy * p.y() / p.z();
    if (std::isnan(o_.pixel.y())) {
      r.y() = 0;
      j.row(1).setZero();
    }
    Eigen::Map<Eigen::Vector3d>{residual} = r;
    if (!jacobian) return true;
    if (jacobian[0]) {
      Eigen::Map<Eigen::Matrix<double, 3, 6, Eigen::RowMajor>> out(jacobian[0]);
      out.leftCols<3>() = j;
      out.rightCols<3>().noalias() = -j * hat(rotated) * left_jacobian(w);
    }
    if (jacobian[1]) Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>{jacobian[1]} = j * R;
    return true;
  }

 private:
  const StereoCamera& camera_;
  const StereoObservation o_;
};

// Fixed scale only. Points must be Euclidean, with w > 0, and come back so; priors are left out.
inline WindowSummary ceres_smooth_window(WindowProblem* window, const WindowOptions& options) {
  std::vector<Vector6d> poses(window->poses.size());
  std::vector<Eigen::Vector3d> points(window->points.size());
  for (std::size_t i = 0; i < poses.size(); ++i) poses[i] << window->poses[i].t, log_so3(window->poses[i].R);
  for (std::size_t i = 0; i < points.size(); ++i) points[i] = window->points[i].head<3>() / window->points[i].w();
  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  const double c = window_kernel_width(options.kernel) * options.fixed_sigma;
  std::unique_ptr<ceres::LossFunction> loss;
  if (options.kernel == RobustKernel::huber) loss = std::make_unique<ceres::HuberLoss>(c);
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (const StereoObservation& o : window->observations) {
    double *pose = poses[std::size_t(o.pose)].data(), *point = points[std::size_t(o.point)].data();
    problem.AddResidualBlock(new CeresStereo(window->camera, o), loss.get(), pose, point);
    ordering->AddElementToGroup(point, 0);
    ordering->AddElementToGroup(pose, 1);
  }
  for (std::size_t i = 0; i < poses.size(); ++i)
    if (window->pose_fixed[i]) problem.SetParameterBlockConstant(poses[i].data());
  ceres::Solver::Options o;
  o.linear_solver_type = ceres::DENSE_SCHUR;
  o.max_num_iterations = options.max_iterations;
  o.function_tolerance = options.relative_cost_tolerance;
  o.gradient_tolerance = o.parameter_tolerance = 0;
  o.logging_type = ceres::SILENT;
  o.linear_solver_ordering = ordering;
  ceres::Solver::Summary s;
  ceres::Solve(o, &problem, &s);
  for (std::size_t i = 0; i < poses.size(); ++i)
    if (!window->pose_fixed[i]) window->poses[i] = RigidTransform(exp_so3(poses[i].tail<3>()), poses[i].head<3>());
  for (std::size_t i = 0; i < points.size(); ++i) window->points[i] = points[i].homogeneous().normalized();
  WindowSummary summary;
  summary.initial_cost = s.initial_cost;
  summary.final_cost = s.final_cost;
  summary.iterations = int(s.iterations.size()) - 1;
  summary.converged = s.termination_type == ceres::CONVERGENCE;
  return summary;
}

}  // namespace parallax::testing
