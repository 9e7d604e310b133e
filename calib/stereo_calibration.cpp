#include "calib/stereo_calibration.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "calib/initial_lens.h"
#include "calib/planar_pose.h"
#include "calib/rig_adjustment.h"
#include "core/error.h"
#include "solver/robust_kernel.h"

namespace parallax {
namespace {

constexpr std::size_t fewest_points_in_view = 6;
constexpr double infinity = std::numeric_limits<double>::infinity();

CalibrationData one_side(const StereoData& data, bool right) {
  CalibrationData out{data.target, data.width, data.height, {}};
  for (const auto& view : data.views) {
    const auto& corners = right ? view.right : view.left;
    if (corners.size() >= fewest_points_in_view) out.views.push_back({view.frame, view.name, corners});
  }
  return out;
}

std::vector<TargetCorner> renamed(const std::vector<TargetCorner>& corners, const std::vector<int>& ids) {
  std::vector<TargetCorner> out = corners;
  for (auto& corner : out) corner.id = ids[static_cast<std::size_t>(corner.id)];
  std::sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
  return out;
}

std::optional<RigidTransform> pose_of(const CameraModel& camera, const std::vector<Eigen::Vector3d>& target,
                                      const std::vector<TargetCorner>& corners) {
  if (corners.size() < fewest_points_in_view) return std::nullopt;
  const ViewPoints view = view_points(target, corners);
  RigidTransform pose;
  double rms = 0;
  if (!find_planar_pose(camera, view.points, view.pixels, &pose, &rms)) return std::nullopt;
  return pose;
}

// How far apart two places of the right camera are: an angle and a distance in units of the views' own distance.
double apart(const RigidTransform& a, const RigidTransform& b, double distance) {
  return (a * b.inverse()).angle() + (a.t - b.t).norm() / distance;
}

struct Tie {
  std::size_t view = 0;
  std::vector<RigidTransform> candidates;  // right_from_left, for each way the target may be counted
};

// The place of the right camera that most views agree on, and how each view's target is counted there.
bool find_place(const std::vector<Tie>& ties, double distance, RigidTransform* place, std::vector<std::size_t>* ways) {
  double best = infinity;
  for (const auto& tie : ties) {
    for (const auto& candidate : tie.candidates) {
      std::vector<double> distances;
      std::vector<std::size_t> chosen;
      for (const auto& other : ties) {
        std::size_t nearest = 0;
        for (std::size_t k = 1; k < other.candidates.size(); ++k)
          if (apart(other.candidates[k], candidate, distance) < apart(other.candidates[nearest], candidate, distance))
            nearest = k;
        chosen.push_back(nearest);
        distances.push_back(apart(other.candidates[nearest], candidate, distance));
      }
      std::nth_element(distances.begin(), distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2),
                       distances.end());
      if (!(distances[distances.size() / 2] < best)) continue;
      best = distances[distances.size() / 2];
      *place = candidate;
      *ways = chosen;
    }
  }
  return std::isfinite(best);
}

double epipolar_error(const StereoCalibration& rig, const StereoData& data) {
  // Distance of the right corner's ray from the epipolar plane, as pixels at the right camera's focal length.
  double sum = 0;
  int n = 0;
  const Eigen::Vector3d t = rig.right_from_left.t;
  for (const auto& view : data.views) {
    std::map<int, Eigen::Vector2d> left;
    for (const auto& corner : view.left) left[corner.id] = corner.px;
    for (const auto& corner : view.right) {
      const auto partner = left.find(corner.id);
      Eigen::Vector3d a, b;
      if (partner == left.end() || !rig.left.unproject(partner->second, &a) || !rig.right.unproject(corner.px, &b))
        continue;
      const Eigen::Vector3d normal = t.cross(rig.right_from_left.R * a).normalized();
      const double distance = normal.dot(b.normalized()) * rig.right.mean_focal_px();
      sum += distance * distance;
      ++n;
    }
  }
  return n > 0 ? std::sqrt(sum / n) : 0;
}

StereoResult refused(StereoResult result, const std::string& reason) {
  result.ok = false;
  result.reason = reason;
  return result;
}

double noise_of(const RigProblem& problem) {
  std::vector<double> squared;
  for (const auto& o : problem.observations) {
    Eigen::Vector2d r;
    if (rig_residual(problem, o, &r)) squared.push_back(r.squaredNorm());
  }
  return std::max(robust_sigma_2d(squared, 0), 1e-4);
}

}  // namespace

StereoResult calibrate_stereo(const StereoData& given, const CalibrationOptions& options) {
  options.validate();
  given.target.validate();
  StereoData data = given;
  StereoResult out;
  out.left = calibrate_camera(one_side(data, false), options);
  if (!out.left.ok) return refused(out, "left camera: " + out.left.reason);
  out.right = calibrate_camera(one_side(data, true), options);
  if (!out.right.ok) return refused(out, "right camera: " + out.right.reason);

  // Each pair says where the right camera is, in as many ways as the target can be counted.
  const std::vector<Eigen::Vector3d> target = target_points(data.target);
  const auto symmetries = target_symmetries(data.target);
  std::vector<Tie> ties;
  std::vector<std::optional<RigidTransform>> left_poses;
  std::vector<double> distances;
  for (std::size_t v = 0; v < data.views.size(); ++v) {
    left_poses.push_back(pose_of(out.left.camera, target, data.views[v].left));
    if (!left_poses.back()) continue;
    Tie tie;
    tie.view = v;
    for (const auto& ids : symmetries)
      if (const auto right = pose_of(out.right.camera, target, renamed(data.views[v].right, ids)))
        tie.candidates.push_back(*right * left_poses.back()->inverse());
    if (tie.candidates.size() != symmetries.size()) continue;
    distances.push_back(left_poses.back()->t.norm());
    ties.push_back(tie);
  }
  if (ties.size() < 3)
    return refused(
        out, "found " + std::to_string(ties.size()) + " pairs with the target in both images, expected at least 3");
  std::nth_element(distances.begin(), distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2),
                   distances.end());
  RigidTransform place;
  std::vector<std::size_t> ways;
  if (!find_place(ties, distances[distances.size() / 2], &place, &ways))
    return refused(out, "the pairs do not agree on where the right camera is");
  for (std::size_t i = 0; i < ties.size(); ++i)
    data.views[ties[i].view].right = renamed(data.views[ties[i].view].right, symmetries[ways[i]]);

  RigProblem problem;
  problem.cameras = {out.left.camera, out.right.camera};
  const Eigen::MatrixXd map = lens_freedom_map(options.model, options.freedom);
  problem.freedom = {map, map};
  problem.camera_from_rig = {RigidTransform(), place};
  for (const auto& tie : ties) {
    const int view = static_cast<int>(problem.rig_from_target.size());
    problem.rig_from_target.push_back(*left_poses[tie.view]);
    for (const auto& corner : data.views[tie.view].left)
      problem.observations.push_back({view, 0, target[static_cast<std::size_t>(corner.id)], corner.px, true});
    for (const auto& corner : data.views[tie.view].right)
      problem.observations.push_back({view, 1, target[static_cast<std::size_t>(corner.id)], corner.px, true});
  }
  const bool discs = data.target.kind == TargetKind::circles || data.target.kind == TargetKind::asymmetric_circles;
  const std::vector<RigObservation> seen = problem.observations;
  for (int round = 0; round < 6; ++round) {
    RigAdjustmentOptions adjustment;
    adjustment.stop = options.stop;
    if (round < 3) adjustment.huber_px = kHuberWidth * noise_of(problem);
    const auto summary = adjust_rig(&problem, adjustment);
    if (summary.stopped) return refused(out, "stopped");
    for (std::size_t i = 0; discs && i < seen.size(); ++i) {
      auto& o = problem.observations[i];
      const auto c = static_cast<std::size_t>(o.camera);
      o.pixel = seen[i].pixel -
                disc_bias(problem.cameras[c],
                          problem.camera_from_rig[c] * problem.rig_from_target[static_cast<std::size_t>(o.view)],
                          o.point, 0.5 * data.target.detail());
    }
    if (round < 2 || round == 5) continue;
    const double limit = options.outlier_sigmas * noise_of(problem);
    for (auto& o : problem.observations) {
      Eigen::Vector2d r;
      o.used = rig_residual(problem, o, &r) && r.norm() <= limit;
    }
  }

  out.calibration = {problem.cameras[0], problem.cameras[1], problem.camera_from_rig[1]};
  double sum = 0;
  int used = 0;
  for (const auto& o : problem.observations) {
    Eigen::Vector2d r;
    out.outliers += o.used ? 0 : 1;
    if (!o.used || !rig_residual(problem, o, &r)) continue;
    sum += r.squaredNorm();
    ++used;
  }
  out.pairs = static_cast<int>(ties.size());
  out.corners = static_cast<int>(problem.observations.size());
  const int shared = static_cast<int>(2 * map.cols()) + 6, dof = 2 * used - shared - 6 * out.pairs;
  if (dof <= 0 || 2 * used < out.corners) return refused(out, "most corners do not agree with one rig");
  out.rms_px = std::sqrt(sum / used);
  out.noise_px = std::sqrt(sum / dof);
  const RigInformation information = rig_information(problem);
  const Eigen::VectorXd scale = information.information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information.information * scale.asDiagonal();
  const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(shared, shared);
  const Eigen::MatrixXd inverse = scale.asDiagonal() * Eigen::MatrixXd(scaled.ldlt().solve(unit)) * scale.asDiagonal();
  const Eigen::MatrixXd by_noise = out.noise_px * out.noise_px * inverse;
  const Eigen::MatrixXd by_views = covariance_by_views(information);
  const auto sigma = [&](int first, const Eigen::MatrixXd& to_full) {
    const auto n = to_full.cols();
    const Eigen::VectorXd a = (to_full * by_noise.block(first, first, n, n) * to_full.transpose()).diagonal();
    const Eigen::VectorXd b = (to_full * by_views.block(first, first, n, n) * to_full.transpose()).diagonal();
    return Eigen::VectorXd(a.cwiseMax(b).cwiseMax(0).cwiseSqrt());
  };
  const int n = static_cast<int>(map.cols());
  out.left_sigma = sigma(0, map);
  out.right_sigma = sigma(n, map);
  out.rig_sigma = sigma(2 * n, Eigen::MatrixXd::Identity(6, 6));
  out.epipolar_px = epipolar_error(out.calibration, data);
  out.ok = out.left_sigma.allFinite() && out.right_sigma.allFinite() && out.rig_sigma.allFinite();
  if (!out.ok) out.reason = "the pairs do not determine the rig";
  return out;
}

}  // namespace parallax
