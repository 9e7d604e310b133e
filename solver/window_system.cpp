#include "solver/window_system.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "core/check.h"
#include "solver/homogeneous_point.h"
#include "solver/relative_pose_prior.h"

namespace parallax::solver {
namespace {

using RowMatrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// Medians of the chi-squared distribution with two and three degrees of freedom.
constexpr double kMedianOfTwo = 1.3862943611198906, kMedianOfThree = 2.3659738843753377;

void set_pose(double* out, const Eigen::Matrix3d& R, const Eigen::Vector3d& t) {
  Eigen::Map<RowMatrix>{out} = R;
  Eigen::Map<Eigen::Vector3d>{out + 9} = t;
}

bool positive(double x) { return std::isfinite(x) && x > 0; }

}  // namespace

bool WindowSystem::valid(const WindowProblem& problem, const WindowOptions& options) const {
  const StereoCamera& camera = problem.camera;
  if (!positive(camera.focal_px.x()) || !positive(camera.focal_px.y()) || !positive(camera.baseline_m) ||
      !camera.centre_px.allFinite())
    return false;
  if (!positive(options.fixed_sigma) || !positive(options.min_sigma) || !(options.initial_trust_radius > 0))
    return false;
  if (problem.poses.empty() || problem.observations.empty()) return false;
  for (const RigidTransform& pose : problem.poses)
    if (!pose.R.allFinite() || !pose.t.allFinite()) return false;
  const int poses = static_cast<int>(problem.poses.size()), points = static_cast<int>(problem.points.size());
  for (const StereoObservation& o : problem.observations) {
    PARALLAX_CHECK(o.pose >= 0 && o.pose < poses && o.point >= 0 && o.point < points,
                   "observation of no pose or point");
    const Eigen::Vector4d& p = problem.points[static_cast<std::size_t>(o.point)];
    if (!std::isfinite(o.pixel.x()) || !std::isfinite(o.pixel.z()) || std::isinf(o.pixel.y()) ||
        !positive(o.sigma_px) || !positive(p.squaredNorm()))
      return false;
  }
  for (const RelativePosePrior& prior : problem.priors) {
    PARALLAX_CHECK(prior.a >= 0 && prior.a < poses && prior.b >= 0 && prior.b < poses && prior.a != prior.b,
                   "prior of no pair of poses");
    if (!prior.b_from_a.R.allFinite() || !prior.b_from_a.t.allFinite() || !prior.information.allFinite()) return false;
  }
  return true;
}

bool WindowSystem::load(const WindowProblem& problem, const WindowOptions& options,
                        const std::vector<std::uint8_t>& fixed) {
  PARALLAX_CHECK(fixed.size() == problem.poses.size(), "poses and pose_fixed of different size");
  if (!valid(problem, options)) return false;
  problem_ = &problem;
  options_ = options;
  sort_observations();
  assign_slots(fixed);
  return load_state();
}

// By point, then by pose: counted twice.
void WindowSystem::sort_observations() {
  const std::vector<StereoObservation>& all = problem_->observations;
  const std::size_t poses = problem_->poses.size(), points = problem_->points.size();
  by_pose_.resize(all.size());
  order_.resize(all.size());
  count_.assign(poses + 1, 0);
  for (const StereoObservation& o : all) ++count_[static_cast<std::size_t>(o.pose) + 1];
  std::partial_sum(count_.begin(), count_.end(), count_.begin());
  for (std::size_t i = 0; i < all.size(); ++i)
    by_pose_[static_cast<std::size_t>(count_[static_cast<std::size_t>(all[i].pose)]++)] = static_cast<int>(i);
  observation_begin_.assign(points + 1, 0);
  for (const StereoObservation& o : all) ++observation_begin_[static_cast<std::size_t>(o.point) + 1];
  std::partial_sum(observation_begin_.begin(), observation_begin_.end(), observation_begin_.begin());
  count_.assign(observation_begin_.begin(), observation_begin_.end());
  for (const int i : by_pose_)
    order_[static_cast<std::size_t>(count_[static_cast<std::size_t>(all[static_cast<std::size_t>(i)].point)]++)] = i;
  observations_.resize(all.size());
  for (std::size_t k = 0; k < all.size(); ++k) {
    const StereoObservation& o = all[static_cast<std::size_t>(order_[k])];
    const bool stereo = !std::isnan(o.pixel.y());
    observations_[k] = {o.pixel.x(), stereo ? o.pixel.y() : 0, o.pixel.z(), 1 / o.sigma_px, stereo ? 1. : 0., o.pose,
                        -1};
  }
}

void WindowSystem::assign_slots(const std::vector<std::uint8_t>& fixed) {
  slot_.assign(problem_->poses.size(), -1);
  const auto use = [&](int pose) {
    if (!fixed[static_cast<std::size_t>(pose)]) slot_[static_cast<std::size_t>(pose)] = 0;
  };
  for (const WindowObservation& o : observations_) use(o.pose);
  for (const RelativePosePrior& prior : problem_->priors) {
    use(prior.a);
    use(prior.b);
  }
  pose_at_.clear();
  for (std::size_t i = 0; i < slot_.size(); ++i)
    if (slot_[i] == 0) {
      slot_[i] = static_cast<int>(pose_at_.size());
      pose_at_.push_back(static_cast<int>(i));
    }
  // An edge for each pair of an adjusted pose and a point; several observations of a pair share it.
  const std::size_t points = problem_->points.size();
  edge_begin_.assign(points + 1, 0);
  edge_slot_.clear();
  for (std::size_t point = 0; point < points; ++point) {
    edge_begin_[point] = static_cast<std::int32_t>(edge_slot_.size());
    for (auto k = observation_begin_[point]; k < observation_begin_[point + 1]; ++k) {
      WindowObservation& o = observations_[static_cast<std::size_t>(k)];
      const int slot = slot_[static_cast<std::size_t>(o.pose)];
      if (slot < 0) continue;
      const bool first = static_cast<std::int32_t>(edge_slot_.size()) == edge_begin_[point];
      if (first || edge_slot_.back() != slot) edge_slot_.push_back(slot);
      o.edge = static_cast<std::int32_t>(edge_slot_.size()) - 1;
    }
  }
  edge_begin_[points] = static_cast<std::int32_t>(edge_slot_.size());
  edges_.resize(edge_slot_.size() * kWindowEdgeStride);
  point_data_.resize(points * kWindowPointStride);
  pose_blocks_.resize(pose_at_.size() * kWindowBlockStride);
  reduced_.resize(pose_at_.size() * (pose_at_.size() + 1) / 2 * kWindowBlockStride);
}

bool WindowSystem::load_state() {
  const std::size_t poses = problem_->poses.size(), points = problem_->points.size();
  origin_.setZero();
  for (const RigidTransform& pose : problem_->poses)
    origin_ -= pose.R.transpose() * pose.t / static_cast<double>(poses);
  state_.poses.resize(poses * kWindowPoseStride);
  state_.quaternion.resize(poses);
  for (std::size_t i = 0; i < poses; ++i) {
    const RigidTransform& pose = problem_->poses[i];
    set_pose(state_.poses.data() + i * kWindowPoseStride, pose.R, pose.t + pose.R * origin_);
    state_.quaternion[i] = pose.quaternion().coeffs();
  }
  state_.points.resize(points);
  state_.squared.resize(observations_.size());
  const double disparity = problem_->camera.focal_px.x() * problem_->camera.baseline_m;
  for (std::size_t i = 0; i < points; ++i) {
    if (observation_begin_[i] == observation_begin_[i + 1]) continue;
    Eigen::Vector4d p = problem_->points[i];
    p.head<3>() -= p.w() * origin_;
    p.normalize();
    int votes = 0, ahead = 0;
    for (auto k = observation_begin_[i]; k < observation_begin_[i + 1]; ++k) {
      const int pose = observations_[static_cast<std::size_t>(k)].pose;
      const double* r = state_.poses.data() + kWindowPoseStride * pose + 6;
      const double z = r[0] * p.x() + r[1] * p.y() + r[2] * p.z() + r[5] * p.w();
      if (std::abs(z) <= kWindowNearest || disparity * p.w() / z < -options_.beyond_infinity_px) continue;
      ++ahead;
      votes += z > 0 ? 1 : -1;
    }
    if (ahead > 0 ? votes < 0 : p.w() < 0) p = -p;
    state_.points[i] = p;
  }
  trial_.poses = state_.poses;
  trial_.quaternion = state_.quaternion;
  trial_.points = state_.points;
  trial_.squared.resize(observations_.size());
  evaluate(&state_);
  bool any = false;
  for (std::size_t k = 0; k < observations_.size(); ++k) {
    if (std::isfinite(state_.squared[k])) {
      any = true;
    } else if (options_.kernel != RobustKernel::tukey) {
      observations_[k].inverse_sigma = 0;
      state_.squared[k] = -1;
    }
  }
  first_.squared = state_.squared;
  first_.prior_cost = state_.prior_cost;
  return any && std::isfinite(state_.prior_cost);
}

WindowJob WindowSystem::job(State& state) {
  const StereoCamera& camera = problem_->camera;
  WindowJob job;
  job.fx = camera.focal_px.x();
  job.fy = camera.focal_px.y();
  job.cx = camera.centre_px.x();
  job.cy = camera.centre_px.y();
  job.baseline = camera.baseline_m;
  job.poses = state.poses.data();
  job.points = state.points.empty() ? nullptr : state.points.front().data();
  job.observations = observations_.data();
  job.observation_begin = observation_begin_.data();
  job.edge_begin = edge_begin_.data();
  job.edge_slot = edge_slot_.data();
  job.points_count = static_cast<int>(state.points.size());
  job.squared = state.squared.data();
  job.edges = edges_.data();
  job.point_data = point_data_.data();
  job.pose_blocks = pose_blocks_.data();
  job.reduced = reduced_.data();
  return job;
}

RigidTransform WindowSystem::pose_of(const State& state, int pose) const {
  const double* p = state.poses.data() + kWindowPoseStride * pose;
  return {Eigen::Matrix3d(Eigen::Map<const RowMatrix>(p)), Eigen::Map<const Eigen::Vector3d>(p + 9)};
}

void WindowSystem::evaluate(State* state) {
  window_kernels().evaluate(job(*state));
  state->prior_cost = 0;
  for (const RelativePosePrior& prior : problem_->priors) {
    const Vector6d e = prior_residual(prior, pose_of(*state, prior.a), pose_of(*state, prior.b), nullptr, nullptr);
    state->prior_cost += 0.5 * e.dot(prior.information * e);
  }
}

double WindowSystem::cost_of(const State& state, double sigma) const {
  const double width = window_kernel_width(options_.kernel) * sigma, c2 = width * width, inverse = 1 / c2;
  double sum = 0;
  if (options_.kernel == RobustKernel::none) {
    for (const double s : state.squared) sum += std::max(s, 0.0);
    return 0.5 * sum + state.prior_cost;
  }
  for (const double s : state.squared) sum += s < 0 ? 0.0 : kernel_cost(options_.kernel, s * inverse);
  return 0.5 * c2 * sum + state.prior_cost;
}

double WindowSystem::find_sigma() {
  if (!options_.estimate_sigma) return options_.fixed_sigma;
  values_.clear();
  for (std::size_t k = 0; k < observations_.size(); ++k)
    if (state_.squared[k] >= 0 && std::isfinite(state_.squared[k]))
      values_.push_back(state_.squared[k] / (observations_[k].stereo > 0 ? kMedianOfThree : kMedianOfTwo));
  if (values_.empty()) return options_.min_sigma;
  const auto middle = values_.begin() + static_cast<std::ptrdiff_t>(values_.size() / 2);
  std::nth_element(values_.begin(), middle, values_.end());
  return std::max(options_.min_sigma, std::sqrt(*middle));
}

double WindowSystem::make_trial(const DogLegStep& step) {
  double largest = 0;
  const auto blend = [&](const std::vector<double>& d, const std::vector<double>& h, std::size_t i) {
    return (step.along_d != 0 ? step.along_d * d[i] : 0.0) + step.along_h * h[i];
  };
  for (std::size_t slot = 0; slot < pose_at_.size(); ++slot) {
    Vector6d d;
    for (std::size_t i = 0; i < 6; ++i) d[static_cast<Eigen::Index>(i)] = blend(descent_, newton_, 8 * slot + i);
    largest = std::max(largest, d.lpNorm<Eigen::Infinity>());
    const auto pose = static_cast<std::size_t>(pose_at_[slot]);
    const Eigen::Vector4d turn = sphere_exp(d.tail<3>());
    trial_.quaternion[pose] = sphere_product(turn, state_.quaternion[pose]).normalized();
    const double* from = state_.poses.data() + pose * kWindowPoseStride;
    set_pose(trial_.poses.data() + pose * kWindowPoseStride,
             Eigen::Quaterniond(trial_.quaternion[pose]).toRotationMatrix(),
             Eigen::Quaterniond(turn) * Eigen::Map<const Eigen::Vector3d>(from + 9) + d.head<3>());
  }
  constexpr double kLargest = std::numbers::pi;  // of a tangent: more is a turn the other way
  for (std::size_t i = 0; i < state_.points.size(); ++i) {
    if (observation_begin_[i] == observation_begin_[i + 1]) continue;
    const double* f = point_data_.data() + i * kWindowPointStride;
    const double y0 = blend(descent_white_, newton_white_, 3 * i), y1 = blend(descent_white_, newton_white_, 3 * i + 1),
                 y2 = blend(descent_white_, newton_white_, 3 * i + 2);
    Eigen::Vector3d d(f[0] * y0 + f[1] * y1 + f[3] * y2, f[2] * y1 + f[4] * y2, f[5] * y2);
    if (const double length = d.norm(); length > kLargest) d *= kLargest / length;
    largest = std::max(largest, d.lpNorm<Eigen::Infinity>());
    trial_.points[i] = move_on_sphere(state_.points[i], d);
  }
  evaluate(&trial_);
  return largest;
}

void WindowSystem::accept() { std::swap(state_, trial_); }

bool WindowSystem::behind(int point, int observation) const {
  const WindowObservation& o = observations_[static_cast<std::size_t>(observation)];
  const Eigen::Vector4d& p = state_.points[static_cast<std::size_t>(point)];
  const double* r = state_.poses.data() + kWindowPoseStride * o.pose + 6;
  const double z = r[0] * p.x() + r[1] * p.y() + r[2] * p.z() + r[5] * p.w();
  return !(z > kWindowNearest) ||
         problem_->camera.focal_px.x() * problem_->camera.baseline_m * p.w() / z < -options_.beyond_infinity_px;
}

void WindowSystem::find_outliers(double sigma, std::vector<std::uint8_t>* outlier) const {
  const double width = kWindowTukeyWidth * sigma, bound = width * width;
  outlier->assign(observations_.size(), 0);
  for (std::size_t point = 0; point + 1 < observation_begin_.size(); ++point)
    for (auto k = observation_begin_[point]; k < observation_begin_[point + 1]; ++k) {
      const auto at = static_cast<std::size_t>(k);
      const bool far = options_.kernel != RobustKernel::none && state_.squared[at] >= bound;
      if (far || state_.squared[at] < 0 || behind(static_cast<int>(point), k))
        (*outlier)[static_cast<std::size_t>(order_[at])] = 1;
    }
}

void WindowSystem::drop_outliers(double sigma) {
  std::vector<std::uint8_t> outlier;
  find_outliers(sigma, &outlier);
  for (std::size_t k = 0; k < observations_.size(); ++k) {
    WindowObservation& o = observations_[k];
    o.inverse_sigma = outlier[static_cast<std::size_t>(order_[k])] ? 0 : o.inverse_sigma / sigma;
  }
}

void WindowSystem::store(WindowProblem* problem, bool moved) const {
  for (std::size_t i = 0; i < state_.points.size(); ++i) {
    if (observation_begin_[i] == observation_begin_[i + 1]) continue;
    Eigen::Vector4d p = state_.points[i];
    p.head<3>() += p.w() * origin_;
    Eigen::Vector4d& out = problem->points[i];
    out = moved ? p.normalized() : Eigen::Vector4d(out.dot(p) < 0 ? -out : out);
  }
  if (!moved) return;
  for (const int i : pose_at_) {
    const auto pose = static_cast<std::size_t>(i);
    const Eigen::Matrix3d R = pose_of(state_, i).R;
    problem->poses[pose] = {R, pose_of(state_, i).t - R * origin_};
  }
}

}  // namespace parallax::solver
