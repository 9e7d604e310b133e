#include "core/se3.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <random>

namespace parallax {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

class Se3Test : public ::testing::Test {
 protected:
  Vector3d random_vector(double scale) {
    return scale * Vector3d(normal_(random_), normal_(random_), normal_(random_));
  }
  Vector3d random_direction() { return random_vector(1).normalized(); }
  Vector6d random_tangent(double scale) {
    Vector6d mu;
    mu << random_vector(scale), random_vector(scale);
    return mu;
  }
  RigidTransform random_pose() { return {exp_so3(random_vector(1)), random_vector(2)}; }

  std::mt19937 random_{11};
  std::normal_distribution<double> normal_;
};

void expect_near(const RigidTransform& a, const RigidTransform& b, double tolerance) {
  EXPECT_LT((a.R - b.R).norm(), tolerance);
  EXPECT_LT((a.t - b.t).norm(), tolerance);
}

// The series of the matrix exponential of the 4x4 twist: slow and independent.
Eigen::Matrix4d exp_series(const Vector6d& mu) {
  Eigen::Matrix4d twist = Eigen::Matrix4d::Zero();
  twist.topLeftCorner<3, 3>() = hat(mu.tail<3>());
  twist.topRightCorner<3, 1>() = mu.head<3>();
  Eigen::Matrix4d sum = Eigen::Matrix4d::Identity(), term = sum;
  for (int i = 1; i < 60; ++i) {
    term = (term * twist / i).eval();
    sum += term;
  }
  return sum;
}

TEST_F(Se3Test, HatIsTheCrossProduct) {
  const Vector3d a(1, -2, 3), b(0.5, 4, -1);
  EXPECT_EQ(hat(a) * b, a.cross(b));
  EXPECT_EQ(hat(a), -hat(a).transpose());
}

TEST_F(Se3Test, ExpIsTheMatrixExponential) {
  for (const double scale : {0.0, 1e-9, 1e-5, 1e-4, 1e-3, 1e-2, 0.3, 1.0, 2.0}) {
    for (int i = 0; i < 20; ++i) {
      const Vector6d mu = random_tangent(scale);
      const Eigen::Matrix4d expected = exp_series(mu);
      const RigidTransform T = RigidTransform::exp(mu);
      EXPECT_LT((T.R - expected.topLeftCorner<3, 3>()).norm(), 1e-12) << scale;
      EXPECT_LT((T.t - expected.topRightCorner<3, 1>()).norm(), 1e-12 * (1 + mu.norm())) << scale;
      EXPECT_LT((exp_so3(mu.tail<3>()) - T.R).norm(), 1e-15);
    }
  }
}

TEST_F(Se3Test, LogOfExpNearZeroAndNearPi) {
  const double pi = std::numbers::pi;
  for (const double angle :
       {0.0, 1e-12, 1e-8, 1e-6, 1e-4, 1e-3, 1e-2, 0.5, 1.5, 3.0, pi - 1e-2, pi - 1e-4, pi - 1e-6}) {
    for (int i = 0; i < 50; ++i) {
      const Vector3d w = angle * random_direction();
      EXPECT_LT((log_so3(exp_so3(w)) - w).norm(), 1e-9) << angle;
      Vector6d mu;
      mu << random_vector(1), w;
      EXPECT_LT((RigidTransform::exp(mu).log() - mu).norm(), 1e-8) << angle;
    }
  }
}

TEST_F(Se3Test, ExpOfLogAtAndAroundPi) {
  const double pi = std::numbers::pi;
  for (const double angle : {pi - 1e-7, pi - 1e-9, pi - 1e-12, pi, pi + 1e-9, pi + 1e-5}) {
    for (int i = 0; i < 50; ++i) {
      const Vector3d axis = i < 3 ? Vector3d(Vector3d::Unit(i)) : random_direction();
      const Matrix3d R = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
      const Vector3d w = log_so3(R);
      EXPECT_LE(w.norm(), pi + 1e-12);
      EXPECT_NEAR(w.norm(), angle <= pi ? angle : 2 * pi - angle, 1e-7);
      EXPECT_LT((exp_so3(w) - R).norm(), 1e-7) << angle << " about " << axis.transpose();
    }
  }
}

TEST_F(Se3Test, GroupLaws) {
  for (int i = 0; i < 100; ++i) {
    const RigidTransform a = random_pose(), b = random_pose();
    const Vector3d p = random_vector(3);
    EXPECT_LT(((a * b) * p - a * (b * p)).norm(), 1e-12);
    expect_near(a * a.inverse(), RigidTransform(), 1e-13);
    expect_near(RigidTransform(a.quaternion(), a.t), a, 1e-13);
    EXPECT_NEAR(a.angle(), Eigen::AngleAxisd(a.R).angle(), 1e-9);
  }
}

TEST_F(Se3Test, AdjointMovesAnUpdateAcross) {
  for (int i = 0; i < 100; ++i) {
    const RigidTransform T = random_pose();
    const Vector6d mu = random_tangent(0.5);
    expect_near(RigidTransform::exp(T.adjoint() * mu) * T, T * RigidTransform::exp(mu), 1e-10);
  }
}

TEST_F(Se3Test, LeftPerturbationDerivative) {
  // d (exp(mu) p) / d mu at 0 = [I | -hat(p)].
  for (int i = 0; i < 50; ++i) {
    const Vector3d p = random_vector(2);
    Eigen::Matrix<double, 3, 6> expected, numeric;
    expected << Matrix3d::Identity(), -hat(p);
    for (int k = 0; k < 6; ++k) {
      const Vector6d step = 1e-6 * Vector6d::Unit(k);
      numeric.col(k) = (RigidTransform::exp(step) * p - RigidTransform::exp(-step) * p) / 2e-6;
    }
    EXPECT_LT((expected - numeric).norm(), 1e-8);
  }
}

TEST_F(Se3Test, OrthonormaliseGivesTheNearestRotation) {
  RigidTransform T = random_pose();
  const Matrix3d exact = T.R;
  T.R += 1e-4 * Matrix3d::Random();
  T.orthonormalise();
  EXPECT_LT((T.R * T.R.transpose() - Matrix3d::Identity()).norm(), 1e-14);
  EXPECT_NEAR(T.R.determinant(), 1, 1e-14);
  EXPECT_LT((T.R - exact).norm(), 1e-3);
}

TEST_F(Se3Test, RebaseLeavesProjectionsUnchanged) {
  for (int i = 0; i < 100; ++i) {
    const SimilarityTransform new_from_old(std::exp(normal_(random_)), exp_so3(random_vector(1)), random_vector(2));
    const RigidTransform camera_from_old = random_pose();
    const RigidTransform camera_from_new = new_from_old.rebase(camera_from_old);
    EXPECT_LT((camera_from_new.R * camera_from_new.R.transpose() - Matrix3d::Identity()).norm(), 1e-13);
    const Vector3d p_old = random_vector(3);
    const Vector3d before = camera_from_old * p_old, after = camera_from_new * (new_from_old * p_old);
    EXPECT_LT((after - new_from_old.s * before).norm(), 1e-11 * (1 + after.norm()));
    // The camera centre moves with the world.
    EXPECT_LT((camera_from_new.inverse().t - new_from_old * camera_from_old.inverse().t).norm(), 1e-11);
  }
}

TEST_F(Se3Test, SimilarityGroupLaws) {
  for (int i = 0; i < 50; ++i) {
    const SimilarityTransform a(std::exp(normal_(random_)), exp_so3(random_vector(1)), random_vector(2));
    const SimilarityTransform b(std::exp(normal_(random_)), exp_so3(random_vector(1)), random_vector(2));
    const Vector3d p = random_vector(3);
    EXPECT_LT(((a * b) * p - a * (b * p)).norm(), 1e-10 * (1 + (a * (b * p)).norm()));
    EXPECT_LT((a.inverse() * (a * p) - p).norm(), 1e-11 * (1 + p.norm()));
  }
}

TEST_F(Se3Test, AlignPointsExact) {
  for (const int n : {3, 4, 50}) {
    const SimilarityTransform truth(2.7, exp_so3({0.3, 2.5, -1.0}), {4, -5, 6});
    Eigen::Matrix3Xd src(3, n), dst(3, n);
    for (int i = 0; i < n; ++i) {
      src.col(i) = random_vector(2);
      dst.col(i) = truth * Vector3d(src.col(i));
    }
    SimilarityTransform found;
    ASSERT_TRUE(align_points(src, dst, true, &found));
    EXPECT_NEAR(found.s, truth.s, 1e-10);
    EXPECT_LT((found.R - truth.R).norm(), 1e-9);
    EXPECT_LT((found.t - truth.t).norm(), 1e-9);

    const RigidTransform rigid(truth.R, truth.t);
    for (int i = 0; i < n; ++i) dst.col(i) = rigid * Vector3d(src.col(i));
    ASSERT_TRUE(align_points(src, dst, false, &found));
    EXPECT_EQ(found.s, 1);
    EXPECT_LT((found.R - truth.R).norm() + (found.t - truth.t).norm(), 1e-9);
  }
}

TEST_F(Se3Test, AlignPointsOfAPlaneIsARotationNotAReflection) {
  const SimilarityTransform truth(1.5, exp_so3({0, 3.0, 0.5}), {1, 2, 3});
  Eigen::Matrix3Xd src(3, 10), dst(3, 10);
  for (int i = 0; i < 10; ++i) {
    src.col(i) = random_vector(1);
    src(2, i) = 0;
    dst.col(i) = truth * Vector3d(src.col(i));
  }
  SimilarityTransform found;
  ASSERT_TRUE(align_points(src, dst, true, &found));
  EXPECT_NEAR(found.R.determinant(), 1, 1e-12);
  EXPECT_LT((found.R - truth.R).norm(), 1e-9);
}

TEST_F(Se3Test, AlignPointsNoisyIsTheLeastSquaresOptimum) {
  const SimilarityTransform truth(0.4, exp_so3({1, -0.5, 0.2}), {1, 2, 3});
  Eigen::Matrix3Xd src(3, 400), dst(3, 400);
  for (int i = 0; i < 400; ++i) {
    src.col(i) = random_vector(2);
    dst.col(i) = truth * Vector3d(src.col(i)) + random_vector(0.01);
  }
  SimilarityTransform found;
  ASSERT_TRUE(align_points(src, dst, true, &found));
  EXPECT_NEAR(found.s, truth.s, 0.002);
  EXPECT_LT((found.R - truth.R).norm(), 0.01);
  EXPECT_LT((found.t - truth.t).norm(), 0.01);
  const auto cost = [&](const SimilarityTransform& T) {
    double sum = 0;
    for (int i = 0; i < 400; ++i) sum += (dst.col(i) - T * Vector3d(src.col(i))).squaredNorm();
    return sum;
  };
  const double least = cost(found);
  EXPECT_LT(least, cost(truth));
  for (int i = 0; i < 7; ++i) {
    for (const double step : {-1e-4, 1e-4}) {
      SimilarityTransform moved = found;
      if (i < 3) moved.t[i] += step;
      if (i >= 3 && i < 6) moved.R = exp_so3(step * Vector3d::Unit(i - 3)) * moved.R;
      if (i == 6) moved.s += step;
      EXPECT_GT(cost(moved), least) << i;
    }
  }
}

TEST_F(Se3Test, AlignPointsRefusesDegenerateSets) {
  SimilarityTransform found;
  EXPECT_FALSE(align_points(Eigen::Matrix3Xd::Random(3, 2), Eigen::Matrix3Xd::Random(3, 2), true, &found));
  Eigen::Matrix3Xd line(3, 6);
  for (int i = 0; i < 6; ++i) line.col(i) = Vector3d(1, 2, 3) + i * Vector3d(0.3, -1, 0.2);
  EXPECT_FALSE(align_points(line, line, true, &found));
  const Eigen::Matrix3Xd point = Vector3d(1, 2, 3).replicate(1, 6);
  EXPECT_FALSE(align_points(point, point, true, &found));
}

}  // namespace
}  // namespace parallax
