// Incremental smoothing and mapping against a dense solver: estimates, covariances, undo, anchors, and bad input.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <random>
#include <stop_token>

#include "core/check.h"
#include "core/error.h"
#include "solver/incremental_pose_graph.h"
#include "tests/solver/dense_pose_graph.h"
#include "tests/solver/simulated_building.h"

namespace parallax {
namespace {

using testing::DenseFactor;
using testing::DensePoseGraph;

// Three sessions that walk and meet: the truth, and both graphs fed the same. Poses 0, 1, 2 are the anchors.
class Sessions {
 public:
  Sessions(std::uint64_t seed, const IncrementalPoseGraphOptions& options) : graph(options), random_(seed) {
    for (int s = 0; s < 3; ++s) {
      anchor_truth_.push_back(s == 0 ? RigidTransform() : any(0.6, 3));
      truth_.push_back(anchor_truth_.back());
      add_pose(s == 0 ? RigidTransform() : RigidTransform::exp(noise(0.3)) * anchor_truth_.back());
      walk_.emplace_back();
    }
    prior(0, small());
  }

  // A step of one session, and now and then a loop or a meeting.
  void step() {
    const auto s = static_cast<std::size_t>(pick(3));
    auto& walk = walk_[s];
    const RigidTransform stride = any(0.5, 0.5);
    if (walk.empty()) {
      walk.push_back(poses());
      truth_.push_back(any(0.5, 1));
      add_pose(truth_.back());
      prior(walk.back(), small());
      return;
    }
    walk.push_back(poses());
    truth_.push_back(truth_[static_cast<std::size_t>(walk[walk.size() - 2])] * stride);
    const int before = walk[walk.size() - 2], now = walk.back();
    const DenseFactor f = measure({before, now});
    add_pose(graph.pose(before) * f.measured);
    add(f);
    if (walk.size() > 4 && pick(4) == 0)
      add(measure({walk[static_cast<std::size_t>(pick(static_cast<int>(walk.size()) - 3))], now}));
    const auto other = static_cast<std::size_t>(pick(3));
    if (other != s && !walk_[other].empty() && pick(3) == 0) {
      const int there = walk_[other][static_cast<std::size_t>(pick(static_cast<int>(walk_[other].size())))];
      add(measure({static_cast<int>(s), now, static_cast<int>(other), there}));
    }
  }
  void prior(int pose, const Matrix6d& covariance) {
    add({{pose}, RigidTransform::exp(noise(0.01)) * truth_[at(pose)], covariance});
  }
  void toggle() {
    // Not the priors: the dense solver would be singular.
    const int f = pick(graph.factors());
    if (dense.factors[at(f)].poses.size() == 1) return;
    const bool active = !graph.active(f);
    dense.factors[at(f)].active = active;
    graph.set_active(f, active);
  }
  int poses() const { return graph.poses(); }
  int pick(int n) { return std::uniform_int_distribution<int>(0, n - 1)(random_); }

  IncrementalPoseGraph graph;
  DensePoseGraph dense;

 private:
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  static Matrix6d small() { return Matrix6d::Identity() * 1e-4; }
  Vector6d noise(double sigma) {
    Vector6d e;
    for (int k = 0; k < 6; ++k) e[k] = sigma * std::normal_distribution<double>()(random_);
    return e;
  }
  RigidTransform any(double turn, double way) {
    Vector6d e = noise(1);
    e.head<3>() *= way;
    e.tail<3>() *= turn;
    return RigidTransform::exp(e);
  }
  void add_pose(const RigidTransform& T) {
    ASSERT_EQ(graph.add_pose(T), static_cast<int>(dense.poses.size()));
    dense.poses.push_back(T);
  }
  // With a covariance that is not diagonal, and noise from it.
  DenseFactor measure(const std::vector<int>& ids) {
    DenseFactor f;
    f.poses = ids;
    const auto x = [&](std::size_t i) { return truth_[at(ids[i])]; };
    const RigidTransform exact = ids.size() == 2 ? x(0).inverse() * x(1) : (x(0) * x(1)).inverse() * (x(2) * x(3));
    Matrix6d A;
    for (int k = 0; k < 6; ++k) A.col(k) = noise(0.02);
    f.covariance = A * A.transpose() + 1e-4 * Matrix6d::Identity();
    f.measured = RigidTransform::exp(A * noise(1) + noise(0.01)).inverse() * exact;
    return f;
  }
  void add(const DenseFactor& f) {
    int id = -1;
    if (f.poses.size() == 1) id = graph.add_prior(f.poses[0], f.measured, f.covariance);
    if (f.poses.size() == 2) id = graph.add_constraint(f.poses[0], f.poses[1], f.measured, f.covariance, f.kernel);
    if (f.poses.size() == 4)
      id = graph.add_encounter(f.poses[0], f.poses[1], f.poses[2], f.poses[3], f.measured, f.covariance, f.kernel);
    ASSERT_EQ(id, static_cast<int>(dense.factors.size()));
    dense.factors.push_back(f);
  }

  std::mt19937_64 random_;
  std::vector<RigidTransform> anchor_truth_, truth_;
  std::vector<std::vector<int>> walk_;
};

double distance(const RigidTransform& a, const RigidTransform& b) { return (a.R - b.R).norm() + (a.t - b.t).norm(); }

TEST(IncrementalPoseGraph, FollowsADenseSolverThroughSessionsThatMeet) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    Sessions s(seed, {});
    for (int k = 0; k < 26; ++k) {
      s.step();
      if (k > 8 && k % 3 == 0) s.toggle();
      PoseGraphStep step = s.graph.update();
      for (int more = 0; more < 4 && step.waiting > 0; ++more) step = s.graph.update();
      EXPECT_EQ(step.undetermined, 0);
      EXPECT_EQ(s.graph.update().eliminated, 0);  // nothing more to do
      EXPECT_NEAR(s.graph.cost(), step.cost, 1e-9 * (1 + step.cost));
      if (k % 5 != 4) continue;
      // The same measurements at the same poses cost the same, and the batch optimum is near.
      for (int i = 0; i < s.poses(); ++i) s.dense.poses[static_cast<std::size_t>(i)] = s.graph.pose(i);
      ASSERT_NEAR(s.dense.cost(), step.cost, 1e-8 * (1 + step.cost));
      s.dense.optimise();
      EXPECT_LT(step.cost, 1.02 * s.dense.cost() + 0.02) << "step " << k;
    }
    const PoseGraphStep batch = s.graph.optimise();
    EXPECT_TRUE(batch.converged);
    s.dense.optimise();
    EXPECT_NEAR(batch.cost, s.dense.cost(), 1e-8 * (1 + s.dense.cost()));
    // Undo everything that was switched, and redo: the same optimum.
    const double all = batch.cost;
    std::vector<int> off;
    for (int f = 0; f < s.graph.factors(); ++f)
      if (s.graph.active(f) && f % 3 == 2 && s.dense.factors[static_cast<std::size_t>(f)].poses.size() == 4)
        off.push_back(f);
    for (const int f : off) s.graph.set_active(f, false);
    s.graph.update();
    EXPECT_LE(s.graph.optimise().cost, all + 1e-9);
    for (const int f : off) s.graph.set_active(f, true);
    s.graph.update();
    EXPECT_NEAR(s.graph.optimise().cost, all, 1e-7 * (1 + all));
  }
}

TEST(IncrementalPoseGraph, CovariancesAreThoseOfTheDenseInverse) {
  Sessions s(7, {});
  for (int k = 0; k < 30; ++k) {
    s.step();
    s.graph.update();
  }
  s.graph.optimise();
  ASSERT_EQ(s.graph.update().held, 0) << "the scene should determine all";
  for (int i = 0; i < s.poses(); ++i) s.dense.poses[static_cast<std::size_t>(i)] = s.graph.pose(i);
  const Eigen::MatrixXd all = s.dense.covariance();
  const double tolerance = 1e-8 * all.cwiseAbs().maxCoeff();
  for (int i = 0; i < s.poses(); ++i) {
    Matrix6d marginal;
    ASSERT_TRUE(s.graph.marginal(i, &marginal)) << i;
    EXPECT_LT((marginal - all.block<6, 6>(6 * i, 6 * i)).cwiseAbs().maxCoeff(), tolerance) << i;
  }
  const std::vector<int> some{s.poses() - 1, 2, 5, 9};
  Eigen::MatrixXd joint;
  ASSERT_TRUE(s.graph.joint_marginal(some, &joint));
  for (int a = 0; a < 4; ++a)
    for (int b = 0; b < 4; ++b)
      EXPECT_LT((joint.block<6, 6>(6 * a, 6 * b) -
                 all.block<6, 6>(6 * some[static_cast<std::size_t>(a)], 6 * some[static_cast<std::size_t>(b)]))
                    .cwiseAbs()
                    .maxCoeff(),
                tolerance);
  // Relative: propagated by differences from the joint covariance.
  const int a = 4, b = s.poses() - 1;
  RigidTransform a_from_b;
  Matrix6d relative;
  ASSERT_TRUE(s.graph.relative_covariance(a, b, &a_from_b, &relative));
  EXPECT_LT(distance(a_from_b, s.graph.pose(a).inverse() * s.graph.pose(b)), 1e-12);
  Eigen::Matrix<double, 6, 12> J;
  for (int k = 0; k < 12; ++k) {
    const auto moved = [&](double h) {
      RigidTransform pa = s.graph.pose(a), pb = s.graph.pose(b);
      (k < 6 ? pa : pb) = RigidTransform::exp(h * Vector6d::Unit(k % 6)) * (k < 6 ? pa : pb);
      return Vector6d((pa.inverse() * pb * a_from_b.inverse()).log());
    };
    J.col(k) = (moved(1e-5) - moved(-1e-5)) / 2e-5;
  }
  const std::vector<int> pair{a, b};
  ASSERT_TRUE(s.graph.joint_marginal(pair, &joint));
  EXPECT_LT((J * joint * J.transpose() - relative).cwiseAbs().maxCoeff(),
            1e-7 * (J * joint * J.transpose()).cwiseAbs().maxCoeff());
}

TEST(IncrementalPoseGraph, WhatNoPriorDeterminesIsHeld) {
  IncrementalPoseGraph graph;
  const Matrix6d covariance = Matrix6d::Identity() * 1e-2;
  const RigidTransform stride(exp_so3(Eigen::Vector3d(0, 0, 0.3)), Eigen::Vector3d(1, 0, 0));
  for (int i = 0; i < 6; ++i) graph.add_pose(RigidTransform(Eigen::Matrix3d::Identity(), Eigen::Vector3d(i, 5, 0)));
  const RigidTransform alone = graph.pose(5);
  for (int i = 0; i < 3; ++i) graph.add_constraint(i, i + 1, stride, covariance);
  PoseGraphStep step = graph.update();
  EXPECT_EQ(step.held, 1);
  EXPECT_EQ(step.undetermined, 0);
  graph.optimise();
  EXPECT_NEAR(graph.cost(), 0, 1e-15);
  EXPECT_EQ(distance(graph.pose(5), alone), 0);
  EXPECT_EQ(distance(graph.pose(4), RigidTransform(Eigen::Matrix3d::Identity(), Eigen::Vector3d(4, 5, 0))), 0);
  Matrix6d c;
  RigidTransform relative;
  EXPECT_FALSE(graph.marginal(2, &c));
  EXPECT_FALSE(graph.marginal(5, &c));
  EXPECT_TRUE(graph.relative_covariance(0, 1, &relative, &c));
  EXPECT_LT((c - covariance).cwiseAbs().maxCoeff(), 1e-10);
  EXPECT_FALSE(graph.relative_covariance(0, 5, &relative, &c));

  const int prior = graph.add_prior(2, alone, covariance);
  step = graph.update();
  EXPECT_EQ(step.held, 0);
  graph.optimise();
  ASSERT_TRUE(graph.marginal(2, &c));
  EXPECT_LT((c - covariance).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT(distance(graph.pose(2), alone), 1e-6);
  EXPECT_FALSE(graph.marginal(4, &c));
  // Without the prior again; then a constraint is taken away and two parts are held.
  graph.set_active(prior, false);
  EXPECT_EQ(graph.update().held, 1);
  EXPECT_FALSE(graph.marginal(2, &c));
  graph.set_active(1, false);
  step = graph.update();
  EXPECT_EQ(step.held, 2);
  EXPECT_EQ(step.undetermined, 0);
  graph.set_active(0, false);  // pose 0 is alone now, and stays
  const RigidTransform there = graph.pose(0);
  graph.update();
  graph.optimise();
  EXPECT_LT(distance(graph.pose(0), there), 1e-12);
  EXPECT_FALSE(graph.relative_covariance(0, 1, &relative, &c));
  EXPECT_TRUE(graph.relative_covariance(2, 3, &relative, &c));
}

TEST(IncrementalPoseGraph, BuildingStaysNearTheBatchOptimum) {
  const auto building = testing::make_building({.poses = 700, .corridors_x = 3, .corridors_y = 2, .loop_every = 10}, 4);
  const auto run = [&](bool compare) {
    IncrementalPoseGraph graph;
    std::size_t m = 0;
    for (int i = 0; i < 700; ++i) {
      graph.add_pose(i == 0 ? building.truth[0] : graph.pose(i - 1) * building.measurements[m].from_from_to);
      if (i == 0) graph.add_prior(0, building.truth[0], Matrix6d::Identity() * 1e-6);
      for (; m < building.measurements.size() && building.measurements[m].to == i; ++m)
        graph.add_constraint(building.measurements[m].from, i, building.measurements[m].from_from_to,
                             building.measurements[m].covariance);
      const PoseGraphStep step = graph.update();
      EXPECT_EQ(step.undetermined, 0);
      if (!compare || i % 100 != 99) continue;
      // A graph that starts from these poses and is solved in batch.
      IncrementalPoseGraph batch;
      for (int k = 0; k <= i; ++k) batch.add_pose(graph.pose(k));
      batch.add_prior(0, building.truth[0], Matrix6d::Identity() * 1e-6);
      for (std::size_t k = 0; k < m; ++k)
        batch.add_constraint(building.measurements[k].from, building.measurements[k].to,
                             building.measurements[k].from_from_to, building.measurements[k].covariance);
      const PoseGraphStep best = batch.optimise();
      EXPECT_TRUE(best.converged);
      EXPECT_LE(best.cost, step.cost + 1e-9);
      EXPECT_LT(step.cost, 1.01 * best.cost + 0.01) << "pose " << i;
    }
    return graph;
  };
  IncrementalPoseGraph graph = run(true);
  const IncrementalPoseGraph again = run(false);
  for (int i = 0; i < 700; ++i) ASSERT_EQ(distance(graph.pose(i), again.pose(i)), 0) << "not the same bits";
  // The residuals are what chi-squared says (six a measurement, less six a pose).
  const double dof = 6.0 * static_cast<double>(building.measurements.size() - 699);
  EXPECT_NEAR(2 * graph.optimise().cost, dof, 5 * std::sqrt(2 * dof));
  for (int i = 0; i < 700; i += 50)
    EXPECT_LT((graph.pose(i).t - building.truth[static_cast<std::size_t>(i)].t).norm(), 0.5);
}

TEST(IncrementalPoseGraph, RobustLoopsAndANewStart) {
  for (const RobustKernel kernel : {RobustKernel::huber, RobustKernel::tukey}) {
    const auto building =
        testing::make_building({.poses = 300, .corridors_x = 2, .corridors_y = 2, .storeys = 1, .loop_every = 6}, 6);
    IncrementalPoseGraph graph;
    std::size_t m = 0;
    int wrong = -1;
    for (int i = 0; i < 300; ++i) {
      graph.add_pose(i == 0 ? building.truth[0] : graph.pose(i - 1) * building.measurements[m].from_from_to);
      if (i == 0) graph.add_prior(0, building.truth[0], Matrix6d::Identity() * 1e-6);
      for (; m < building.measurements.size() && building.measurements[m].to == i; ++m)
        graph.add_constraint(building.measurements[m].from, i, building.measurements[m].from_from_to,
                             building.measurements[m].covariance,
                             building.measurements[m].from == i - 1 ? RobustKernel::none : kernel);
      if (i == 150)
        wrong = graph.add_constraint(2, i, RigidTransform(Eigen::Matrix3d::Identity(), Eigen::Vector3d(4, 4, 0)),
                                     testing::diagonal_covariance(0.05, 0.02), kernel);
      graph.update();
    }
    graph.optimise();
    const auto worst = [&] {
      double most = 0;
      for (int i = 0; i < 300; ++i)
        most = std::max(most, (graph.pose(i).t - building.truth[static_cast<std::size_t>(i)].t).norm());
      return most;
    };
    EXPECT_GT(graph.factor_error(wrong), 100);
    const double with = worst();
    graph.set_active(wrong, false);
    graph.update();
    graph.optimise();
    const double without = worst(), cost = graph.cost();
    EXPECT_LT(without, 1.0);
    if (kernel == RobustKernel::tukey) {
      EXPECT_LT(with, without + 0.05);
    }
    // A bad start for some poses: the same optimum.
    for (int i = 100; i < 130; ++i)
      graph.set_pose(i,
                     RigidTransform::exp((Vector6d() << 0.1, -0.1, 0.1, 0.03, 0.02, -0.05).finished()) * graph.pose(i));
    EXPECT_GT(graph.cost(), 1.05 * cost);
    graph.update();
    graph.update();
    EXPECT_LT(graph.cost(), 1.02 * cost);
    EXPECT_NEAR(graph.optimise().cost, cost, 1e-6 * cost);
  }
}

TEST(IncrementalPoseGraph, RefusesWhatIsNoMeasurement) {
  IncrementalPoseGraph graph;
  const double nan = std::nan("");
  const Matrix6d good = Matrix6d::Identity();
  EXPECT_EQ(graph.add_pose(RigidTransform(Eigen::Matrix3d::Identity(), Eigen::Vector3d(nan, 0, 0))), -1);
  EXPECT_EQ(graph.add_pose(RigidTransform(Eigen::Matrix3d(2 * Eigen::Matrix3d::Identity()), Eigen::Vector3d::Zero())),
            -1);
  ASSERT_EQ(graph.add_pose({}), 0);
  ASSERT_EQ(graph.add_pose({}), 1);
  Matrix6d bad = good;
  bad(0, 0) = nan;
  EXPECT_EQ(graph.add_constraint(0, 1, {}, bad), -1);
  bad(0, 0) = -1;
  EXPECT_EQ(graph.add_constraint(0, 1, {}, bad), -1);
  bad = Matrix6d::Zero();
  EXPECT_EQ(graph.add_prior(0, {}, bad), -1);
  bad = good;
  bad(0, 1) = 0.5;  // not symmetric
  EXPECT_EQ(graph.add_constraint(0, 1, {}, bad), -1);
  Eigen::Matrix3d mirror = Eigen::Matrix3d::Identity();
  mirror(0, 0) = -1;
  EXPECT_EQ(graph.add_constraint(0, 1, RigidTransform(mirror, Eigen::Vector3d::Zero()), good), -1);
  EXPECT_EQ(graph.factors(), 0);
  EXPECT_THROW(graph.add_constraint(0, 2, {}, good), CheckFailure);
  EXPECT_THROW(graph.add_constraint(1, 1, {}, good), CheckFailure);
  EXPECT_THROW(graph.pose(2), CheckFailure);
  EXPECT_THROW(graph.set_active(0, false), CheckFailure);
  EXPECT_THROW(graph.factor_error(-1), CheckFailure);
  EXPECT_THROW(IncrementalPoseGraph({.relinearise_above = -1}), InputError);
  EXPECT_EQ(graph.update().eliminated, 0);
  // An empty graph and one that is asked to stop.
  ASSERT_EQ(graph.add_prior(0, {}, good), 0);
  ASSERT_EQ(graph.add_constraint(0, 1, RigidTransform(Eigen::Matrix3d::Identity(), Eigen::Vector3d(1, 0, 0)), good), 1);
  EXPECT_TRUE(graph.update(Interruption::at_poll(2)).stopped);
  Matrix6d c;
  EXPECT_FALSE(graph.marginal(0, &c));
  EXPECT_TRUE(graph.optimise(Interruption::at_poll(1)).stopped);
  EXPECT_FALSE(graph.update().stopped);
  EXPECT_LT((graph.pose(1).t - Eigen::Vector3d(1, 0, 0)).norm(), 1e-9);
  graph.optimise();
  EXPECT_TRUE(graph.marginal(1, &c));
  EXPECT_LT((c - 2 * good).cwiseAbs().maxCoeff(), 1e-8);
}

}  // namespace
}  // namespace parallax
