#include "calib/camera_calibration.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "calib/model_selection.h"
#include "calib/projection_uncertainty.h"
#include "calib/rig_adjustment.h"
#include "core/error.h"
#include "tests/calib/rendered_board.h"

namespace parallax {
namespace {

using namespace calib_test;

CalibrationOptions with_model(LensModel model) {
  CalibrationOptions options;
  options.model = model;
  return options;
}

void expect_within(const CameraCalibration& c, const CameraModel& truth, double sigmas, const std::string& what) {
  ASSERT_TRUE(c.ok) << what << ": " << c.reason;
  const Eigen::VectorXd p = lens_parameters(truth), sigma = c.cautious_sigma();
  for (int i = 0; i < p.size(); ++i) {
    EXPECT_LT(std::abs(c.parameters(i) - p(i)), sigmas * sigma(i) + 1e-9)
        << what << " " << c.names[static_cast<std::size_t>(i)] << ": found " << c.parameters(i) << " +- " << sigma(i)
        << ", truth " << p(i);
    EXPECT_GT(sigma(i), 0);
  }
}

TEST(CameraCalibration, IsExactWithoutNoise) {
  std::mt19937 random(1);
  for (const auto& [model, camera] : lenses()) {
    const auto poses = board_poses(camera, chessboard(), 12, 5);
    const auto c = calibrate_camera(exact_views(camera, chessboard(), poses, 0, &random), with_model(model));
    ASSERT_TRUE(c.ok) << to_string(model) << ": " << c.reason;
    EXPECT_LT(c.rms_px, 1e-5) << to_string(model);
    EXPECT_EQ(c.outliers, 0);
    // What the lens does, and not its single numbers: those of the rational model are nearly free to trade.
    for (double v = 0; v < 480; v += 60)
      for (double u = 0; u < 640; u += 80) {
        Eigen::Vector3d ray;
        Eigen::Vector2d px;
        if (!camera.unproject({u, v}, &ray)) continue;
        ASSERT_TRUE(c.camera.project(ray, &px));
        EXPECT_LT((px - Eigen::Vector2d(u, v)).norm(), 0.05) << to_string(model) << " at " << u << ", " << v;
      }
    for (std::size_t i = 0; i < poses.size(); ++i)
      EXPECT_LT((c.views[i].camera_from_target.t - poses[i].t).norm(), 1e-4);
  }
}

// The standard deviations are what they say: over many trials the squared error in units of the covariance has the mean
// of a chi-squared variable.
TEST(CameraCalibration, CovarianceIsHonest) {
  const CameraModel camera = lenses()[5].camera;  // fov
  std::mt19937 random(17);
  const auto poses = board_poses(camera, chessboard(), 10, 5);
  const Eigen::VectorXd truth = lens_parameters(camera);
  constexpr int trials = 30;
  double sum = 0, noise = 0;
  for (int trial = 0; trial < trials; ++trial) {
    const auto c = calibrate_camera(exact_views(camera, chessboard(), poses, 0.2, &random), with_model(LensModel::fov));
    ASSERT_TRUE(c.ok);
    const Eigen::VectorXd error = c.parameters - truth;
    sum += error.dot(c.covariance.ldlt().solve(error));
    noise += c.noise_px / trials;
  }
  // 5 parameters, 30 trials: 150 +- 17.
  EXPECT_GT(sum, 90);
  EXPECT_LT(sum, 215);
  EXPECT_NEAR(noise, 0.2, 0.004);
}

TEST(CameraCalibration, OutliersAreDropped) {
  std::mt19937 random(23);
  for (const std::size_t lens : {1U, 4U, 5U}) {
    const auto [model, camera] = lenses()[lens];
    CalibrationData data = exact_views(camera, chessboard(), board_poses(camera, chessboard(), 14, 5), 0.1, &random);
    std::uniform_real_distribution<double> unit(-1, 1);
    int moved = 0;
    for (auto& view : data.views)
      for (auto& corner : view.corners)
        if (unit(random) > 0.9) {  // one in twenty
          corner.px += Eigen::Vector2d(3 + 20 * std::abs(unit(random)), -5 * unit(random));
          ++moved;
        }
    // And one view whose points are counted wrongly: no pose suits more than half of them.
    for (auto& corner : data.views[3].corners) corner.px.x() += corner.id % 2 == 0 ? 9 : -9;
    const auto c = calibrate_camera(data, with_model(model));
    expect_within(c, camera, 3.5, to_string(model));
    EXPECT_NEAR(c.noise_px, 0.1, 0.015);
    EXPECT_GE(c.outliers, moved);
    EXPECT_LT(c.outliers, moved + 54 + 12);
    EXPECT_GE(c.views[3].outliers, 24);
  }
}

TEST(CameraCalibration, SaysWhatItCannotTell) {
  std::mt19937 random(2);
  const CameraModel camera = lenses()[0].camera;
  CalibrationData none{chessboard(), 640, 480, {}};
  EXPECT_FALSE(calibrate_camera(none, with_model(LensModel::fov)).ok);
  // All views facing the camera at one distance say nothing of the focal length.
  std::vector<RigidTransform> facing;
  for (int i = 0; i < 6; ++i) facing.push_back({Eigen::Matrix3d::Identity(), {-0.1 + 0.002 * i, -0.06, 0.4}});
  const auto c =
      calibrate_camera(exact_views(camera, chessboard(), facing, 0.1, &random), with_model(LensModel::pinhole));
  if (c.ok) {
    EXPECT_GT(c.cautious_sigma()(0), 20);
  }
  CalibrationOptions wrong;
  wrong.outlier_sigmas = 0;
  EXPECT_THROW((void)calibrate_camera(none, wrong), InputError);
}

TEST(CameraCalibration, HoldsWhatItIsToldToHold) {
  std::mt19937 random(2);
  const CameraModel camera(CameraModelKind::radtan, 640, 480, {545, 545}, {323, 236}, {-0.28, 0.09, 0, 0}, 4);
  CalibrationOptions options = with_model(LensModel::radtan4);
  options.freedom.square_pixels = true;
  options.freedom.tangential = false;
  const auto c = calibrate_camera(
      exact_views(camera, chessboard(), board_poses(camera, chessboard(), 10, 5), 0.1, &random), options);
  ASSERT_TRUE(c.ok);
  EXPECT_EQ(c.parameters(0), c.parameters(1));
  EXPECT_EQ(c.parameters(6), 0);
  EXPECT_EQ(c.sigma(6), 0);
  for (int i = 0; i < 6; ++i)
    EXPECT_LT(std::abs(c.parameters(i) - lens_parameters(camera)(i)), 3.5 * c.cautious_sigma()(i));
}

// The whole way, through pictures: rendered boards, found, calibrated. Truth within three standard deviations for every
// parameter of every model.
class Rendered : public ::testing::TestWithParam<int> {};

TEST_P(Rendered, TruthWithinThreeStandardDeviations) {
  const auto [model, camera] = lenses()[static_cast<std::size_t>(GetParam())];
  const CalibrationTarget target = chessboard();
  const BoardRenderer renderer(camera, target);
  std::mt19937 random(101);
  CalibrationData data{target, 640, 480, {}};
  for (const auto& pose : board_poses(camera, target, 24, 31)) {
    const auto detection = detect_target(renderer.render(pose, &random), target);
    if (detection) data.views.push_back({static_cast<int>(data.views.size()), "", detection->corners});
  }
  ASSERT_GE(data.views.size(), 18u);
  const auto c = calibrate_camera(data, with_model(model));
  expect_within(c, camera, 3, to_string(model));
  EXPECT_LT(c.rms_px, 0.12);
  EXPECT_TRUE(c.converged);
  RecordProperty("rms_px", std::to_string(c.rms_px));
}
INSTANTIATE_TEST_SUITE_P(EveryModel, Rendered, ::testing::Range(0, 6));

TEST(RenderedDiscs, TruthWithinThreeStandardDeviations) {
  for (const TargetKind kind : {TargetKind::circles, TargetKind::asymmetric_circles, TargetKind::charuco}) {
    const auto [model, camera] = lenses()[kind == TargetKind::charuco ? 1 : 5];
    CalibrationTarget target = chessboard();
    target.kind = kind;
    if (kind == TargetKind::asymmetric_circles) {
      target.columns = 4;
      target.rows = 11;
    }
    const BoardRenderer renderer(camera, target);
    std::mt19937 random(101);
    CalibrationData data{target, 640, 480, {}};
    for (const auto& pose : board_poses(camera, target, 20, 31)) {
      const auto detection = detect_target(renderer.render(pose, &random), target);
      if (detection) data.views.push_back({static_cast<int>(data.views.size()), "", detection->corners});
    }
    ASSERT_GE(data.views.size(), 14u) << to_string(kind);
    const auto c = calibrate_camera(data, with_model(model));
    expect_within(c, camera, 3, to_string(kind));
    EXPECT_LT(c.rms_px, 0.15) << to_string(kind);
  }
}

TEST(ModelSelection, ChoosesTheModelThatMadeTheViews) {
  std::mt19937 random(41);
  for (const std::size_t lens : {0U, 1U, 5U}) {
    const auto [model, camera] = lenses()[lens];
    const auto data = exact_views(camera, chessboard(), board_poses(camera, chessboard(), 20, 3), 0.05, &random);
    CalibrationRequest request;
    const auto outcome = run_calibration(data, request);
    ASSERT_TRUE(outcome.ok) << outcome.reason;
    EXPECT_EQ(outcome.calibration.model, model) << to_string(outcome.calibration.model) << " for " << to_string(model);
    EXPECT_EQ(outcome.scores.size(), 6u);
    EXPECT_GT(outcome.held_out_views, 2);
    // Noise of 0.05 a coordinate, six of the pose's freedoms taken out.
    EXPECT_NEAR(outcome.held_out_px, 0.05 * std::sqrt(2.0 - 6.0 / 54), 0.012);
  }
}

// The Schur complement against the whole normal matrix, made of differences.
TEST(RigAdjustment, InformationIsThatOfTheDenseProblem) {
  std::mt19937 random(4);
  const CameraModel left = lenses()[1].camera, right = lenses()[5].camera;
  const auto poses = board_poses(left, chessboard(5, 4), 3, 9);
  RigProblem problem;
  problem.cameras = {left, right};
  problem.freedom = {lens_freedom_map(LensModel::radtan4, {}), lens_freedom_map(LensModel::fov, {})};
  problem.camera_from_rig = {RigidTransform(), RigidTransform(exp_so3({0.01, -0.02, 0.015}), {-0.1, 0.002, 0.004})};
  problem.rig_from_target = poses;
  const auto points = target_points(chessboard(5, 4));
  std::normal_distribution<double> noise(0, 0.1);
  for (int v = 0; v < 3; ++v)
    for (int c = 0; c < 2; ++c)
      for (const auto& point : points) {
        Eigen::Vector2d px;
        const auto k = static_cast<std::size_t>(c);
        if (!problem.cameras[k].project(problem.camera_from_rig[k] * (poses[static_cast<std::size_t>(v)] * point), &px))
          continue;
        problem.observations.push_back({v, c, point, px + Eigen::Vector2d(noise(random), noise(random)), true});
      }
  constexpr int shared = 8 + 5 + 6, all = shared + 18;
  const auto residuals = [&](const Eigen::VectorXd& step) {
    RigProblem moved = problem;
    moved.cameras[0] = *make_lens(LensModel::radtan4, 640, 480, lens_parameters(left) + step.head(8));
    moved.cameras[1] = *make_lens(LensModel::fov, 640, 480, lens_parameters(right) + step.segment(8, 5));
    moved.camera_from_rig[1] = RigidTransform::exp(Vector6d(step.segment<6>(13))) * problem.camera_from_rig[1];
    for (int v = 0; v < 3; ++v)
      moved.rig_from_target[static_cast<std::size_t>(v)] =
          RigidTransform::exp(Vector6d(step.segment<6>(shared + 6 * v))) * poses[static_cast<std::size_t>(v)];
    Eigen::VectorXd r(2 * static_cast<int>(problem.observations.size()));
    for (std::size_t i = 0; i < problem.observations.size(); ++i) {
      Eigen::Vector2d residual;
      EXPECT_TRUE(rig_residual(moved, problem.observations[i], &residual));
      r.segment<2>(2 * static_cast<int>(i)) = residual;
    }
    return r;
  };
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(all);
  Eigen::MatrixXd J(2 * static_cast<int>(problem.observations.size()), all);
  for (int i = 0; i < all; ++i) {
    const double h = (i < 4 || (i >= 8 && i < 12)) ? 1e-3 : 1e-6;
    Eigen::VectorXd a = zero, b = zero;
    a(i) = h;
    b(i) = -h;
    J.col(i) = (residuals(a) - residuals(b)) / (2 * h);
  }
  const Eigen::MatrixXd H = J.transpose() * J;
  const Eigen::MatrixXd Hvv = H.bottomRightCorner(18, 18), Hsv = H.topRightCorner(shared, 18);
  const Eigen::MatrixXd dense = H.topLeftCorner(shared, shared) - Hsv * Hvv.ldlt().solve(Hsv.transpose());
  const RigInformation information = rig_information(problem);
  ASSERT_EQ(information.information.rows(), shared);
  const Eigen::VectorXd scale = dense.diagonal().cwiseSqrt().cwiseInverse();
  EXPECT_LT((scale.asDiagonal() * (information.information - dense) * scale.asDiagonal()).norm(), 1e-5);

  // And the solution is where a dense Gauss-Newton step is nothing.
  RigAdjustmentOptions options;
  const auto summary = adjust_rig(&problem, options);
  EXPECT_TRUE(summary.converged);
  EXPECT_LT(rig_information(problem).view_gradients.rowwise().sum().cwiseProduct(scale).norm(), 1e-4);
}

TEST(ProjectionUncertainty, IsWhatTrialsScatterBy) {
  const CameraModel camera = lenses()[1].camera;
  std::mt19937 random(19);
  const auto poses = board_poses(camera, chessboard(), 10, 5);
  std::vector<CameraModel> fitted;
  std::vector<double> stated(63, 0.0);  // squared
  for (int trial = 0; trial < 20; ++trial) {
    const auto c =
        calibrate_camera(exact_views(camera, chessboard(), poses, 0.2, &random), with_model(LensModel::radtan4));
    ASSERT_TRUE(c.ok);
    fitted.push_back(c.camera);
    const UncertaintyMap map = projection_uncertainty(c, 9, 7);
    for (std::size_t i = 0; i < stated.size(); ++i) stated[i] += map.sigma_px[i] * map.sigma_px[i] / 20;
  }
  // In the middle and near a corner: the scatter of the projection once each trial's rotation (over the same grid) is
  // taken out. Loose bounds: 20 trials, and the larger axis of the ellipse.
  std::vector<Eigen::Vector3d> rays;
  std::vector<Eigen::Vector2d> pixels;
  for (int row = 0; row < 7; ++row)
    for (int column = 0; column < 9; ++column) {
      Eigen::Vector3d ray;
      pixels.emplace_back(639.0 * column / 8, 479.0 * row / 6);
      ASSERT_TRUE(camera.unproject(pixels.back(), &ray));
      rays.push_back(ray.normalized());
    }
  std::vector<double> square(rays.size(), 0.0);
  for (const auto& lens : fitted) {
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    for (int round = 0; round < 5; ++round) {
      Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
      Eigen::Vector3d g = Eigen::Vector3d::Zero();
      for (std::size_t i = 0; i < rays.size(); ++i) {
        Eigen::Vector2d px;
        Eigen::Matrix<double, 2, 3> by_point;
        const Eigen::Vector3d p = R * rays[i];
        ASSERT_TRUE(lens.project(p, &px, &by_point));
        const Eigen::Matrix<double, 2, 3> J = -by_point * hat(p);
        H += J.transpose() * J;
        g += J.transpose() * (px - pixels[i]);
      }
      R = exp_so3(-H.ldlt().solve(g)) * R;
    }
    for (std::size_t i = 0; i < rays.size(); ++i) {
      Eigen::Vector2d px;
      ASSERT_TRUE(lens.project(R * rays[i], &px));
      square[i] += (px - pixels[i]).squaredNorm() / 20;
    }
  }
  for (const std::size_t i : {std::size_t{0}, std::size_t{8}, std::size_t{31}, std::size_t{54}, std::size_t{62}}) {
    EXPECT_GT(stated[i], 0.5 * square[i]) << i;
    EXPECT_LT(stated[i], 2.5 * 2.5 * square[i]) << i;
  }
  EXPECT_GT(stated[0], stated[31]);  // corners are known less than the middle
}

}  // namespace
}  // namespace parallax
