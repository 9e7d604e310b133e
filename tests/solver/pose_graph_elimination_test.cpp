// The pieces of the incremental pose graph: factors against central differences, the elimination tree against dense
// algebra, and which poses have to be held.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

#include "solver/incremental_gauge.h"
#include "solver/pose_graph_factor.h"
#include "solver/sparse_elimination.h"
#include "solver/sparse_kernels.h"

namespace parallax::solver {
namespace {

TEST(PoseGraphFactor, JacobiansAreTheirDerivatives) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto any = [&](double turn, double way) {
    Eigen::Vector3d w(uniform(random), uniform(random), uniform(random));
    w *= turn * std::abs(uniform(random)) / w.norm();
    return RigidTransform(exp_so3(w), way * Eigen::Vector3d(normal(random), normal(random), normal(random)));
  };
  const auto check = [](const auto& function, const RigidTransform& pose, const Matrix6d& J) {
    Matrix6d numeric;
    constexpr double h = 1e-4;
    for (int k = 0; k < 6; ++k) {
      const Vector6d d = h * Vector6d::Unit(k);
      numeric.col(k) = (8 * (function(moved(pose, d)) - function(moved(pose, -d))) -
                        (function(moved(pose, 2 * d)) - function(moved(pose, -2 * d)))) /
                       (12 * h);
    }
    EXPECT_LT((numeric - J).cwiseAbs().maxCoeff(), 1e-8 * (1 + J.cwiseAbs().maxCoeff())) << numeric << "\n\n" << J;
  };
  for (int trial = 0; trial < 300; ++trial) {
    // Residuals from none to nearly half a turn, places from near to far.
    const double way = trial % 3 == 0 ? 0.1 : trial % 3 == 1 ? 3 : 40;
    const double off = trial % 5 == 0 ? 1e-7 : trial % 5 == 1 ? 0.02 : trial % 5 == 2 ? 0.12 : trial % 5 == 3 ? 1 : 2.8;
    const RigidTransform A = any(3.1, way), x = any(3.1, way), B = any(3.1, way), y = any(3.1, way);
    const RigidTransform error = any(off, off);
    Matrix6d J[4];
    {
      const RigidTransform z = error * x;
      prior_residual(z, x, J);
      check([&](const RigidTransform& p) { return prior_residual(z, p, nullptr); }, x, J[0]);
      EXPECT_LT((RigidTransform::exp(prior_residual(z, x, nullptr)) * z * x.inverse()).log().norm(), 1e-9 * (1 + way));
    }
    {
      const RigidTransform z = error * (x.inverse() * y);
      constraint_residual(z, x, y, J, J + 1);
      check([&](const RigidTransform& p) { return constraint_residual(z, p, y, nullptr, nullptr); }, x, J[0]);
      check([&](const RigidTransform& p) { return constraint_residual(z, x, p, nullptr, nullptr); }, y, J[1]);
    }
    const RigidTransform z = error * ((A * x).inverse() * (B * y));
    encounter_residual(z, A, x, B, y, J, J + 1, J + 2, J + 3);
    const auto residual = [&](const RigidTransform& a, const RigidTransform& p, const RigidTransform& b,
                              const RigidTransform& q) {
      return encounter_residual(z, a, p, b, q, nullptr, nullptr, nullptr, nullptr);
    };
    check([&](const RigidTransform& p) { return residual(p, x, B, y); }, A, J[0]);
    check([&](const RigidTransform& p) { return residual(A, p, B, y); }, x, J[1]);
    check([&](const RigidTransform& p) { return residual(A, x, p, y); }, B, J[2]);
    check([&](const RigidTransform& p) { return residual(A, x, B, p); }, y, J[3]);
    // Moves, and how they add up.
    Vector6d d = move_between(x, y);
    EXPECT_LT((moved(x, d).R - y.R).norm() + (moved(x, d).t - y.t).norm(), 1e-11 * (1 + way));
    d.tail<3>() *= 0.5;
    check([&](const RigidTransform& p) { return move_between(moved(x, d), moved(x, d + move_between(x, p))); }, x,
          move_jacobian(d));
  }
}

// Fronts of every shape against a plain factorisation.
TEST(SparseKernels, FactorPartially) {
  std::mt19937_64 random(2);
  std::normal_distribution<double> normal;
  for (const auto& [rows, columns] :
       {std::pair{1, 1}, {7, 6}, {13, 6}, {19, 18}, {40, 9}, {61, 60}, {150, 97}, {131, 1}}) {
    Eigen::MatrixXd A(rows, rows + 3);
    for (Eigen::Index i = 0; i < A.size(); ++i) A.data()[i] = normal(random);
    const Eigen::MatrixXd H = A * A.transpose() + Eigen::MatrixXd::Identity(rows, rows);
    const int stride = sparse_padded(rows), rest = rows - columns, rest_stride = sparse_padded(rest);
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic> panel = Eigen::MatrixXd::Zero(stride, columns + 2),
                                                          u = Eigen::MatrixXd::Zero(rest_stride, rest + 2);
    panel.topLeftCorner(rows, columns) = H.leftCols(columns);
    u.topLeftCorner(rest, rest) = H.bottomRightCorner(rest, rest);
    EXPECT_EQ(sparse_kernels().factor_panel(panel.data(), rows, columns, stride), 0);
    sparse_kernels().reduce(u.data(), rest_stride, panel.data() + columns, stride, rest, columns);
    const Eigen::MatrixXd L = H.topLeftCorner(columns, columns).llt().matrixL();
    Eigen::MatrixXd below(rest, columns);
    if (rest > 0) below = L.triangularView<Eigen::Lower>().solve(H.topRightCorner(columns, rest)).transpose();
    const Eigen::MatrixXd left = H.bottomRightCorner(rest, rest) - below * below.transpose();
    const double tolerance = 1e-10 * H.cwiseAbs().maxCoeff();
    for (int j = 0; j < columns; ++j)
      for (int i = j; i < rows; ++i)
        ASSERT_NEAR(panel(i, j), i < columns ? L(i, j) : below(i - columns, j), tolerance) << rows << " " << columns;
    for (int j = 0; j < rest; ++j)
      for (int i = j; i < rest; ++i) ASSERT_NEAR(u(i, j), left(i, j), tolerance) << rows << " " << columns;
  }
}

TEST(SparseElimination, FollowsADenseSystemThroughAnyChange) {
  for (const auto& [block, sides] : {std::pair{6, 1}, {3, 2}, {2, 1}, {1, 3}}) {
    std::mt19937_64 random(static_cast<std::uint64_t>(block));
    std::normal_distribution<double> normal;
    const auto pick = [&](int n) { return std::uniform_int_distribution<int>(0, n - 1)(random); };
    SparseElimination tree(block, sides);
    const int n = 40, size = n * block;
    Eigen::MatrixXd H(size, size), g(size, sides);
    std::vector<int> late;
    const auto fill = [&, sides = sides](int element) {
      auto values = tree.element(element);
      const auto m = values.cols();
      Eigen::MatrixXd J(m + 1, m);
      for (Eigen::Index i = 0; i < J.size(); ++i) J.data()[i] = normal(random);
      values.topRows(m) = J.transpose() * J + 0.1 * Eigen::MatrixXd::Identity(m, m);
      for (Eigen::Index i = 0; i < m; ++i)
        for (int s = 0; s < sides; ++s) values(m + s, i) = normal(random);
    };
    for (int i = 0; i < n; ++i) tree.add_variable();
    std::vector<int> changed;
    for (int round = 0; round < 60; ++round) {
      late.clear();
      for (int k = pick(4); k >= 0; --k) {
        const int what = tree.elements() < 20 ? 0 : pick(4);
        if (what == 0) {  // a new element; near neighbours, mostly
          const int a = pick(n), count = 1 + pick(3);
          std::vector<int> set{a};
          for (int v = 1; v < count; ++v) {
            const int b = pick(3) > 0 ? (a + v) % n : pick(n);
            if (std::find(set.begin(), set.end(), b) == set.end()) set.push_back(b);
          }
          fill(tree.add_element(set));
          late = set;
        } else if (what == 1) {
          const int e = pick(tree.elements());
          tree.set_active(e, !tree.active(e));
        } else {
          const int e = pick(tree.elements());
          tree.change(e);
          fill(e);
        }
      }
      if (round % 17 == 16) tree.mark_all();
      EXPECT_EQ(tree.update(late).lost, 0);
      tree.solve(round % 2 == 0 ? 0 : 1e-13, &changed);

      H.setIdentity();
      g.setZero();
      std::vector<int> taking_part;
      for (int v = 0; v < n; ++v)
        if (tree.takes_part(v)) {
          H.block(v * block, v * block, block, block).setZero();
          taking_part.push_back(v);
        }
      for (int e = 0; e < tree.elements(); ++e) {
        if (!tree.active(e)) continue;
        const auto set = tree.element_variables(e);
        const auto values = tree.element(e);
        for (std::size_t i = 0; i < set.size(); ++i) {
          g.middleRows(set[i] * block, block) +=
              values.block(values.cols(), static_cast<int>(i) * block, sides, block).transpose();
          for (std::size_t j = 0; j < set.size(); ++j)
            H.block(set[i] * block, set[j] * block, block, block) +=
                values.block(static_cast<int>(i) * block, static_cast<int>(j) * block, block, block);
        }
      }
      const Eigen::MatrixXd inverse = H.llt().solve(Eigen::MatrixXd::Identity(size, size)), x = -inverse * g;
      for (const int v : taking_part)
        ASSERT_LT((tree.solution(v) - x.middleRows(v * block, block)).cwiseAbs().maxCoeff(),
                  1e-9 * (1 + x.cwiseAbs().maxCoeff()))
            << round;
      const int a = taking_part[static_cast<std::size_t>(pick(static_cast<int>(taking_part.size())))];
      const int b = taking_part[static_cast<std::size_t>(pick(static_cast<int>(taking_part.size())))];
      if (a == b) continue;
      const int both[2] = {a, b};
      const Eigen::MatrixXd joint = tree.inverse_block(both);
      ASSERT_LT((joint.topRightCorner(block, block) - inverse.block(a * block, b * block, block, block))
                    .cwiseAbs()
                    .maxCoeff(),
                1e-9 * (1 + inverse.cwiseAbs().maxCoeff()));
      ASSERT_LT(
          (joint.topLeftCorner(block, block) - inverse.block(a * block, a * block, block, block)).cwiseAbs().maxCoeff(),
          1e-9 * (1 + inverse.cwiseAbs().maxCoeff()));
      Eigen::VectorXd rhs = g.col(0);
      tree.solve_in_place(&rhs);
      for (const int v : taking_part)
        ASSERT_LT((rhs.segment(v * block, block) + x.col(0).segment(v * block, block)).cwiseAbs().maxCoeff(),
                  1e-9 * (1 + x.cwiseAbs().maxCoeff()));
    }
  }
}

// Everybody knows everybody, so there is one large clique; what is appended to its end leaves the rest of it as it is.
TEST(SparseElimination, KeepsTheColumnsBeforeWhatIsAppended) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  constexpr int kBlock = 3, kFirst = 48, kAppended = 24;
  SparseElimination tree(kBlock);
  const auto fill = [&](int element) {
    auto values = tree.element(element);
    const auto m = values.cols();
    Eigen::MatrixXd J(m + 1, m);
    for (Eigen::Index i = 0; i < J.size(); ++i) J.data()[i] = normal(random);
    values.topRows(m) = J.transpose() * J + 0.1 * Eigen::MatrixXd::Identity(m, m);
    for (Eigen::Index i = 0; i < m; ++i) values(m, i) = normal(random);
  };
  const auto add = [&](std::initializer_list<int> variables) {
    const int element = tree.add_element(std::vector<int>(variables));
    fill(element);
    return element;
  };
  for (int i = 0; i < kFirst; ++i) tree.add_variable();
  for (int i = 0; i < kFirst; ++i)
    for (int j = 0; j < i; ++j) add({i, j});
  const int last_of_first[1] = {kFirst - 1};
  tree.update(last_of_first);
  std::vector<int> changed;
  tree.solve(0, &changed);
  int kept = 0;
  for (int k = 0; k < kAppended; ++k) {
    const int fresh = tree.add_variable(), before = fresh - 1;
    const int late[2] = {before, fresh};
    add({before, fresh});
    if (k % 6 == 4) {  // a loop: from somewhere in the middle on
      add({fresh, 5 + k % 11});
    } else if (k % 6 == 2) {  // what was appended before changes, or goes
      tree.set_active(tree.elements() - 2, k % 12 == 2);
      const int element = tree.elements() - 1;
      tree.change(element);
      fill(element);
    }
    const auto outcome = tree.update(late);
    if (k % 6 < 2) {
      EXPECT_LT(outcome.variables, 12) << k;
      kept += outcome.variables < 12;
    }
    tree.solve(k % 2 == 0 ? 0 : 1e-13, &changed);
    const int n = tree.variables() * kBlock;
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd g = Eigen::VectorXd::Zero(n);
    for (int e = 0; e < tree.elements(); ++e) {
      if (!tree.active(e)) continue;
      const auto set = tree.element_variables(e);
      const auto values = tree.element(e);
      for (std::size_t i = 0; i < set.size(); ++i) {
        const auto row = static_cast<Eigen::Index>(i) * kBlock;
        g.segment(set[i] * kBlock, kBlock) += values.block(values.cols(), row, 1, kBlock).transpose();
        for (std::size_t j = 0; j < set.size(); ++j)
          H.block(set[i] * kBlock, set[j] * kBlock, kBlock, kBlock) +=
              values.block(row, static_cast<Eigen::Index>(j) * kBlock, kBlock, kBlock);
      }
    }
    const Eigen::MatrixXd inverse = H.llt().solve(Eigen::MatrixXd::Identity(n, n));
    const Eigen::VectorXd x = -inverse * g;
    for (int v = 0; v < tree.variables(); ++v)
      ASSERT_LT((tree.solution(v) - x.segment(v * kBlock, kBlock)).cwiseAbs().maxCoeff(),
                1e-9 * (1 + x.cwiseAbs().maxCoeff()))
          << k << ' ' << v;
    const int both[2] = {3, fresh};
    ASSERT_LT((tree.inverse_block(both).topRightCorner(kBlock, kBlock) -
               inverse.block(3 * kBlock, fresh * kBlock, kBlock, kBlock))
                  .cwiseAbs()
                  .maxCoeff(),
              1e-9 * (1 + inverse.cwiseAbs().maxCoeff()));
  }
  EXPECT_EQ(kept, 8);
  EXPECT_EQ(tree.refactor().lost, 0);
}

TEST(IncrementalGauge, HoldsTheFewestPoses) {
  IncrementalGauge gauge;
  for (int i = 0; i < 8; ++i) gauge.add_pose();
  const std::vector<int> all{0, 1, 2, 3, 4, 5};
  gauge.add_constraint(0, 1);
  gauge.add_constraint(2, 3);
  EXPECT_EQ(gauge.to_hold(all), (std::vector<int>{0, 2, 4, 5}));
  EXPECT_TRUE(gauge.relative_determined(0, 1));
  EXPECT_FALSE(gauge.relative_determined(0, 2));
  gauge.add_prior(1);
  EXPECT_TRUE(gauge.determined(0));
  EXPECT_EQ(gauge.to_hold(all), (std::vector<int>{2, 4, 5}));
  // Anchors 4 (of 0 and 1) and 5 (of 2 and 3): one encounter leaves the second session and both anchors free; one
  // anchor and one pose hold them.
  gauge.add_encounter(4, 0, 5, 2);
  EXPECT_EQ(gauge.to_hold(all), (std::vector<int>{2, 4}));
  gauge.add_prior(4);
  EXPECT_EQ(gauge.to_hold(all), (std::vector<int>{2}));
  gauge.add_prior(3);
  EXPECT_TRUE(gauge.to_hold(all).empty());
  gauge.clear();
  EXPECT_EQ(gauge.to_hold(all).size(), 6u);
}

}  // namespace
}  // namespace parallax::solver
