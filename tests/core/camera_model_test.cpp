#include "core/camera_model.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <random>

#include "camera_model_cases.h"
#include "core/error.h"
#include "core/se3.h"

namespace parallax {
namespace {

using testing::camera_cases;
using testing::CameraCase;
using testing::points_over_image;
using enum CameraModelKind;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

class EveryCamera : public ::testing::TestWithParam<CameraCase> {
 protected:
  const CameraModel& camera() const { return GetParam().camera; }
};

INSTANTIATE_TEST_SUITE_P(CameraModel, EveryCamera, ::testing::ValuesIn(camera_cases()),
                         [](const auto& instance) { return instance.param.name; });

TEST_P(EveryCamera, PointJacobianAgreesWithCentralDifferences) {
  const auto points = points_over_image(camera(), 24);
  ASSERT_GT(points.size(), 300u);
  for (const Eigen::Vector3d& p : points) {
    Eigen::Vector2d pixel, same;
    Eigen::Matrix<double, 2, 3> jacobian, numeric;
    ASSERT_TRUE(camera().project(p, &pixel, &jacobian));
    ASSERT_TRUE(camera().project(p, &same));
    EXPECT_EQ(pixel, same);
    const double h = 1e-6 * p.norm();
    for (int i = 0; i < 3; ++i) {
      Eigen::Vector3d plus = p, minus = p;
      plus[i] += h;
      minus[i] -= h;
      Eigen::Vector2d a, b;
      ASSERT_TRUE(camera().project(plus, &a) && camera().project(minus, &b));
      numeric.col(i) = (a - b) / (2 * h);
    }
    EXPECT_LT((jacobian - numeric).norm(), 2e-6 * camera().mean_focal_px() / p.norm() + 1e-6 * jacobian.norm())
        << p.transpose() << "\n"
        << jacobian << "\n"
        << numeric;
  }
}

TEST_P(EveryCamera, PoseJacobianAgreesWithCentralDifferences) {
  const RigidTransform camera_from_world(exp_so3({0.4, -1.1, 0.3}), {0.2, -0.5, 1.5});
  for (const Eigen::Vector3d& p_camera : points_over_image(camera(), 12)) {
    const Eigen::Vector3d p_world = camera_from_world.inverse() * p_camera;
    const Eigen::Vector3d p = camera_from_world * p_world;
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> point_jacobian;
    if (!camera().project(p, &pixel, &point_jacobian)) continue;
    const Eigen::Matrix<double, 2, 6> jacobian = CameraModel::pose_jacobian(point_jacobian, p);
    Eigen::Matrix<double, 2, 6> numeric;
    const double h = 1e-6 * std::min(1.0, p.norm());
    for (int i = 0; i < 6; ++i) {
      Vector6d mu = Vector6d::Zero();
      mu[i] = h;
      Eigen::Vector2d a, b;
      ASSERT_TRUE(camera().project(RigidTransform::exp(mu) * camera_from_world * p_world, &a));
      ASSERT_TRUE(camera().project(RigidTransform::exp(-mu) * camera_from_world * p_world, &b));
      numeric.col(i) = (a - b) / (2 * h);
    }
    EXPECT_LT((jacobian - numeric).norm(), 1e-5 * jacobian.norm()) << p.transpose();
  }
}

TEST_P(EveryCamera, UnprojectInvertsProjectTo1e9Pixels) {
  int seen = 0;
  for (int row = 0; row <= 40; ++row) {
    for (int column = 0; column <= 40; ++column) {
      const Eigen::Vector2d pixel((camera().width() - 1.0) * column / 40, (camera().height() - 1.0) * row / 40);
      Eigen::Vector3d ray;
      if (!camera().unproject(pixel, &ray)) {
        // Only a fisheye may see nothing in the image: the pixel lies at 90 degrees or beyond.
        ASSERT_TRUE(camera().kind() == kannala_brandt || camera().kind() == fov) << pixel.transpose();
        continue;
      }
      ++seen;
      EXPECT_EQ(ray.z(), 1);
      if (ray.norm() > 5000) continue;
      Eigen::Vector2d back;
      ASSERT_TRUE(camera().project(ray, &back)) << pixel.transpose();
      EXPECT_LT((back - pixel).norm(), 1e-9) << pixel.transpose();
      EXPECT_LE(ray.head<2>().squaredNorm(), camera().max_radius_squared());
    }
  }
  EXPECT_GT(seen, 800);
}

TEST_P(EveryCamera, ProjectIsInjectiveOverItsDomain) {
  // A random point that is accepted and lands in the image is found again by unproject: no fold brings points from far
  // outside back into the image.
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  int in_image = 0;
  for (int i = 0; i < 200000; ++i) {
    const double spread = std::exp(3 * normal(random));
    const Eigen::Vector3d p(spread * normal(random), spread * normal(random), 1);
    Eigen::Vector2d pixel;
    if (!camera().project(p, &pixel) || !camera().in_image(pixel)) continue;
    ++in_image;
    Eigen::Vector3d ray;
    ASSERT_TRUE(camera().unproject(pixel, &ray)) << p.transpose();
    ASSERT_LT((ray - p).norm(), 1e-6 * p.squaredNorm()) << p.transpose() << " and " << ray.transpose();
    ASSERT_LE(p.head<2>().squaredNorm(), camera().max_radius_squared());
  }
  EXPECT_GT(in_image, 1000);
}

TEST_P(EveryCamera, AgreesWithOpenCv) {
  const cv::Matx33d K(camera().focal_px().x(), 0, camera().centre_px().x(), 0, camera().focal_px().y(),
                      camera().centre_px().y(), 0, 0, 1);
  std::vector<cv::Point3d> object;
  std::vector<Eigen::Vector2d> ours;
  for (const Eigen::Vector3d& p : points_over_image(camera(), 16)) {
    if (p.z() <= 0) continue;
    Eigen::Vector2d pixel;
    ASSERT_TRUE(camera().project(p, &pixel));
    object.emplace_back(p.x(), p.y(), p.z());
    ours.push_back(pixel);
  }
  const cv::Vec3d zero(0, 0, 0);
  std::vector<cv::Point2d> theirs;
  const auto& k = camera().distortion();
  if (camera().kind() == kannala_brandt) {
    cv::fisheye::projectPoints(object, theirs, zero, zero, K, cv::Vec4d(k[0], k[1], k[2], k[3]));
  } else if (camera().kind() != fov) {
    const std::vector<double> d(k.begin(), k.begin() + camera().n_distortion());
    cv::projectPoints(object, zero, zero, K, d, theirs);
  } else {
    // OpenCV has no such lens: PTAM Eq. 3 to 5 as printed.
    for (const cv::Point3d& p : object) {
      const double w = k[0], r = std::hypot(p.x / p.z, p.y / p.z);
      const double factor = w < 1e-6 || r < 1e-7 ? (w < 1e-6 ? 1 : 2 * std::tan(w / 2) / w)
                                                 : std::atan(2 * r * std::tan(w / 2)) / (w * r);
      theirs.emplace_back(K(0, 2) + K(0, 0) * factor * p.x / p.z, K(1, 2) + K(1, 1) * factor * p.y / p.z);
    }
  }
  ASSERT_EQ(theirs.size(), ours.size());
  for (std::size_t i = 0; i < ours.size(); ++i)
    EXPECT_LT(std::hypot(ours[i].x() - theirs[i].x, ours[i].y() - theirs[i].y), 1e-8) << object[i];
}

TEST_P(EveryCamera, RefusesPointsOutsideItsDomainAndLeavesTheOutputs) {
  Eigen::Vector2d pixel(-7, -8);
  Eigen::Matrix<double, 2, 3> jacobian = Eigen::Matrix<double, 2, 3>::Constant(5);
  const Eigen::Vector3d bad[] = {{0, 0, 0}, {0, 0, -1}, {kNan, 0, 1}, {0, kNan, 1}, {0, 0, kNan}};
  for (const auto& p : bad) {
    EXPECT_FALSE(camera().project(p, &pixel)) << p.transpose();
    EXPECT_FALSE(camera().project(p, &pixel, &jacobian)) << p.transpose();
  }
  if (camera().kind() != kannala_brandt) {
    EXPECT_FALSE(camera().project({1, 1, 0}, &pixel, &jacobian));
    EXPECT_FALSE(camera().project({0.1, 0.1, -1}, &pixel, &jacobian));
  }
  EXPECT_EQ(pixel, Eigen::Vector2d(-7, -8));
  EXPECT_EQ(jacobian, (Eigen::Matrix<double, 2, 3>::Constant(5)));
  Eigen::Vector3d ray(1, 2, 3);
  EXPECT_FALSE(camera().unproject({kNan, 3}, &ray));
  EXPECT_FALSE(camera().unproject({3, kInfinity}, &ray));
  EXPECT_EQ(ray, Eigen::Vector3d(1, 2, 3));
}

TEST_P(EveryCamera, ScaledKeepsTheHalfPixelConvention) {
  const CameraModel half = camera().scaled(camera().width() / 2, camera().height() / 2);
  EXPECT_EQ(half.kind(), camera().kind());
  for (const Eigen::Vector3d& p : points_over_image(camera(), 8)) {
    Eigen::Vector2d full_px, half_px;
    ASSERT_TRUE(camera().project(p, &full_px));
    ASSERT_TRUE(half.project(p, &half_px));
    const Eigen::Vector2d expected = (full_px + Eigen::Vector2d(0.5, 0.5)) * 0.5 - Eigen::Vector2d(0.5, 0.5);
    EXPECT_LT((half_px - expected).norm(), 1e-9);
  }
}

TEST(CameraModel, RadtanRefusesBeyondTheFold) {
  // r (1 + k1 r^2) turns at r = sqrt(-1 / (3 k1)).
  const CameraModel camera(radtan, 640, 480, {700, 700}, {320, 240}, {-0.3}, 4);
  const double fold = std::sqrt(1 / 0.9);
  Eigen::Vector2d pixel;
  EXPECT_TRUE(camera.project({fold * 0.999999, 0, 1}, &pixel));
  EXPECT_NEAR(pixel.x(), 320 + 700 * fold * (1 - 0.3 * fold * fold), 1e-6);
  EXPECT_FALSE(camera.project({fold * 1.000001, 0, 1}, &pixel));
  EXPECT_FALSE(camera.project({0, -2 * fold * 1.000001, 2}, &pixel));
  // And the ray of a pixel beyond the largest distorted radius does not exist.
  Eigen::Vector3d ray;
  const double edge = 700 * fold * (1 - 0.3 * fold * fold);
  EXPECT_TRUE(camera.unproject({320 + edge - 0.001, 240}, &ray));
  EXPECT_FALSE(camera.unproject({320 + edge + 0.001, 240}, &ray));
}

TEST(CameraModel, RationalRadtanRefusesBeyondItsPole) {
  const CameraModel camera(radtan, 640, 480, {900, 900}, {320, 240}, {0, 0, 0, 0, 0, -0.25, 0, 0}, 8);
  Eigen::Vector2d pixel;
  EXPECT_TRUE(camera.project({1.999, 0, 1}, &pixel));
  EXPECT_FALSE(camera.project({2.001, 0, 1}, &pixel));
}

TEST(CameraModel, KannalaBrandtRefusesBeyondTheFold) {
  // angle (1 + k1 angle^2) turns at sqrt(-1 / (3 k1)) = 1.8257 radians, behind the image plane.
  const CameraModel camera(kannala_brandt, 400, 400, {150, 150}, {200, 200}, {-0.1}, 4);
  const double fold = std::sqrt(1 / 0.3);
  Eigen::Vector2d pixel;
  EXPECT_TRUE(camera.project({std::sin(fold - 1e-6), 0, std::cos(fold - 1e-6)}, &pixel));
  EXPECT_NEAR(pixel.x(), 200 + 150 * fold * (1 - 0.1 * fold * fold), 1e-6);
  EXPECT_FALSE(camera.project({std::sin(fold + 1e-6), 0, std::cos(fold + 1e-6)}, &pixel));
  // With no fold, everything but the opposite direction is seen.
  const CameraModel full(kannala_brandt, 400, 400, {60, 60}, {200, 200}, {}, 4);
  EXPECT_TRUE(full.project({1e-3, 0, -1}, &pixel));
  EXPECT_NEAR(pixel.x(), 200 + 60 * (3.14159265358979 - 1e-3), 1e-4);
  EXPECT_FALSE(full.project({0, 0, -1}, &pixel));
  EXPECT_EQ(full.max_radius_squared(), kInfinity);
}

TEST(CameraModel, FovSeesUpToTheImagePlane) {
  const CameraModel camera(fov, 640, 480, {200, 200}, {320, 240}, {1.2}, 1);
  Eigen::Vector2d pixel;
  EXPECT_TRUE(camera.project({1000, 0, 1}, &pixel));
  EXPECT_LT(pixel.x(), 320 + 200 * (M_PI / 2) / 1.2);
  Eigen::Vector3d ray;
  EXPECT_FALSE(camera.unproject({320 + 200 * (M_PI / 2) / 1.2 + 0.01, 240}, &ray));
}

TEST(CameraModel, InImage) {
  const CameraModel camera(pinhole, 640, 480, {500, 500}, {320, 240});
  EXPECT_TRUE(camera.in_image({0, 0}));
  EXPECT_TRUE(camera.in_image({639, 479}));
  EXPECT_FALSE(camera.in_image({-0.01, 5}));
  EXPECT_FALSE(camera.in_image({639.01, 5}));
  EXPECT_FALSE(camera.in_image({5, 479.01}));
  EXPECT_TRUE(camera.in_image({10, 10}, 10));
  EXPECT_FALSE(camera.in_image({9.9, 10}, 10));
  EXPECT_TRUE(camera.in_image({-3, 3}, -4));
  EXPECT_FALSE(camera.in_image({kNan, 3}));
}

TEST(CameraModel, MeanFocalAndMaximumRadius) {
  const CameraModel camera(pinhole, 640, 480, {300, 400}, {319.5, 239.5});
  EXPECT_DOUBLE_EQ(camera.mean_focal_px(), std::sqrt((9e4 + 16e4) / 2));
  const double x = 336 / 300.0, y = 256 / 400.0;
  EXPECT_NEAR(camera.max_radius_squared(), x * x + y * y, 1e-12);
}

TEST(CameraModel, ConstructorRefusesNonsense) {
  const Eigen::Vector2d f(500, 500), c(320, 240);
  EXPECT_NO_THROW(CameraModel(pinhole, 640, 480, f, c));
  EXPECT_THROW(CameraModel(pinhole, 0, 480, f, c), InputError);
  EXPECT_THROW(CameraModel(pinhole, 640, -1, f, c), InputError);
  EXPECT_THROW(CameraModel(pinhole, 640, 70000, f, c), InputError);
  EXPECT_THROW(CameraModel(pinhole, 640, 480, {0, 500}, c), InputError);
  EXPECT_THROW(CameraModel(pinhole, 640, 480, {500, -500}, c), InputError);
  EXPECT_THROW(CameraModel(pinhole, 640, 480, {kNan, 500}, c), InputError);
  EXPECT_THROW(CameraModel(pinhole, 640, 480, {1e-9, 500}, c), InputError);
  EXPECT_THROW(CameraModel(pinhole, 640, 480, f, {kInfinity, 0}), InputError);
  EXPECT_THROW(CameraModel(pinhole, 640, 480, f, c, {0.1}, 1), InputError);
  EXPECT_THROW(CameraModel(radtan, 640, 480, f, c, {0.1}, 3), InputError);
  EXPECT_THROW(CameraModel(radtan, 640, 480, f, c, {kNan}, 4), InputError);
  EXPECT_THROW(CameraModel(radtan, 640, 480, f, c, {-2.0}, 4), InputError);              // radial fold
  EXPECT_THROW(CameraModel(radtan, 640, 480, f, c, {0, 0, 0, 0.5}, 4), InputError);      // tangential fold
  EXPECT_THROW(CameraModel(radtan, 640, 480, f, c, {0, 0, 0, 0, 0, 5}, 8), InputError);  // r / (1 + 5 r^2) folds
  EXPECT_THROW(CameraModel(kannala_brandt, 640, 480, f, c, {-2.0}, 4), InputError);
  EXPECT_THROW(CameraModel(kannala_brandt, 640, 480, f, c, {}, 5), InputError);
  EXPECT_THROW(CameraModel(fov, 640, 480, f, c, {}, 0), InputError);
  EXPECT_THROW(CameraModel(fov, 640, 480, f, c, {-0.1}, 1), InputError);
  EXPECT_THROW(CameraModel(fov, 640, 480, f, c, {3.2}, 1), InputError);
  EXPECT_THROW(CameraModel(static_cast<CameraModelKind>(9), 640, 480, f, c), InputError);
  try {
    CameraModel(pinhole, 640, 480, {500, -3}, c);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "camera model: focal length fy: found -3, expected a positive number");
  }
}

TEST(CameraModel, EqualityIgnoresUnusedDistortion) {
  const Eigen::Vector2d f(500, 500), c(320, 240);
  EXPECT_EQ(CameraModel(fov, 640, 480, f, c, {0.5, 99}, 1), CameraModel(fov, 640, 480, f, c, {0.5}, 1));
  EXPECT_NE(CameraModel(fov, 640, 480, f, c, {0.5}, 1), CameraModel(fov, 640, 480, f, c, {0.6}, 1));
  EXPECT_STREQ(to_string(kannala_brandt), "kannala_brandt");
}

}  // namespace
}  // namespace parallax
