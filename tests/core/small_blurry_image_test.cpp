#include "core/small_blurry_image.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "core/se3.h"

namespace parallax {
namespace {

using Eigen::Vector2d;

constexpr int kWidth = 640, kHeight = 480;

// A picture with structure from a few pixels to half the width; larger than a frame.
cv::Mat1f texture(int width, int height, unsigned seed) {
  cv::RNG rng(seed);
  cv::Mat1f out(height, width, 120.0F);
  for (const int cell : {320, 160, 80, 30}) {
    cv::Mat1f noise(height / cell + 2, width / cell + 2), large;
    rng.fill(noise, cv::RNG::NORMAL, 0, 22);
    cv::resize(noise, large, out.size(), 0, 0, cv::INTER_CUBIC);
    out += large;
  }
  for (int i = 0; i < 60; ++i) {
    const cv::Point at(rng.uniform(0, width), rng.uniform(0, height));
    cv::rectangle(out, cv::Rect(at.x, at.y, rng.uniform(10, 120), rng.uniform(10, 120)),
                  cv::Scalar(rng.uniform(30, 220)), cv::FILLED);
  }
  return out;
}

SmallBlurryImage small_of(const cv::Mat1f& image) {
  cv::Mat1b grey;
  image.convertTo(grey, CV_8U);
  ImagePyramid pyramid;
  build_pyramid(grey, &pyramid);
  return make_small_blurry_image(pyramid);
}

// The picture's middle, moved as SmallImageAlignment says: p of the first frame appears at R (p - c) + c + shift.
cv::Mat1f moved(const cv::Mat1f& picture, double angle, const Vector2d& shift) {
  const double cx = 0.5 * (kWidth - 1), cy = 0.5 * (kHeight - 1);
  const double mx = 0.5 * (picture.cols - kWidth), my = 0.5 * (picture.rows - kHeight);
  const double c = std::cos(angle), s = std::sin(angle);
  // frame pixel q -> picture: R' (q - c - shift) + c + margin
  cv::Mat1d m(2, 3);
  m << c, s, 0, -s, c, 0;
  const double qx = cx + shift.x(), qy = cy + shift.y();
  m(0, 2) = cx + mx - c * qx - s * qy;
  m(1, 2) = cy + my + s * qx - c * qy;
  cv::Mat1f out;
  cv::warpAffine(picture, out, m, cv::Size(kWidth, kHeight), cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                 cv::BORDER_REFLECT);
  return out;
}

const cv::Mat1f& picture() {
  static const cv::Mat1f p = texture(1280, 960, 5);
  return p;
}

TEST(SmallBlurryImage, AboutFortyPixelsWideZeroMeanAndScaled) {
  for (const auto& [width, height] :
       {std::pair{640, 480}, {752, 480}, {320, 240}, {160, 120}, {1241, 376}, {1920, 1080}}) {
    cv::Mat1f image = texture(width, height, 1);
    const SmallBlurryImage s = small_of(image);
    ASSERT_FALSE(s.empty());
    EXPECT_GE(s.image.cols, 28);
    EXPECT_LE(s.image.cols, 60);
    EXPECT_NEAR(s.image.cols * s.scale, width, s.scale);
    EXPECT_NEAR(s.image.rows * s.scale, height, s.scale);
    EXPECT_NEAR(cv::mean(s.image)[0], 0, 1e-3);
    EXPECT_EQ(s.dx.size(), s.image.size());
    EXPECT_FLOAT_EQ(s.dx(7, 9), 0.5F * (s.image(7, 10) - s.image(7, 8)));
    EXPECT_FLOAT_EQ(s.dy(7, 9), 0.5F * (s.image(8, 9) - s.image(6, 9)));
  }
}

TEST(SmallBlurryImage, BlurringTakesDetailAway) {
  cv::Mat1b grey;
  picture()(cv::Rect(0, 0, kWidth, kHeight)).convertTo(grey, CV_8U);
  ImagePyramid pyramid;
  build_pyramid(grey, &pyramid);
  const auto energy = [](const SmallBlurryImage& s) { return cv::norm(s.dx) + cv::norm(s.dy); };
  EXPECT_LT(energy(make_small_blurry_image(pyramid, 1.5)), 0.8 * energy(make_small_blurry_image(pyramid, 0)));
}

TEST(SmallBlurryImage, DifferenceIsTheMeanSquare) {
  const SmallBlurryImage a = small_of(moved(picture(), 0, {0, 0})), b = small_of(moved(picture(), 0, {30, 0}));
  EXPECT_EQ(small_image_difference(a, a), 0);
  double sum = 0;
  for (int y = 0; y < a.image.rows; ++y) {
    for (int x = 0; x < a.image.cols; ++x) sum += std::pow(static_cast<double>(a.image(y, x) - b.image(y, x)), 2);
  }
  EXPECT_NEAR(small_image_difference(a, b), sum / static_cast<double>(a.image.total()), 1e-3 * sum / 1200);
  EXPECT_DOUBLE_EQ(small_image_difference(a, b), small_image_difference(b, a));
}

TEST(SmallImageAlignment, FindsShiftsAndRotations) {
  const SmallBlurryImage from = small_of(moved(picture(), 0, {0, 0}));
  int tried = 0, converged = 0;
  for (const double angle : {-0.15, -0.05, 0.0, 0.08}) {
    for (const double x : {-128.0, -60.0, -9.0, 0.0, 37.0, 128.0}) {
      for (const double y : {-70.0, 0.0, 24.0, 96.0}) {
        ++tried;
        const auto a = align_small_images(from, small_of(moved(picture(), angle, {x, y})));
        if (!a.converged) continue;
        ++converged;
        EXPECT_NEAR(a.angle, angle, 0.02) << angle << " " << x << " " << y;
        // a quarter of a small pixel
        EXPECT_NEAR(a.shift.x(), x, 4) << angle << " " << x << " " << y;
        EXPECT_NEAR(a.shift.y(), y, 4) << angle << " " << x << " " << y;
        EXPECT_GT(a.overlap, 0.5);
      }
    }
  }
  EXPECT_GE(converged, tried * 95 / 100);
}

TEST(SmallImageAlignment, IgnoresBrightnessAndNoise) {
  const SmallBlurryImage from = small_of(moved(picture(), 0, {0, 0}));
  cv::Mat1f image = moved(picture(), 0.03, {40, -25});
  image = image * 0.85 + 20;
  cv::Mat1f noise(image.size());
  cv::RNG(3).fill(noise, cv::RNG::NORMAL, 0, 6);
  const auto a = align_small_images(from, small_of(image + noise));
  ASSERT_TRUE(a.converged);
  EXPECT_NEAR(a.angle, 0.03, 0.02);
  EXPECT_NEAR(a.shift.x(), 40, 4);
  EXPECT_NEAR(a.shift.y(), -25, 4);
}

TEST(SmallImageAlignment, TheInverseMotionIsFoundTheOtherWayRound) {
  const SmallBlurryImage a = small_of(moved(picture(), 0, {0, 0})), b = small_of(moved(picture(), 0.06, {50, 30}));
  const auto ab = align_small_images(a, b), ba = align_small_images(b, a);
  ASSERT_TRUE(ab.converged && ba.converged);
  EXPECT_NEAR(ab.angle, -ba.angle, 0.01);
  EXPECT_LT((Eigen::Rotation2Dd(ba.angle) * ab.shift + ba.shift).norm(), 4);
}

TEST(SmallImageAlignment, RefusesUnrelatedAndBlankImages) {
  const SmallBlurryImage a = small_of(moved(picture(), 0, {0, 0}));
  int accepted = 0;
  constexpr int kOthers = 40;
  for (unsigned i = 0; i < kOthers; ++i) {
    accepted += align_small_images(a, small_of(texture(kWidth, kHeight, 1000 + i))).converged ? 1 : 0;
  }
  EXPECT_LE(accepted, 2);
  const SmallBlurryImage blank = small_of(cv::Mat1f(kHeight, kWidth, 100.0F));
  EXPECT_FALSE(align_small_images(a, blank).converged);
  EXPECT_FALSE(align_small_images(blank, a).converged);
  EXPECT_FALSE(align_small_images(blank, blank).converged);
}

// A distant textured sphere seen by a camera: the colour of a ray depends on its direction alone.
cv::Mat1f render_sky(const CameraModel& camera, const Eigen::Matrix3d& camera_from_world) {
  static const cv::Mat1f sky = texture(2400, 1200, 77);
  cv::Mat1f mx(camera.height(), camera.width()), my(camera.height(), camera.width());
  for (int y = 0; y < camera.height(); ++y) {
    for (int x = 0; x < camera.width(); ++x) {
      Eigen::Vector3d ray(0, 0, 1);
      camera.unproject({x, y}, &ray);
      const Eigen::Vector3d w = (camera_from_world.transpose() * ray).normalized();
      mx(y, x) = static_cast<float>(1200 + std::atan2(w.x(), w.z()) * 380);
      my(y, x) = static_cast<float>(600 + std::asin(w.y()) * 380);
    }
  }
  cv::Mat1f out;
  cv::remap(sky, out, mx, my, cv::INTER_LINEAR, cv::BORDER_REFLECT);
  return out;
}

class RotationFromAlignment : public ::testing::TestWithParam<CameraModel> {};

TEST_P(RotationFromAlignment, MatchesTheCamerasRotation) {
  const CameraModel camera = GetParam();
  const SmallBlurryImage from = small_of(render_sky(camera, Eigen::Matrix3d::Identity()));
  const double unit = M_PI / 180;
  int worse = 0;
  const std::array<Eigen::Vector3d, 10> turns = {
      Eigen::Vector3d(0, 0, 0),   Eigen::Vector3d(0, 2, 0),   Eigen::Vector3d(-3, 0, 0), Eigen::Vector3d(0, 0, 5),
      Eigen::Vector3d(2, -4, 1),  Eigen::Vector3d(0, 8, 0),   Eigen::Vector3d(6, 0, -3), Eigen::Vector3d(-5, -5, 0),
      Eigen::Vector3d(0, -10, 2), Eigen::Vector3d(1, 0.5, -8)};
  for (const Eigen::Vector3d& degrees : turns) {
    const Eigen::Matrix3d R = exp_so3(degrees * unit);
    const auto a = align_small_images(from, small_of(render_sky(camera, R)));
    ASSERT_TRUE(a.converged) << degrees.transpose();
    const double error = log_so3(rotation_from_alignment(camera, a) * R.transpose()).norm() / unit;
    EXPECT_LT(error, std::max(0.3, 0.2 * degrees.norm())) << degrees.transpose();
    worse += error >= std::max(0.3, 0.1 * degrees.norm()) ? 1 : 0;
  }
  EXPECT_LE(worse, 1);
}

INSTANTIATE_TEST_SUITE_P(
    Lenses, RotationFromAlignment,
    ::testing::Values(CameraModel(CameraModelKind::pinhole, 640, 480, {525, 525}, {319.5, 239.5}),
                      CameraModel(CameraModelKind::fov, 640, 480, {375, 376}, {322.3, 237.1}, {0.9}, 1),
                      CameraModel(CameraModelKind::radtan, 640, 480, {420, 420}, {315, 245}, {-0.2, 0.03, 0, 0}, 4)));

TEST(RotationFromAlignment, NoMotionIsTheIdentity) {
  const CameraModel camera(CameraModelKind::pinhole, 640, 480, {525, 525}, {319.5, 239.5});
  EXPECT_LT((rotation_from_alignment(camera, SmallImageAlignment()) - Eigen::Matrix3d::Identity()).norm(), 1e-9);
}

TEST(RotationFromAlignment, AnalyticRollAndPan) {
  const CameraModel camera(CameraModelKind::pinhole, 640, 480, {5000, 5000}, {319.5, 239.5});
  SmallImageAlignment a;
  a.angle = 0.1;
  EXPECT_LT(log_so3(rotation_from_alignment(camera, a) * exp_so3({0, 0, 0.1}).transpose()).norm(), 1e-6);
  a.angle = 0;
  a.shift = {50, 0};  // everything moves right: rays turn about +y
  EXPECT_LT(log_so3(rotation_from_alignment(camera, a) * exp_so3({0, 0.01, 0}).transpose()).norm(), 1e-4);
}

}  // namespace
}  // namespace parallax
