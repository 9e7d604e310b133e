#include "calib/camera_calibration.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "calib/initial_lens.h"
#include "calib/lens_conversion.h"
#include "calib/planar_pose.h"
#include "calib/rig_adjustment.h"
#include "core/error.h"
#include "solver/robust_kernel.h"

namespace parallax {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// Residuals below this are rounding: noise-free data must not turn its own rounding into outliers.
constexpr double smallest_sigma_px = 1e-4;

constexpr int fewest_points_in_view = 6;

RigProblem make_problem(const CalibrationData& data, const CameraModel& camera, const LensFreedom& freedom) {
  RigProblem problem;
  problem.cameras = {camera};
  problem.freedom = {lens_freedom_map(lens_model(camera), freedom)};
  problem.camera_from_rig.resize(1);
  problem.rig_from_target.resize(data.views.size());
  const std::vector<Eigen::Vector3d> points = target_points(data.target);
  for (std::size_t v = 0; v < data.views.size(); ++v)
    for (const auto& corner : data.views[v].corners)
      problem.observations.push_back(
          {static_cast<int>(v), 0, points[static_cast<std::size_t>(corner.id)], corner.px, true});
  return problem;
}

// Poses each view; those that cannot be posed have their corners taken out.
int pose_views(const std::vector<ViewPoints>& views, RigProblem* problem) {
  std::vector<bool> posed(views.size(), false);
  for (std::size_t v = 0; v < views.size(); ++v) {
    double rms = 0;
    posed[v] =
        find_planar_pose(problem->cameras[0], views[v].points, views[v].pixels, &problem->rig_from_target[v], &rms);
  }
  for (auto& o : problem->observations) o.used = posed[static_cast<std::size_t>(o.view)];
  return static_cast<int>(std::count(posed.begin(), posed.end(), true));
}

double noise_of(const RigProblem& problem, int dof) {
  std::vector<double> squared;
  for (const auto& o : problem.observations) {
    Eigen::Vector2d r;
    if (rig_residual(problem, o, &r)) squared.push_back(r.squaredNorm());
  }
  return std::max(robust_sigma_2d(squared, dof / 2), smallest_sigma_px);
}

// Robust rounds with a kernel as wide as the noise. Returns false when stopped.
bool adjust_robustly(int rounds, int iterations, const std::stop_token& stop, RigProblem* problem, int* total) {
  for (int round = 0; round < rounds; ++round) {
    RigAdjustmentOptions options;
    options.huber_px = kHuberWidth * noise_of(*problem, 0);
    options.max_iterations = iterations;
    options.stop = stop;
    options.relative_decrease = 1e-9;
    const auto summary = adjust_rig(problem, options);
    *total += summary.iterations;
    if (summary.stopped) return false;
  }
  return true;
}

// A start for the model from each guess, the better one after some iterations.
bool find_start(const CalibrationData& data, const CalibrationOptions& options, const std::vector<ViewPoints>& views,
                RigProblem* best, int* iterations) {
  double best_noise = infinity;
  std::vector<CameraModel> guesses = options.starts;
  if (guesses.empty())
    for (const auto& guess : guess_lenses(views, data.width, data.height)) guesses.push_back(guess.camera);
  for (const auto& guess : guesses) {
    std::vector<CameraModel> starts;
    if (lens_model(guess) == options.model) {
      starts.push_back(guess);
    } else {
      const auto converted = convert_lens(guess, options.model, options.freedom);
      // Lens parameters that a fit had to stretch to reproduce the guess's border help nobody.
      if (converted && converted->max_px < 0.1 * data.width) starts.push_back(converted->camera);
      Eigen::VectorXd p = Eigen::VectorXd::Zero(lens_parameter_count(options.model));
      p.head<4>() = lens_parameters(guess).head<4>();
      if (options.model == LensModel::fov) p(4) = 0.5;
      if (const auto plain = make_lens(options.model, data.width, data.height, p)) starts.push_back(*plain);
    }
    for (const auto& start : starts) {
      RigProblem problem = make_problem(data, start, options.freedom);
      if (pose_views(views, &problem) < std::min<int>(3, static_cast<int>(views.size()))) continue;
      if (!adjust_robustly(2, 12, options.stop, &problem, iterations)) return false;
      const double noise = noise_of(problem, 0);
      if (!(noise < best_noise)) continue;
      best_noise = noise;
      *best = std::move(problem);
    }
  }
  return std::isfinite(best_noise);
}

// Drops what is too far off, takes back what is near again. Returns the number that changed.
int choose_inliers(double sigmas, int dof, RigProblem* problem) {
  const double sigma = noise_of(*problem, dof), limit2 = sigmas * sigmas * sigma * sigma;
  std::vector<int> left(problem->rig_from_target.size(), 0);
  std::vector<bool> good(problem->observations.size(), false);
  for (std::size_t i = 0; i < good.size(); ++i) {
    Eigen::Vector2d r;
    good[i] = rig_residual(*problem, problem->observations[i], &r) && r.squaredNorm() <= limit2;
    left[static_cast<std::size_t>(problem->observations[i].view)] += good[i] ? 1 : 0;
  }
  int changed = 0;
  for (std::size_t i = 0; i < good.size(); ++i) {
    auto& o = problem->observations[i];
    const bool use = good[i] && left[static_cast<std::size_t>(o.view)] >= fewest_points_in_view;
    changed += use != o.used ? 1 : 0;
    o.used = use;
  }
  return changed;
}

// The pixels of discs' centres, given the present lens and poses.
void correct_discs(const CalibrationData& data, RigProblem* problem) {
  std::size_t i = 0;
  for (std::size_t v = 0; v < data.views.size(); ++v) {
    for (const auto& corner : data.views[v].corners) {
      auto& o = problem->observations[i++];
      o.pixel =
          corner.px - disc_bias(problem->cameras[0], problem->rig_from_target[v], o.point, 0.5 * data.target.detail());
    }
  }
}

void describe(const CalibrationData& data, const RigProblem& problem, CameraCalibration* out) {
  out->camera = problem.cameras[0];
  out->parameters = lens_parameters(out->camera);
  out->names = lens_parameter_names(out->model);
  out->views.resize(data.views.size());
  double sum2 = 0, sum = 0;
  int used = 0, counted = 0;
  std::vector<double> view_sum2(data.views.size(), 0.0);
  std::vector<int> view_used(data.views.size(), 0);
  std::size_t i = 0;
  for (std::size_t v = 0; v < data.views.size(); ++v) {
    ViewFit& view = out->views[v];
    view.frame = data.views[v].frame;
    view.name = data.views[v].name;
    view.camera_from_target = problem.rig_from_target[v];
    for (const auto& corner : data.views[v].corners) {
      const auto& o = problem.observations[i++];
      CornerResidual residual{corner.id, o.pixel, Eigen::Vector2d::Zero(), o.used};
      if (rig_residual(problem, o, &residual.residual_px)) {
        sum += residual.residual_px.norm();
        ++counted;
      }
      if (o.used) {
        const double r2 = residual.residual_px.squaredNorm();
        sum2 += r2;
        view_sum2[v] += r2;
        ++view_used[v];
        ++used;
        out->max_px = std::max(out->max_px, std::sqrt(r2));
      } else {
        ++view.outliers;
        ++out->outliers;
      }
      view.residuals.push_back(residual);
    }
    if (view_used[v] > 0) view.rms_px = std::sqrt(view_sum2[v] / view_used[v]);
  }
  out->corners = static_cast<int>(problem.observations.size());
  const int views_used =
      static_cast<int>(std::count_if(view_used.begin(), view_used.end(), [](int n) { return n > 0; }));
  const auto& map = problem.freedom[0];
  const int dof = 2 * used - 6 * views_used - static_cast<int>(map.cols());
  out->rms_px = used > 0 ? std::sqrt(sum2 / used) : 0;
  out->mean_px = counted > 0 ? sum / counted : 0;
  out->noise_px = dof > 0 ? std::sqrt(sum2 / dof) : 0;

  const RigInformation information = rig_information(problem);
  // Scaled to a unit diagonal first: focal lengths and sixth-order coefficients differ by many orders of magnitude.
  const Eigen::VectorXd scale = information.information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information.information * scale.asDiagonal();
  const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(map.cols(), map.cols());
  const Eigen::MatrixXd inverse = scale.asDiagonal() * Eigen::MatrixXd(scaled.ldlt().solve(unit)) * scale.asDiagonal();
  out->covariance = out->noise_px * out->noise_px * (map * inverse * map.transpose());
  out->sigma = out->covariance.diagonal().cwiseMax(0).cwiseSqrt();
  out->covariance_views = map * covariance_by_views(information) * map.transpose();
  out->sigma_views = out->covariance_views.diagonal().cwiseMax(0).cwiseSqrt();
}

CameraCalibration refused(const CalibrationOptions& options, const std::string& reason) {
  CameraCalibration out;
  out.model = options.model;
  out.reason = reason;
  return out;
}

}  // namespace

void CalibrationOptions::validate() const {
  if (!(outlier_sigmas >= 2))
    throw InputError("outlier_sigmas: found " + std::to_string(outlier_sigmas) + ", expected 2 or more");
}

Eigen::Vector2d disc_bias(const CameraModel& camera, const RigidTransform& camera_from_target,
                          const Eigen::Vector3d& point, double radius_m) {
  constexpr int sides = 24;
  Eigen::Vector2d centre;
  if (!camera.project(camera_from_target * point, &centre)) return Eigen::Vector2d::Zero();
  std::vector<Eigen::Vector2d> rim(sides);
  for (int i = 0; i < sides; ++i) {
    const double angle = 2 * std::numbers::pi * i / sides;
    const Eigen::Vector3d on_rim = point + radius_m * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
    if (!camera.project(camera_from_target * on_rim, &rim[static_cast<std::size_t>(i)])) return Eigen::Vector2d::Zero();
    rim[static_cast<std::size_t>(i)] -= centre;
  }
  double area = 0;
  Eigen::Vector2d moment = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < sides; ++i) {
    const Eigen::Vector2d &a = rim[i], &b = rim[(i + 1) % sides];
    const double cross = a.x() * b.y() - a.y() * b.x();
    area += cross;
    moment += cross * (a + b);
  }
  if (std::abs(area) < 1e-9) return Eigen::Vector2d::Zero();
  return moment / (3 * area);
}

CameraCalibration calibrate_camera(const CalibrationData& given, const CalibrationOptions& options) {
  options.validate();
  given.target.validate();
  CalibrationData data = given;
  std::erase_if(data.views, [](const CalibrationView& view) { return view.corners.size() < fewest_points_in_view; });
  if (data.views.size() < 2)
    return refused(options, "found " + std::to_string(data.views.size()) +
                                " views with enough corners, expected at least 2 and better 10 or more");
  const std::vector<Eigen::Vector3d> points = target_points(data.target);
  std::vector<ViewPoints> views;
  for (const auto& view : data.views) views.push_back(view_points(points, view.corners));

  CameraCalibration out;
  out.model = options.model;
  RigProblem problem;
  if (!find_start(data, options, views, &problem, &out.iterations)) {
    if (options.stop.stop_requested()) return refused(options, "stopped");
    return refused(options, std::string("no ") + to_string(options.model) + " lens explains the views");
  }
  for (auto& o : problem.observations) o.used = true;
  // With the better lens every view may be posed anew: the mirrored tilt may have won before.
  {
    const std::vector<RigidTransform> before = problem.rig_from_target;
    for (std::size_t v = 0; v < views.size(); ++v) {
      RigidTransform kept = before[v], anew;
      double rms = 0;
      const double old_rms = refine_pose(problem.cameras[0], views[v].points, views[v].pixels, 0, 5, &kept);
      if (find_planar_pose(problem.cameras[0], views[v].points, views[v].pixels, &anew, &rms) && rms < old_rms)
        problem.rig_from_target[v] = anew;
    }
  }
  if (!adjust_robustly(3, 30, options.stop, &problem, &out.iterations)) return refused(options, "stopped");

  const bool discs = data.target.kind == TargetKind::circles || data.target.kind == TargetKind::asymmetric_circles;
  const int parameters = static_cast<int>(problem.freedom[0].cols() + 6 * problem.rig_from_target.size());
  for (int round = 0; round < 10; ++round) {
    if (discs) correct_discs(data, &problem);
    const int changed = choose_inliers(options.outlier_sigmas, parameters, &problem);
    RigAdjustmentOptions plain;
    plain.max_iterations = 100;
    plain.stop = options.stop;
    const auto summary = adjust_rig(&problem, plain);
    out.iterations += summary.iterations;
    out.converged = summary.converged;
    if (summary.stopped) return refused(options, "stopped");
    if (changed == 0 && (!discs || round >= 3)) break;
  }
  const auto used =
      std::count_if(problem.observations.begin(), problem.observations.end(), [](const auto& o) { return o.used; });
  if (2 * used <= parameters || 2 * static_cast<std::size_t>(used) < problem.observations.size())
    return refused(options, "only " + std::to_string(used) + " of " + std::to_string(problem.observations.size()) +
                                " corners agree on one " + to_string(options.model) + " lens");
  describe(data, problem, &out);
  out.ok = out.parameters.allFinite() && out.sigma.allFinite();
  if (!out.ok) out.reason = "the views do not determine the lens: tilt the board in some of them";
  return out;
}

double held_out_error(const CameraModel& camera, const CalibrationData& held_out, std::vector<double>* per_view) {
  const std::vector<Eigen::Vector3d> points = target_points(held_out.target);
  const bool discs =
      held_out.target.kind == TargetKind::circles || held_out.target.kind == TargetKind::asymmetric_circles;
  double sum = 0;
  int n = 0;
  for (const auto& view : held_out.views) {
    ViewPoints seen = view_points(points, view.corners);
    RigidTransform pose;
    double rms = 0;
    if (!find_planar_pose(camera, seen.points, seen.pixels, &pose, &rms)) {
      if (per_view != nullptr) per_view->push_back(infinity);
      return infinity;
    }
    for (int round = 0; discs && round < 3; ++round) {
      for (std::size_t i = 0; i < seen.points.size(); ++i)
        seen.pixels[i] = view.corners[i].px - disc_bias(camera, pose, seen.points[i], 0.5 * held_out.target.detail());
      rms = refine_pose(camera, seen.points, seen.pixels, 0, 10, &pose);
    }
    if (per_view != nullptr) per_view->push_back(rms);
    sum += rms * rms * static_cast<double>(seen.points.size());
    n += static_cast<int>(seen.points.size());
  }
  return n > 0 ? std::sqrt(sum / n) : infinity;
}

}  // namespace parallax
