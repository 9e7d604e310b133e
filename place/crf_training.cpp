#include "place/crf_training.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <deque>
#include <utility>

#include "core/check.h"
#include "core/error.h"

namespace parallax {
namespace {

using WeightVector = Eigen::Matrix<double, kCrfWeights, 1>;

constexpr std::size_t kRemembered = 10;  // steps of L-BFGS

double objective_at(std::span<const LabelledProblem> data, const WeightVector& x, double prior_sigma,
                    WeightVector* gradient) {
  CrfWeights weight{}, slope{};
  for (std::size_t k = 0; k < weight.size(); ++k) weight[k] = x[static_cast<Eigen::Index>(k)];
  const double value = crf_objective(data, weight, prior_sigma, &slope);
  for (std::size_t k = 0; k < weight.size(); ++k) (*gradient)[static_cast<Eigen::Index>(k)] = slope[k];
  return value;
}

// The two-loop recursion.
WeightVector lbfgs_direction(const WeightVector& gradient,
                             const std::deque<std::pair<WeightVector, WeightVector>>& steps) {
  WeightVector q = gradient;
  std::vector<double> alpha(steps.size());
  for (std::size_t i = steps.size(); i-- > 0;) {
    const auto& [s, y] = steps[i];
    alpha[i] = s.dot(q) / s.dot(y);
    q -= alpha[i] * y;
  }
  if (!steps.empty()) q *= steps.back().first.dot(steps.back().second) / steps.back().second.squaredNorm();
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const auto& [s, y] = steps[i];
    q += (alpha[i] - y.dot(q) / s.dot(y)) * s;
  }
  return -q;
}

}  // namespace

LabelledProblem label_problem(const StereoScene& from, const StereoScene& to, SceneGraph graph,
                              std::span<const Eigen::Vector3d> points, std::span<const Eigen::Vector3d> to_points,
                              const StereoCamera& to_camera, const RigidTransform& to_from_from, double tolerance_px) {
  PARALLAX_CHECK(points.size() == from.features.size() && to_points.size() == to.features.size(), "a point a feature");
  LabelledProblem out;
  out.problem = make_crf_problem(from, to, graph);
  out.state.assign(out.problem.parent.size(), 0);
  for (int v = 0; v < out.problem.size(); ++v) {
    const auto row = static_cast<std::size_t>(v);
    const Eigen::Vector3d there = to_from_from * points[static_cast<std::size_t>(out.problem.feature[row])];
    Eigen::Vector3d pixel;
    if (!there.allFinite() || !to_camera.project(there, &pixel)) continue;
    double least = HUGE_VAL;
    for (int s = 1; s < out.problem.states[row]; ++s) {
      const auto j = static_cast<std::size_t>(out.problem.candidate_at(v, s));
      const PlaceFeature& feature = to.features[j];
      const double apart = (feature.pixel.cast<double>() - Eigen::Vector2d(pixel.x(), pixel.z())).norm();
      if (apart > tolerance_px * level_scale(feature.level) || apart >= least ||
          !(std::abs(to_points[j].z() - there.z()) < 0.1 * there.z()))
        continue;
      least = apart;
      out.state[row] = s;
    }
  }
  return out;
}

void CrfTrainingOptions::validate() const {
  if (!(prior_sigma > 0)) throw InputError("matching weights: prior_sigma: expected more than 0");
  if (iterations < 1) throw InputError("matching weights: iterations: expected at least 1");
  if (!(tolerance > 0)) throw InputError("matching weights: tolerance: expected more than 0");
}

double crf_objective(std::span<const LabelledProblem> data, const CrfWeights& weight, double prior_sigma,
                     CrfWeights* gradient) {
  gradient->fill(0);
  double value = 0;
  const auto add_local = [&](const CrfProblem& problem, int v, int state, double factor) {
    const auto f = local_features(problem, v, state);
    for (std::size_t k = 0; k < f.size(); ++k) (*gradient)[k] += factor * f[k];
  };
  const auto add_pair = [&](const CrfProblem& problem, int v, int sp, int state, double factor) {
    const auto f = pair_features(problem, v, sp, state);
    for (std::size_t k = 0; k < f.size(); ++k) (*gradient)[kCrfLocal + k] += factor * f[k];
  };
  std::vector<double> states, pairs;
  for (const LabelledProblem& one : data) {
    const CrfProblem& problem = one.problem;
    PARALLAX_CHECK(one.state.size() == problem.parent.size(), "a label a vertex");
    const TreeField field = make_field(problem, weight);
    value += field_marginals(field, &states, &pairs) - field_score(field, one.state);
    for (int v = 0; v < problem.size(); ++v) {
      const auto row = static_cast<std::size_t>(v);
      const int parent = problem.parent[row];
      add_local(problem, v, one.state[row], -1);
      for (int s = 1; s < problem.states[row]; ++s) add_local(problem, v, s, states[field.index(v, s)]);
      if (parent < 0) continue;
      add_pair(problem, v, one.state[static_cast<std::size_t>(parent)], one.state[row], -1);
      for (int sp = 0; sp < problem.states[static_cast<std::size_t>(parent)]; ++sp)
        for (int s = 0; s < problem.states[row]; ++s) add_pair(problem, v, sp, s, pairs[field.index(v, sp, s)]);
    }
  }
  const double precision = 1 / (prior_sigma * prior_sigma);
  for (std::size_t k = 0; k < weight.size(); ++k) {
    value += 0.5 * precision * weight[k] * weight[k];
    (*gradient)[k] += precision * weight[k];
  }
  return value;
}

CrfWeights train_crf_weights(std::span<const LabelledProblem> data, const CrfTrainingOptions& options) {
  options.validate();
  double vertices = 0;
  bool any = false;
  for (const LabelledProblem& one : data) {
    vertices += one.problem.size();
    for (const std::int32_t states : one.problem.states) any = any || states > 1;
  }
  if (!any) throw InputError("matching weights: found no features that could match, expected some");
  WeightVector x = WeightVector::Zero(), gradient;
  double value = objective_at(data, x, options.prior_sigma, &gradient);
  std::deque<std::pair<WeightVector, WeightVector>> steps;
  for (int i = 0; i < options.iterations; ++i) {
    if (gradient.cwiseAbs().maxCoeff() < options.tolerance * vertices) break;
    WeightVector direction = lbfgs_direction(gradient, steps);
    if (steps.empty()) direction /= std::max(1.0, gradient.norm());
    const double slope = direction.dot(gradient);
    WeightVector next, next_gradient;
    double next_value = value, length = 1;
    bool found = false;
    for (int halving = 0; halving < 40 && !found; ++halving, length *= 0.5) {
      next = x + length * direction;
      next_value = objective_at(data, next, options.prior_sigma, &next_gradient);
      found = next_value <= value + 1e-4 * length * slope;  // Armijo 1966
    }
    if (!found) break;  // rounding
    const WeightVector s = next - x, y = next_gradient - gradient;
    if (s.dot(y) > 0) steps.emplace_back(s, y);
    if (steps.size() > kRemembered) steps.pop_front();
    x = next;
    gradient = next_gradient;
    value = next_value;
  }
  CrfWeights out{};
  for (std::size_t k = 0; k < out.size(); ++k) out[k] = x[static_cast<Eigen::Index>(k)];
  return out;
}

double choose_explained(std::span<const CrfEvidence> evidence, double beta, double refusal_weight) {
  double least = HUGE_VAL;
  std::vector<double> best;
  for (int step = 0; step <= 490; ++step) {
    const double p = 0.505 + 0.001 * step, found = -std::log(p), missing = -std::log1p(-p);
    std::array<double, 2> wrong{}, all{};
    for (const CrfEvidence& one : evidence) {
      const double before = one.explained_before * found;
      const bool accepted = before + one.missing * (missing - found) <= beta * before;
      const std::size_t kind = one.same_place ? 1 : 0;
      all[kind] += 1;
      wrong[kind] += accepted != one.same_place ? 1 : 0;
    }
    const double rate = wrong[0] / std::max(1.0, all[0]) + refusal_weight * wrong[1] / std::max(1.0, all[1]);
    if (rate < least) least = rate, best.clear();
    if (rate == least) best.push_back(p);
  }
  return best[best.size() / 2];
}

}  // namespace parallax
