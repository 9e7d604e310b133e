// Image sets with published calibrations, done anew.
#include <gtest/gtest.h>

#include <filesystem>

#include "calib/camera_calibration.h"
#include "calib/lens_conversion.h"
#include "calib/stereo_calibration.h"
#include "camera/image_file.h"

namespace parallax {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> images_of(const std::string& set, const std::string& prefix) {
  std::vector<std::string> paths;
  const fs::path folder = fs::path(PARALLAX_DATA_DIR) / "calibration" / set;
  if (!fs::is_directory(folder)) return paths;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.rfind(prefix, 0) == 0 && entry.path().extension() == ".jpg") paths.push_back(entry.path().string());
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

CalibrationData views_of(const std::vector<std::string>& paths, const CalibrationTarget& target) {
  CalibrationData data{target, 0, 0, {}};
  for (const auto& path : paths) {
    DecodedImage image;
    EXPECT_EQ(load_image(path, {}, &image), "");
    data.width = image.grey.cols;
    data.height = image.grey.rows;
    const auto detection = detect_target(image.grey, target);
    EXPECT_TRUE(detection) << path;
    if (detection) data.views.push_back({static_cast<int>(data.views.size()), path, detection->corners});
  }
  return data;
}

CalibrationTarget board(TargetKind kind, int columns, int rows, double square_m, double detail_m = 0) {
  CalibrationTarget target;
  target.kind = kind;
  target.columns = columns;
  target.rows = rows;
  target.square_m = square_m;
  target.detail_m = detail_m;
  return target;
}

// A published value with the standard deviation that it has itself, where it is known.
struct Published {
  const char* name;
  double value, sigma;
};

void expect_reproduced(const CameraCalibration& c, const std::vector<Published>& published) {
  ASSERT_TRUE(c.ok) << c.reason;
  for (const auto& p : published) {
    const auto i = std::find(c.names.begin(), c.names.end(), p.name) - c.names.begin();
    const double sigma = std::hypot(c.cautious_sigma()(i), p.sigma);
    EXPECT_LT(std::abs(c.parameters(i) - p.value), 3 * sigma)
        << p.name << ": found " << c.parameters(i) << " +- " << c.cautious_sigma()(i) << ", published " << p.value;
  }
}

// OpenCV's stored result was fitted with one view whose corners were refined in windows wider than its squares (1.18 px
// in that view, 0.17 to 0.38 in the others; docs/results.md): its own uncertainty is larger than ours by the ratio of
// the residuals.
TEST(Published, OpenCvStereoLeft) {
  const auto paths = images_of("opencv_stereo", "left");
  if (paths.empty()) GTEST_SKIP() << "no recordings in " << PARALLAX_DATA_DIR;
  const auto data = views_of(paths, board(TargetKind::chessboard, 9, 6, 0.025));
  ASSERT_EQ(data.views.size(), 13u);
  CalibrationOptions options;
  options.model = LensModel::radtan5;
  options.freedom.square_pixels = true;
  const auto c = calibrate_camera(data, options);
  ASSERT_TRUE(c.ok);
  EXPECT_LT(c.rms_px, 0.2);
  const double ratio = 0.3926 / c.rms_px;
  const Eigen::VectorXd sigma = ratio * c.cautious_sigma();
  expect_reproduced(c, {{"fx", 535.91573, sigma(0)},
                        {"cx", 342.28315, sigma(2)},
                        {"cy", 235.57083, sigma(3)},
                        {"k1", -0.26637261, sigma(4)},
                        {"k2", -0.03858890, sigma(5)},
                        {"p1", 0.0017831947, sigma(6)},
                        {"p2", -0.00028122100, sigma(7)},
                        {"k3", 0.23839153, sigma(8)}});
}

// The result kept beside the images is another program's, without uncertainties. Its focal length is 1.3 percent longer
// than what any four of the five images give here (docs/results.md): that much is not reproduced, and held to a bound.
TEST(Published, Zhang) {
  const auto paths = images_of("zhang", "CalibIm");
  if (paths.empty()) GTEST_SKIP() << "no recordings in " << PARALLAX_DATA_DIR;
  const auto data = views_of(paths, board(TargetKind::squares, 8, 8, 0.5, 0.38889));
  ASSERT_EQ(data.views.size(), 5u);
  for (const auto& view : data.views) EXPECT_EQ(view.corners.size(), 256u);
  CalibrationOptions options;
  options.model = LensModel::radtan4;
  options.freedom.tangential = false;
  const auto c = calibrate_camera(data, options);
  expect_reproduced(c, {{"cx", 304.06252065996665, 0},
                        {"cy", 206.90459713514986, 0},
                        {"k1", -0.23715432455606306, 0},
                        {"k2", 0.18638932687522672, 0}});
  ASSERT_TRUE(c.ok);
  EXPECT_NEAR(c.parameters(0), 841.6511449951374, 0.015 * 841.65);
  EXPECT_NEAR(c.parameters(1), 841.73531186552, 0.015 * 841.74);
}

TEST(Published, SonyChess) {
  const auto paths = images_of("sony_chess", "frame");
  if (paths.empty()) GTEST_SKIP() << "no recordings in " << PARALLAX_DATA_DIR;
  const auto data = views_of(paths, board(TargetKind::chessboard, 4, 6, 0.03));
  ASSERT_EQ(data.views.size(), 13u);
  CalibrationOptions options;
  options.model = LensModel::radtan4;
  options.freedom.tangential = false;
  expect_reproduced(calibrate_camera(data, options), {{"fx", 701.0116882676376, 0},
                                                      {"fy", 698.6537946928421, 0},
                                                      {"cx", 308.4551818095542, 0},
                                                      {"cy", 246.84300560315452, 0},
                                                      {"k1", -0.25559248570886445, 0},
                                                      {"k2", 0.09997127476560613, 0}});
}

// The unified omnidirectional model of Mei and Rives, as the published file states it: where a ray is seen.
Eigen::Vector2d mei_pixel(const Eigen::Vector3d& ray) {
  constexpr double fx = 398.77492706579216, fy = 398.7685638672075, cx = 319.17879590584187, cy = 319.71743712432686;
  constexpr double r1 = -0.24972089525362837, r2 = 0.009672326567075125, offset = 1.1331346732794045;
  const Eigen::Vector3d p = ray.normalized();
  const double x = p.x() / (p.z() + offset), y = p.y() / (p.z() + offset), s = x * x + y * y;
  const double radial = 1 + r1 * s + r2 * s * s;
  return {fx * x * radial + cx, fy * y * radial + cy};
}

TEST(Published, FisheyeChess) {
  const auto paths = images_of("fisheye_chess", "");
  if (paths.empty()) GTEST_SKIP() << "no recordings in " << PARALLAX_DATA_DIR;
  const auto data = views_of(paths, board(TargetKind::chessboard, 4, 6, 0.03));
  ASSERT_EQ(data.views.size(), 26u);
  CalibrationOptions options;
  options.model = LensModel::kannala_brandt;
  const auto c = calibrate_camera(data, options);
  ASSERT_TRUE(c.ok) << c.reason;
  EXPECT_LT(c.rms_px, 0.25);
  // Another model, so its numbers are not ours: the two are compared where the board was, once turned onto each other.
  std::vector<Eigen::Vector3d> rays;
  std::vector<Eigen::Vector2d> pixels;
  for (const auto& view : c.views)
    for (const auto& corner : view.residuals) {
      Eigen::Vector3d ray;
      if (!corner.used || !c.camera.unproject(corner.px, &ray)) continue;
      rays.push_back(ray.normalized());
      pixels.push_back(corner.px);
    }
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  double rms = 0;
  for (int round = 0; round < 8; ++round) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    rms = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const Eigen::Vector3d p = R * rays[i];
      Eigen::Matrix<double, 2, 3> by_point;
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d step = 1e-6 * Eigen::Vector3d::Unit(k);
        by_point.col(k) = (mei_pixel(p + step) - mei_pixel(p - step)) / 2e-6;
      }
      const Eigen::Matrix<double, 2, 3> J = -by_point * hat(p);
      const Eigen::Vector2d r = mei_pixel(p) - pixels[i];
      H += J.transpose() * J;
      g += J.transpose() * r;
      rms += r.squaredNorm() / static_cast<double>(rays.size());
    }
    R = exp_so3(-H.ldlt().solve(g)) * R;
  }
  RecordProperty("rms_px", std::to_string(std::sqrt(rms)));
  // Corner noise is 0.2 of it; two models of different kinds make the rest.
  EXPECT_LT(std::sqrt(rms), 0.8);
}

TEST(Published, OpenCvStereoRig) {
  const auto left = images_of("opencv_stereo", "left"), right = images_of("opencv_stereo", "right");
  if (left.empty()) GTEST_SKIP() << "no recordings in " << PARALLAX_DATA_DIR;
  const CalibrationTarget target = board(TargetKind::chessboard, 9, 6, 0.025);
  const CalibrationData a = views_of(left, target), b = views_of(right, target);
  ASSERT_EQ(a.views.size(), b.views.size());
  StereoData data{target, 640, 480, {}};
  for (std::size_t i = 0; i < a.views.size(); ++i)
    data.views.push_back({static_cast<int>(i), a.views[i].name, a.views[i].corners, b.views[i].corners});
  CalibrationOptions options;
  options.model = LensModel::radtan5;
  const auto rig = calibrate_stereo(data, options);
  ASSERT_TRUE(rig.ok) << rig.reason;
  EXPECT_EQ(rig.pairs, 13);
  EXPECT_LT(rig.rms_px, 0.25);
  EXPECT_LT(rig.epipolar_px, 0.25);
  // The rig's baseline of some 8.3 cm along x.
  EXPECT_NEAR(rig.calibration.baseline_m(), 0.0834, 0.0015);
  EXPECT_GT(-rig.calibration.right_from_left.t.x(), 0.99 * rig.calibration.baseline_m());
  EXPECT_LT(rig.calibration.right_from_left.angle(), 0.03);
}

}  // namespace
}  // namespace parallax
