#include "calib/rig_adjustment.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>

#include "core/check.h"
#include "solver/robust_kernel.h"

namespace parallax {
namespace {

// Of the information scaled to a unit diagonal: what is less is rounding.
constexpr double kLeastInformation = 1e-12;

// Where a parameter block begins among the shared ones.
struct SharedLayout {
  std::vector<int> lens, place;  // a camera each; place[0] is not used
  int size = 0;
};

SharedLayout layout_of(const RigProblem& problem) {
  SharedLayout layout;
  for (const auto& freedom : problem.freedom) {
    layout.lens.push_back(layout.size);
    layout.size += static_cast<int>(freedom.cols());
  }
  for (std::size_t c = 0; c < problem.cameras.size(); ++c) {
    layout.place.push_back(layout.size);
    if (c > 0) layout.size += 6;
  }
  return layout;
}

struct ViewBlock {
  Matrix6d H = Matrix6d::Zero();
  Eigen::Matrix<double, 6, Eigen::Dynamic> C;  // pose by shared
  Vector6d g = Vector6d::Zero();
  Eigen::MatrixXd H_shared;
  Eigen::VectorXd g_shared;
};

struct Linearised {
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
  std::vector<ViewBlock> views;
};

Linearised linearise(const RigProblem& problem, const SharedLayout& layout, double huber_px) {
  Linearised out;
  out.H = Eigen::MatrixXd::Zero(layout.size, layout.size);
  out.g = Eigen::VectorXd::Zero(layout.size);
  out.views.resize(problem.rig_from_target.size());
  for (auto& view : out.views) {
    view.C.setZero(6, layout.size);
    view.g_shared = Eigen::VectorXd::Zero(layout.size);
    view.H_shared = Eigen::MatrixXd::Zero(layout.size, layout.size);
  }
  const double c2 = huber_px > 0 ? huber_px * huber_px : 1;
  Eigen::Matrix<double, 2, Eigen::Dynamic> J(2, layout.size);
  for (const auto& o : problem.observations) {
    if (!o.used) continue;
    const auto c = static_cast<std::size_t>(o.camera);
    const Eigen::Vector3d in_rig = problem.rig_from_target[static_cast<std::size_t>(o.view)] * o.point;
    const Eigen::Vector3d p = problem.camera_from_rig[c] * in_rig;
    Eigen::Vector2d px;
    Eigen::Matrix<double, 2, 3> d_point;
    LensJacobian d_lens;
    if (!project_with_lens(problem.cameras[c], p, &px, &d_point, &d_lens)) continue;
    const Eigen::Vector2d r = px - o.pixel;
    const double w = huber_px > 0 ? huber_weight(r.squaredNorm() / c2) : 1;
    const Eigen::Matrix<double, 2, 6> J_pose =
        CameraModel::pose_jacobian(d_point * problem.camera_from_rig[c].R, in_rig);
    J.setZero();
    const auto& freedom = problem.freedom[c];
    if (freedom.cols() > 0) J.middleCols(layout.lens[c], freedom.cols()) = d_lens * freedom;
    if (c > 0) J.middleCols<6>(layout.place[c]) = CameraModel::pose_jacobian(d_point, p);
    ViewBlock& view = out.views[static_cast<std::size_t>(o.view)];
    view.H.noalias() += w * J_pose.transpose() * J_pose;
    view.g.noalias() += w * J_pose.transpose() * r;
    if (layout.size == 0) continue;
    view.H_shared.noalias() += w * J.transpose() * J;
    view.C.noalias() += w * J_pose.transpose() * J;
    view.g_shared.noalias() += w * J.transpose() * r;
  }
  for (const auto& view : out.views) {
    out.g += view.g_shared;
    out.H += view.H_shared;
  }
  return out;
}

double cost_of(const RigProblem& problem, double huber_px) {
  const double c2 = huber_px > 0 ? huber_px * huber_px : 1;
  const double width = problem.cameras[0].width(), blind = 0.25 * width * width;
  double cost = 0;
  for (const auto& o : problem.observations) {
    if (!o.used) continue;
    Eigen::Vector2d r;
    const double r2 = rig_residual(problem, o, &r) ? r.squaredNorm() : blind;
    cost += huber_px > 0 ? c2 * huber_cost(r2 / c2) : r2;
  }
  return cost;
}

Matrix6d damped_inverse(const Matrix6d& H, double lambda) {
  Matrix6d damped = H;
  damped.diagonal() *= 1 + lambda;
  damped.diagonal().array() += 1e-10;  // a view without points stays where it is
  return damped.ldlt().solve(Matrix6d::Identity());
}

// The problem with a step taken; false when there is no such lens.
bool take_step(const RigProblem& from, const SharedLayout& layout, const Eigen::VectorXd& shared,
               const std::vector<Vector6d>& poses, RigProblem* to) {
  for (std::size_t c = 0; c < from.cameras.size(); ++c) {
    const auto& freedom = from.freedom[c];
    if (freedom.cols() > 0) {
      const Eigen::VectorXd p =
          lens_parameters(from.cameras[c]) + freedom * shared.segment(layout.lens[c], freedom.cols());
      const auto lens = make_lens(lens_model(from.cameras[c]), from.cameras[c].width(), from.cameras[c].height(), p);
      if (!lens) return false;
      to->cameras[c] = *lens;
    }
    if (c > 0) {
      to->camera_from_rig[c] =
          RigidTransform::exp(Vector6d(shared.segment<6>(layout.place[c]))) * from.camera_from_rig[c];
      to->camera_from_rig[c].orthonormalise();
    }
  }
  for (std::size_t v = 0; v < poses.size(); ++v) {
    to->rig_from_target[v] = RigidTransform::exp(poses[v]) * from.rig_from_target[v];
    to->rig_from_target[v].orthonormalise();
  }
  return true;
}

}  // namespace

bool rig_residual(const RigProblem& problem, const RigObservation& o, Eigen::Vector2d* residual) {
  const auto c = static_cast<std::size_t>(o.camera);
  Eigen::Vector2d px;
  const Eigen::Vector3d in_rig = problem.rig_from_target[static_cast<std::size_t>(o.view)] * o.point;
  if (!problem.cameras[c].project(problem.camera_from_rig[c] * in_rig, &px)) return false;
  *residual = px - o.pixel;
  return true;
}

RigAdjustmentSummary adjust_rig(RigProblem* problem, const RigAdjustmentOptions& options) {
  PARALLAX_CHECK(!problem->cameras.empty() && problem->freedom.size() == problem->cameras.size() &&
                     problem->camera_from_rig.size() == problem->cameras.size(),
                 "a rig with one freedom map and one place for each camera");
  const SharedLayout layout = layout_of(*problem);
  RigAdjustmentSummary summary;
  summary.cost = cost_of(*problem, options.huber_px);
  double lambda = 1e-3;
  RigProblem candidate = *problem;
  int small_steps = 0;
  while (summary.iterations < options.max_iterations && !summary.converged) {
    if (options.stop.stop_requested()) {
      summary.stopped = true;
      break;
    }
    ++summary.iterations;
    const Linearised lin = linearise(*problem, layout, options.huber_px);
    bool better = false;
    for (int attempt = 0; attempt < 10 && !better; ++attempt) {
      Eigen::MatrixXd S = lin.H;
      S.diagonal() *= 1 + lambda;
      S.diagonal().array() += 1e-14;
      Eigen::VectorXd b = -lin.g;
      std::vector<Matrix6d> inverses(lin.views.size());
      for (std::size_t v = 0; v < lin.views.size(); ++v) {
        inverses[v] = damped_inverse(lin.views[v].H, lambda);
        if (layout.size == 0) continue;
        const Eigen::Matrix<double, Eigen::Dynamic, 6> CtH = lin.views[v].C.transpose() * inverses[v];
        S.noalias() -= CtH * lin.views[v].C;
        b.noalias() += CtH * lin.views[v].g;
      }
      Eigen::VectorXd shared(layout.size);
      if (layout.size > 0) shared = S.ldlt().solve(b);
      std::vector<Vector6d> poses(lin.views.size());
      bool finite = shared.allFinite();
      for (std::size_t v = 0; v < lin.views.size(); ++v) {
        Vector6d rest = lin.views[v].g;
        if (layout.size > 0) rest.noalias() += lin.views[v].C * shared;
        poses[v] = -(inverses[v] * rest);
        finite = finite && poses[v].allFinite();
      }
      double cost = std::numeric_limits<double>::infinity();
      if (finite && take_step(*problem, layout, shared, poses, &candidate)) cost = cost_of(candidate, options.huber_px);
      better = cost < summary.cost;
      lambda = better ? std::max(0.1 * lambda, 1e-10) : 10 * lambda;
      if (!better) continue;
      small_steps = summary.cost - cost < options.relative_decrease * cost ? small_steps + 1 : 0;
      summary.cost = cost;
      std::swap(problem->cameras, candidate.cameras);
      std::swap(problem->camera_from_rig, candidate.camera_from_rig);
      std::swap(problem->rig_from_target, candidate.rig_from_target);
    }
    summary.converged = !better || small_steps >= 2;
  }
  return summary;
}

RigInformation rig_information(const RigProblem& problem) {
  const SharedLayout layout = layout_of(problem);
  const Linearised lin = linearise(problem, layout, 0);
  RigInformation out;
  out.information = Eigen::MatrixXd::Zero(layout.size, layout.size);
  out.view_gradients.setZero(layout.size, static_cast<Eigen::Index>(lin.views.size()));
  for (std::size_t v = 0; v < lin.views.size(); ++v) {
    const Eigen::Matrix<double, Eigen::Dynamic, 6> CtH = lin.views[v].C.transpose() * damped_inverse(lin.views[v].H, 0);
    out.view_information.emplace_back(lin.views[v].H_shared - CtH * lin.views[v].C);
    out.information += out.view_information.back();
    out.view_gradients.col(static_cast<Eigen::Index>(v)) = lin.views[v].g_shared - CtH * lin.views[v].g;
  }
  return out;
}

Eigen::MatrixXd covariance_by_views(const RigInformation& given) {
  // Scaled to a unit diagonal: focal lengths and sixth-order coefficients differ by many orders of magnitude.
  const Eigen::VectorXd scale = given.information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const auto scaled = [&](const Eigen::MatrixXd& m) {
    return Eigen::MatrixXd(scale.asDiagonal() * m * scale.asDiagonal());
  };
  const Eigen::MatrixXd all = scaled(given.information);
  const auto views = static_cast<Eigen::Index>(given.view_information.size());
  Eigen::MatrixXd without(all.rows(), views), pulls(all.rows(), views);
  const auto all_solver = all.ldlt();
  Eigen::Index used = 0;
  bool determined = true;
  for (Eigen::Index v = 0; v < views; ++v) {
    const Eigen::MatrixXd own = scaled(given.view_information[static_cast<std::size_t>(v)]);
    if (own.norm() == 0) continue;
    const Eigen::VectorXd pull = scale.cwiseProduct(given.view_gradients.col(v));
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> rest(all - own);
    determined = determined && rest.eigenvalues().minCoeff() > kLeastInformation;
    without.col(used) = rest.eigenvectors() *
                        rest.eigenvalues().cwiseMax(kLeastInformation).cwiseInverse().asDiagonal() *
                        rest.eigenvectors().transpose() * pull;
    pulls.col(used) = all_solver.solve(pull);
    ++used;
  }
  const double n = static_cast<double>(used);
  Eigen::MatrixXd moves = determined ? without.leftCols(used) : pulls.leftCols(used);
  if (determined && used > 0) moves.colwise() -= Eigen::VectorXd(moves.rowwise().mean());
  const double weight = determined ? (n - 1) / n : n / std::max(n - 1, 1.0);
  return weight * scale.asDiagonal() * Eigen::MatrixXd(moves * moves.transpose()) * scale.asDiagonal();
}

}  // namespace parallax
