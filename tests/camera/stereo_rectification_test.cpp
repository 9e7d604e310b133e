#include "camera/stereo_rectification.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <random>
#include <string>
#include <vector>

#include "camera/calibration_file.h"
#include "core/error.h"
#include "tests/camera/source_fixture.h"

namespace parallax {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using enum CameraModelKind;

struct Rig {
  std::string name;
  StereoCalibration calibration;
};

// Cameras that squint, roll, nod and stand askew, in every lens.
std::vector<Rig> crooked_rigs() {
  const CameraModel pinhole(CameraModelKind::pinhole, 320, 240, {250, 251}, {161.2, 117.4}),
      longer(CameraModelKind::pinhole, 320, 240, {262, 260}, {155.1, 123.9}),
      radtan_left(radtan, 320, 240, {210, 211}, {158.2, 121.3}, {-0.26, 0.07, 0.0004, -0.0003}, 4),
      radtan_right(radtan, 320, 240, {213, 213}, {163.5, 118.0}, {-0.24, 0.06, -0.0006, 0.0002}, 4),
      fisheye_left(kannala_brandt, 320, 240, {165, 165.4}, {161.1, 120.8}, {-0.012, 0.004, -0.001, 0.0001}, 4),
      fisheye_right(kannala_brandt, 320, 240, {166, 166.2}, {157.3, 122.0}, {-0.011, 0.003, -0.001, 0.0001}, 4),
      fov_lens(fov, 320, 240, {190, 190.5}, {160.4, 119.2}, {0.9}, 1);
  const auto rig = [](const char* name, const CameraModel& left, const CameraModel& right, const Vector3d& turn,
                      const Vector3d& place) {
    const Eigen::Matrix3d R = exp_so3(turn);
    return Rig{name, {left, right, RigidTransform(R, Vector3d(-(R * place)))}};
  };
  return {rig("toed-in pinholes", pinhole, longer, {0.01, 0.07, 0.02}, {0.12, 0.004, -0.006}),
          rig("rolled radtan", radtan_left, radtan_right, {-0.02, -0.03, 0.06}, {0.09, -0.005, 0.002}),
          rig("fisheye", fisheye_left, fisheye_right, {0.03, 0.05, -0.03}, {0.3, 0.01, 0.02}),
          rig("two kinds of lens", radtan_left, fov_lens, {0.01, -0.02, -0.02}, {0.1, 0, 0})};
}

constexpr double kSpot = 2;  // standard deviation, pixels

// A soft spot at a place between pixels.
GreyImage spot(const CameraModel& camera, const Vector2d& at) {
  GreyImage image(camera.height(), camera.width(), uchar{0});
  for (int v = 0; v < image.rows; ++v)
    for (int u = 0; u < image.cols; ++u)
      image(v, u) =
          cv::saturate_cast<uchar>(240 * std::exp(-(Vector2d(u, v) - at).squaredNorm() / (2 * kSpot * kSpot)));
  return image;
}

Vector2d centroid(const GreyImage& image) {
  double sum = 0;
  Vector2d mean(0, 0);
  for (int v = 0; v < image.rows; ++v)
    for (int u = 0; u < image.cols; ++u) {
      sum += image(v, u);
      mean += image(v, u) * Vector2d(u, v);
    }
  return mean / sum;
}

// Where the centroid of a raw spot lies in the rectified image: not where its middle does, as the lens bends its rim.
Vector2d spot_centroid(const StereoRectifier& rectifier, bool right, const Vector2d& at) {
  double sum = 0;
  Vector2d mean(0, 0);
  for (double dv = -8; dv <= 8; ++dv)
    for (double du = -8; du <= 8; ++du) {
      const Vector2d p = at + Vector2d(du, dv);
      Vector2d middle, r, l, d, u;
      EXPECT_TRUE(rectifier.rectified_pixel(right, p, &middle) &&
                  rectifier.rectified_pixel(right, p + Vector2d(0.5, 0), &r) &&
                  rectifier.rectified_pixel(right, p - Vector2d(0.5, 0), &l) &&
                  rectifier.rectified_pixel(right, p + Vector2d(0, 0.5), &d) &&
                  rectifier.rectified_pixel(right, p - Vector2d(0, 0.5), &u));
      const Vector2d a = r - l, b = d - u;
      const double weight =
          std::abs(a.x() * b.y() - a.y() * b.x()) * std::exp(-(du * du + dv * dv) / (2 * kSpot * kSpot));
      sum += weight;
      mean += weight * middle;
    }
  return mean / sum;
}

TEST(StereoRectification, PointsOfCrookedRigsLandOnTheirRowAtTheirDisparity) {
  for (const auto& [name, rig] : crooked_rigs()) {
    const StereoRectifier rectifier(rig);
    const StereoCamera& camera = rectifier.camera();
    EXPECT_FALSE(rectifier.is_pass_through());
    EXPECT_GE(rectifier.seen(), 0.969) << name;
    EXPECT_NEAR(camera.baseline_m, rig.baseline_m(), 1e-12);
    std::mt19937 random(7);
    std::uniform_real_distribution<double> unit(0, 1);
    int checked = 0;
    StereoFrame raw;
    StereoImages rectified;
    for (int tries = 0; tries < 400 && checked < 25; ++tries) {
      const double depth = 0.7 / (0.02 + unit(random));
      const Vector3d place =
          depth * camera.ray({unit(random) * (camera.width - 1), unit(random) * (camera.height - 1)});
      Vector3d truth;
      if (!camera.project(place, &truth) || !camera.in_image({truth.y(), truth.z()}, 12) ||
          !camera.in_image({truth.x(), truth.z()}, 12))
        continue;
      const Vector3d in_left = rectifier.rectified_from_left().inverse() * place;
      Vector2d left, right;
      if (!rig.left.project(in_left, &left) || !rig.left.in_image(left, 9)) continue;
      if (!rig.right.project(rig.right_from_left * in_left, &right) || !rig.right.in_image(right, 9)) continue;
      Vector2d exact_left, exact_right;
      ASSERT_TRUE(rectifier.rectified_pixel(false, left, &exact_left));
      ASSERT_TRUE(rectifier.rectified_pixel(true, right, &exact_right));
      EXPECT_LT((exact_left - Vector2d(truth.x(), truth.z())).norm(), 1e-6) << name;
      EXPECT_LT((exact_right - Vector2d(truth.y(), truth.z())).norm(), 1e-6) << name;

      raw.left.grey = spot(rig.left, left);
      raw.right.grey = spot(rig.right, right);
      rectifier.rectify(raw, &rectified);
      const Vector2d seen_left = centroid(rectified.left), seen_right = centroid(rectified.right);
      const Vector2d left_error = seen_left - spot_centroid(rectifier, false, left),
                     right_error = seen_right - spot_centroid(rectifier, true, right);
      EXPECT_LT(left_error.norm(), 0.05) << name;
      EXPECT_LT(right_error.norm(), 0.05) << name;
      EXPECT_NEAR(left_error.y(), right_error.y(), 0.05) << name;
      ++checked;
    }
    EXPECT_EQ(checked, 25) << name;
  }
}

TEST(StereoRectification, TheMaskLeavesOutTheBlackBorder) {
  RectificationOptions wide;
  wide.least_seen = 0.8;
  for (const auto& [name, rig] : crooked_rigs()) {
    const StereoRectifier rectifier(rig, wide);
    EXPECT_LT(rectifier.camera().focal_px.x(), StereoRectifier(rig).camera().focal_px.x()) << name;
    StereoFrame raw;
    raw.left.grey = GreyImage(240, 320, uchar{255});
    raw.right.grey = raw.left.grey;
    raw.left.colour = cv::Mat3b(240, 320, cv::Vec3b(10, 20, 30));
    raw.left.index = 4;
    raw.left.time = Timestamp(77);
    StereoImages out;
    rectifier.rectify(raw, &out);
    EXPECT_EQ(out.index, 4);
    EXPECT_EQ(out.time, Timestamp(77));
    ASSERT_EQ(rectifier.left_mask().size(), out.left.size());
    const double black = 1 - cv::countNonZero(out.left) / (240.0 * 320);
    EXPECT_GT(black, 0.05) << name;
    EXPECT_LT(black, 0.4) << name;
    EXPECT_GT(cv::countNonZero(rectifier.left_mask()), 0.6 * 240 * 320) << name;
    EXPECT_EQ(cv::countNonZero(rectifier.left_mask() & (out.left != 255)), 0) << name;
    EXPECT_EQ(out.colour(120, 160), cv::Vec3b(10, 20, 30));
    // Pixels that somebody still holds are not written to.
    const GreyImage held = out.left;
    raw.left.grey = GreyImage(240, 320, uchar{100});
    raw.left.colour.release();
    rectifier.rectify(raw, &out);
    EXPECT_EQ(held(120, 160), 255);
    EXPECT_EQ(out.left(120, 160), 100);
    EXPECT_TRUE(out.colour.empty());
  }
}

StereoCalibration straight_rig() {
  const CameraModel camera(CameraModelKind::pinhole, 320, 240, {250, 251}, {161.2, 117.4});
  return {camera, camera, RigidTransform(Eigen::Matrix3d(Eigen::Matrix3d::Identity()), Vector3d(-0.12, 0, 0))};
}

TEST(StereoRectification, ARectifiedPairIsHandedThrough) {
  StereoCalibration rig = straight_rig();
  const StereoRectifier rectifier(rig);
  EXPECT_TRUE(rectifier.is_pass_through());
  EXPECT_EQ(rectifier.camera(), (StereoCamera{320, 240, {250, 251}, {161.2, 117.4}, 0.12}));
  EXPECT_EQ(rectifier.rectified_from_left().R, Eigen::Matrix3d::Identity());
  EXPECT_TRUE(rectifier.left_mask().empty());
  EXPECT_EQ(rectifier.seen(), 1);
  StereoFrame raw;
  raw.left.grey = GreyImage(240, 320, uchar{3});
  raw.right.grey = GreyImage(240, 320, uchar{4});
  StereoImages out;
  rectifier.rectify(raw, &out);
  EXPECT_EQ(out.left.data, raw.left.grey.data);
  EXPECT_EQ(out.right.data, raw.right.grey.data);

  rig.right_from_left.R = exp_so3({0, 2e-5, 0});
  EXPECT_FALSE(StereoRectifier(rig).is_pass_through());
  rig = straight_rig();
  rig.right = CameraModel(CameraModelKind::pinhole, 320, 240, {250, 251}, {161.21, 117.4});
  EXPECT_FALSE(StereoRectifier(rig).is_pass_through());
}

template <typename Function>
std::string rig_refusal(const Function& function) {
  try {
    function();
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
    return error.what();
  }
  return "";
}

void expect_refusal(const StereoCalibration& rig, const std::string& text) {
  const std::string said = rig_refusal([&] { StereoRectifier rectifier(rig, {}, "rig.yaml"); });
  EXPECT_NE(said.find("rig.yaml: "), std::string::npos) << said;
  EXPECT_NE(said.find(text), std::string::npos) << said;
}

TEST(StereoRectification, RefusesRigsThatAreNone) {
  const auto placed = [](const Vector3d& t, const Vector3d& turn = {0, 0, 0}) {
    StereoCalibration rig = straight_rig();
    rig.right_from_left = RigidTransform(exp_so3(turn), t);
    return rig;
  };
  expect_refusal(placed({0.12, 0, 0}), "stands 0.12 m to the left of the left one; are the two swapped?");
  for (const auto& [name, rig] : crooked_rigs())
    expect_refusal({rig.right, rig.left, rig.right_from_left.inverse()}, "are the two swapped?");
  expect_refusal(placed({0.01, -0.1, 0}), "0.1 m below");
  expect_refusal(placed({0.01, 0.1, 0}), "0.1 m above");
  expect_refusal(placed({0, 0.1, -0.2}), "0.2 m before");
  expect_refusal(placed({0, 0, 0}), "a baseline of 0 m");
  expect_refusal(placed({-0.0005, 0, 0}), "a baseline of 0.0005 m");
  expect_refusal(placed({-119, 0, 0}), "a baseline of 119 m");
  expect_refusal(placed({std::nan(""), 0, 0}), "no number");
  expect_refusal(placed({-0.1, 0, 0}, {0, 1.2, 0}), "68.8 degrees");
  EXPECT_NE(rig_refusal([] { StereoRectifier r(straight_rig(), {.least_seen = 2}); }).find("least_seen"),
            std::string::npos);

  const StereoRectifier rectifier(straight_rig(), {}, "rig.yaml");
  StereoFrame raw;
  raw.left.grey = GreyImage(240, 320, uchar{3});
  raw.right.grey = GreyImage(480, 640, uchar{3});
  StereoImages out;
  EXPECT_EQ(rig_refusal([&] { rectifier.rectify(raw, &out); }),
            "rig.yaml: it is for right images of 320x240, found 640x480");
}

const char* const kKalibr =
    "cam0:\n  camera_model: pinhole\n  intrinsics: [461.6, 460.3, 362.7, 248.1]\n  resolution: [752, 480]\n"
    "  distortion_model: equidistant\n  distortion_coeffs: [-0.01, 0.02, -0.03, 0.01]\n"
    "cam1:\n  T_cn_cnm1:\n  - [0.999996, 0.002312, 0.001898, -0.110074]\n"
    "  - [-0.002337, 0.999911, 0.013129, 0.000399]\n  - [-0.001867, -0.013134, 0.999912, -0.000854]\n"
    "  - [0.0, 0.0, 0.0, 1.0]\n  camera_model: pinhole\n  intrinsics: [460.2, 459.0, 379.7, 255.2]\n"
    "  resolution: [752, 480]\n  distortion_model: radtan\n  distortion_coeffs: [-0.28, 0.07, 0.0001, 0.00002]\n";

TEST(StereoCalibrationFile, KalibrsChain) {
  const StereoCalibration rig = parse_stereo_calibration(kKalibr, "camchain.yaml");
  EXPECT_EQ(rig.left.kind(), kannala_brandt);
  EXPECT_EQ(rig.right.kind(), radtan);
  EXPECT_EQ(rig.right.centre_px(), Vector2d(379.7, 255.2));
  EXPECT_LT((rig.right_from_left.t - Vector3d(-0.110074, 0.000399, -0.000854)).norm(), 1e-12);
  EXPECT_NEAR(rig.right_from_left.R(1, 2), 0.013129, 2e-6);
  EXPECT_LT((rig.right_from_left.R * rig.right_from_left.R.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
  EXPECT_GT(StereoRectifier(rig).seen(), 0.96);

  const auto said = [](const std::string& text) {
    return rig_refusal([&] { parse_stereo_calibration(text, "camchain.yaml"); });
  };
  EXPECT_NE(said(replaced(kKalibr, "T_cn_cnm1", "T_cam_imu")).find("key cam1.T_cn_cnm1: found nothing"),
            std::string::npos);
  EXPECT_NE(said(replaced(kKalibr, "0.999911", "0.9")).find("no rotation"), std::string::npos);
  EXPECT_NE(said(replaced(kKalibr, "[0.0, 0.0, 0.0, 1.0]", "[0.0, 0.0, 1.0]")).find("a list of 3 values"),
            std::string::npos);
  EXPECT_NE(said(std::string(kKalibr).substr(0, std::string(kKalibr).find("cam1"))).find("key cam1"),
            std::string::npos);
  EXPECT_NE(said(format_calibration(rig.left)), "");
}

TEST(StereoCalibrationFile, OrbSlamsSettings) {
  const std::string lens =
      ".fx: 190.9\nCAM.fy: 190.9\nCAM.cx: 254.9\nCAM.cy: 256.8\nCAM.k1: 0.003\nCAM.k2: 0.0007\n"
      "CAM.k3: -0.002\nCAM.k4: 0.0002\n";
  const auto camera = [&](const std::string& key) {
    std::string text = key + lens;
    for (std::size_t at; (at = text.find("CAM")) != std::string::npos;) text.replace(at, 3, key);
    return text;
  };
  const StereoCalibration rig =
      parse_stereo_calibration("%YAML:1.0\nCamera.type: \"KannalaBrandt8\"\nCamera.width: 512\nCamera.height: 512\n" +
                                   camera("Camera1") + camera("Camera2") +
                                   "Stereo.T_c1_c2: !!opencv-matrix\n  rows: 4\n  cols: 4\n  dt: f\n  data: [1, 0, 0, "
                                   "0.101, 0, 1, 0, 0.002, 0, 0, "
                                   "1, 0.001, 0, 0, 0, 1.0]\n",
                               "orb.yaml");
  EXPECT_EQ(rig.right.kind(), kannala_brandt);
  EXPECT_LT((rig.right_from_left.t - Vector3d(-0.101, -0.002, -0.001)).norm(), 1e-12);

  const std::string rectified =
      "%YAML:1.0\nCamera.fx: 700.0\nCamera.fy: 700.0\nCamera.cx: 600.0\nCamera.cy: 180.0\nCamera.width: 1241\n"
      "Camera.height: 376\nCamera.bf: 378.0\n";
  EXPECT_NEAR(parse_stereo_calibration(rectified, "orb.yaml").right_from_left.t.x(), -0.54, 1e-12);
  EXPECT_TRUE(StereoRectifier(parse_stereo_calibration(rectified, "orb.yaml")).is_pass_through());
  EXPECT_NE(
      rig_refusal([&] { parse_stereo_calibration(replaced(rectified, "bf", "bx"), "orb.yaml"); }).find("Camera.bf"),
      std::string::npos);
}

TEST(StereoCalibrationFile, OursReadsBackToTheLastBit) {
  for (const auto& [name, rig] : crooked_rigs()) {
    const StereoCalibration again = parse_stereo_calibration(format_stereo_calibration(rig), "rig.yaml");
    EXPECT_EQ(again.left, rig.left) << name;
    EXPECT_EQ(again.right, rig.right) << name;
    EXPECT_EQ(again.right_from_left.R, rig.right_from_left.R) << name;
    EXPECT_EQ(again.right_from_left.t, rig.right_from_left.t) << name;
  }
}

}  // namespace
}  // namespace parallax
