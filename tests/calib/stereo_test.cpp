#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "calib/stereo_calibration.h"
#include "camera/calibration_file.h"
#include "camera/dataset_text.h"
#include "core/error.h"
#include "tests/calib/rendered_board.h"

namespace parallax {
namespace {

using namespace calib_test;

struct Rig {
  StereoCalibration truth;
  StereoData data;
};

Rig make_rig(const CalibrationTarget& target, double noise_px, unsigned seed) {
  Rig rig;
  const auto radtan = [](double fx, double fy, double cx, double cy, double k1, double k2) {
    return CameraModel(CameraModelKind::radtan, 640, 480, {fx, fy}, {cx, cy}, {k1, k2, 0.0005, -0.0004}, 4);
  };
  rig.truth.left = radtan(545, 548, 323.4, 236.2, -0.28, 0.09);
  rig.truth.right = radtan(551, 550, 318.1, 243.7, -0.27, 0.08);
  rig.truth.right_from_left = RigidTransform(exp_so3({0.008, -0.013, 0.004}), {-0.083, 0.0012, -0.0021});
  rig.data = {target, 640, 480, {}};
  std::mt19937 random(seed);
  const auto poses = board_poses(rig.truth.left, target, 16, 5);
  std::vector<RigidTransform> right;
  for (const auto& pose : poses) right.push_back(rig.truth.right_from_left * pose);
  const CalibrationData a = exact_views(rig.truth.left, target, poses, noise_px, &random);
  const CalibrationData b = exact_views(rig.truth.right, target, right, noise_px, &random);
  for (std::size_t i = 0; i < poses.size(); ++i)
    rig.data.views.push_back({static_cast<int>(i), "", a.views[i].corners, b.views[i].corners});
  return rig;
}

void expect_truth(const StereoResult& result, const StereoCalibration& truth) {
  ASSERT_TRUE(result.ok) << result.reason;
  const Vector6d error = (result.calibration.right_from_left * truth.right_from_left.inverse()).log();
  for (int i = 0; i < 6; ++i) {
    EXPECT_LT(std::abs(error(i)), 3.2 * result.rig_sigma(i)) << "coordinate " << i;
    EXPECT_GT(result.rig_sigma(i), 0);
    EXPECT_LT(result.rig_sigma(i), 0.002);
  }
  const Eigen::VectorXd left = lens_parameters(result.calibration.left) - lens_parameters(truth.left);
  const Eigen::VectorXd right = lens_parameters(result.calibration.right) - lens_parameters(truth.right);
  for (int i = 0; i < left.size(); ++i) {
    EXPECT_LT(std::abs(left(i)), 3.5 * result.left_sigma(i));
    EXPECT_LT(std::abs(right(i)), 3.5 * result.right_sigma(i));
  }
}

CalibrationOptions radtan4() {
  CalibrationOptions options;
  options.model = LensModel::radtan4;
  return options;
}

TEST(Stereo, FindsTheRig) {
  const Rig rig = make_rig(chessboard(), 0.1, 3);
  const auto result = calibrate_stereo(rig.data, radtan4());
  expect_truth(result, rig.truth);
  EXPECT_NEAR(result.noise_px, 0.1, 0.01);
  EXPECT_EQ(result.pairs, 16);
  EXPECT_NEAR(result.epipolar_px, 0.1 * std::sqrt(2.0), 0.04);
}

// A board that looks the same upside down, counted from the other end in some of the right images.
TEST(Stereo, UnderstandsTurnedBoards) {
  const CalibrationTarget target = chessboard(8, 6);
  Rig rig = make_rig(target, 0.1, 4);
  for (std::size_t i = 0; i < rig.data.views.size(); i += 3) {
    for (auto& corner : rig.data.views[i].right) corner.id = 47 - corner.id;
    std::reverse(rig.data.views[i].right.begin(), rig.data.views[i].right.end());
  }
  expect_truth(calibrate_stereo(rig.data, radtan4()), rig.truth);
}

TEST(Stereo, SaysWhyNot) {
  Rig rig = make_rig(chessboard(), 0.1, 5);
  for (std::size_t i = 0; i < rig.data.views.size(); ++i)
    (i % 2 == 0 ? rig.data.views[i].left : rig.data.views[i].right).clear();
  const auto result = calibrate_stereo(rig.data, radtan4());
  EXPECT_FALSE(result.ok);
  EXPECT_NE(result.reason.find("0 pairs"), std::string::npos) << result.reason;
}

class RigFile : public ::testing::Test {
 protected:
  const std::string path_ = (std::filesystem::path(::testing::TempDir()) / "parallax_rig.yaml").string();
  void TearDown() override { std::filesystem::remove(path_); }
};

TEST_F(RigFile, ReadsBack) {
  const StereoCalibration rig = make_rig(chessboard(), 0, 1).truth;
  write_stereo_calibration(rig, path_);
  const StereoCalibration again = read_stereo_calibration(path_);
  EXPECT_EQ(again.left, rig.left);
  EXPECT_EQ(again.right, rig.right);
  EXPECT_EQ(again.right_from_left.R, rig.right_from_left.R);
  EXPECT_EQ(again.right_from_left.t, rig.right_from_left.t);
  EXPECT_EQ(read_calibration(path_), rig.left);
  EXPECT_EQ(read_calibration(path_, 1), rig.right);
  EXPECT_THROW((void)read_calibration(path_, 2), InputError);
}

TEST_F(RigFile, RefusesWhatIsNoRig) {
  write_calibration(lenses()[0].camera, path_);
  EXPECT_THROW((void)read_stereo_calibration(path_), InputError);
  std::string text = format_stereo_calibration(make_rig(chessboard(), 0, 1).truth);
  const auto at = text.find("from_left: [") + 12;
  text.insert(at, "7");
  std::ofstream(path_) << text;
  EXPECT_THROW((void)read_stereo_calibration(path_), InputError);
}

TEST(EurocSensorFile, ReadsBack) {
  const StereoCalibration rig = make_rig(chessboard(), 0, 1).truth;
  const RigidTransform body_from_right = rig.right_from_left.inverse();
  for (const CameraModel& camera : {rig.left, lenses()[0].camera, lenses()[4].camera}) {
    const EurocSensor sensor = parse_euroc_sensor(format_euroc_sensor(camera, body_from_right, 20), "sensor.yaml");
    EXPECT_EQ(sensor.camera, camera);
    EXPECT_LT((sensor.body_from_camera.R - body_from_right.R).norm(), 1e-12);
    EXPECT_LT((sensor.body_from_camera.t - body_from_right.t).norm(), 1e-12);
    EXPECT_EQ(sensor.rate_hz, 20);
  }
  EXPECT_THROW((void)format_euroc_sensor(lenses()[5].camera, body_from_right, 20), InputError);
}

}  // namespace
}  // namespace parallax
