#include <gtest/gtest.h>

#include <set>

#include "calib/target_detection.h"
#include "tests/calib/rendered_board.h"

namespace parallax {
namespace {

using calib_test::BoardRenderer;

struct Case {
  TargetKind kind;
  int columns, rows;
  double rms_px;  // what the corners are found to at least
};

class Detection : public ::testing::TestWithParam<Case> {};

// Every point where the camera model puts it, by its own id (up to the turns that nobody can tell).
TEST_P(Detection, FindsEveryPointWhereItIs) {
  CalibrationTarget target = calib_test::chessboard(GetParam().columns, GetParam().rows, 0.025);
  target.kind = GetParam().kind;
  const auto all = calib_test::lenses();
  for (const std::size_t lens : {1U, 5U}) {
    const CameraModel& camera = all[lens].camera;
    const BoardRenderer renderer(camera, target);
    std::mt19937 random(7);
    const auto points = target_points(target);
    int found = 0;
    double sum = 0;
    int n = 0;
    const auto poses = calib_test::board_poses(camera, target, 8, 11);
    ASSERT_EQ(poses.size(), 8u);
    for (const auto& pose : poses) {
      const GreyImage image = renderer.render(pose, &random);
      const auto detection = detect_target(image, target);
      if (!detection) continue;
      ++found;
      EXPECT_GT(detection->edge_px, 1);
      EXPECT_LT(detection->edge_px, 4.5);
      double best = 1e9;
      for (const auto& ids : target_symmetries(target)) {
        double worst = 0, total = 0;
        for (const auto& corner : detection->corners) {
          const auto id = static_cast<std::size_t>(ids[static_cast<std::size_t>(corner.id)]);
          Eigen::Vector2d px;
          ASSERT_TRUE(camera.project(pose * points[id], &px));
          if (target.kind == TargetKind::circles || target.kind == TargetKind::asymmetric_circles)
            px += disc_bias(camera, pose, points[id], 0.5 * target.detail());
          worst = std::max(worst, (px - corner.px).norm());
          total += (px - corner.px).squaredNorm();
        }
        if (worst < best) {
          best = worst;
          if (ids == target_symmetries(target).back() || best < 2) {
            sum += total;
            n += static_cast<int>(detection->corners.size());
          }
        }
      }
      EXPECT_LT(best, target.kind == TargetKind::charuco ? 1.5 : 1) << to_string(target.kind);
      EXPECT_GT(detection->corners.size(),
                (target.kind == TargetKind::charuco ? 0.5 : 0.8) * static_cast<double>(points.size()));
    }
    EXPECT_GE(found, 6) << to_string(target.kind) << " " << to_string(all[lens].model);
    EXPECT_LT(std::sqrt(sum / n), GetParam().rms_px) << to_string(target.kind) << " " << to_string(all[lens].model);
    RecordProperty("rms_px", std::to_string(std::sqrt(sum / n)));
  }
}

INSTANTIATE_TEST_SUITE_P(Targets, Detection,
                         ::testing::Values(Case{TargetKind::chessboard, 9, 6, 0.035},
                                           Case{TargetKind::chessboard, 8, 6, 0.035},
                                           Case{TargetKind::charuco, 9, 6, 0.12}, Case{TargetKind::circles, 8, 6, 0.02},
                                           Case{TargetKind::asymmetric_circles, 4, 11, 0.02},
                                           Case{TargetKind::squares, 6, 5, 0.25}));

TEST(Detection, SeesACharucoBoardInPart) {
  CalibrationTarget target = calib_test::chessboard(9, 6, 0.025);
  target.kind = TargetKind::charuco;
  const CameraModel camera = calib_test::lenses()[0].camera;
  const BoardRenderer renderer(camera, target);
  std::mt19937 random(3);
  // The right half is outside the image.
  const RigidTransform pose(exp_so3({0.1, 0.2, 0.05}), {0.02, -0.06, 0.26});
  const auto detection = detect_target(renderer.render(pose, &random), target);
  ASSERT_TRUE(detection);
  EXPECT_LT(detection->corners.size(), 54u);
  EXPECT_GE(detection->corners.size(), 12u);
  const auto points = target_points(target);
  for (const auto& corner : detection->corners) {
    Eigen::Vector2d px;
    ASSERT_TRUE(camera.project(pose * points[static_cast<std::size_t>(corner.id)], &px));
    EXPECT_LT((px - corner.px).norm(), 0.5);
  }
}

TEST(Detection, FindsNothingInNoise) {
  std::mt19937 random(5);
  std::uniform_int_distribution<int> grey(0, 255);
  GreyImage image(240, 320);
  for (auto& value : image) value = static_cast<unsigned char>(grey(random));
  cv::GaussianBlur(image, image, cv::Size(), 1.5);
  for (const TargetKind kind : {TargetKind::chessboard, TargetKind::charuco, TargetKind::circles,
                                TargetKind::asymmetric_circles, TargetKind::squares}) {
    CalibrationTarget target = calib_test::chessboard(9, 6, 0.025);
    target.kind = kind;
    DetectionOptions quick;
    quick.thorough = false;
    EXPECT_FALSE(detect_target(image, target, quick)) << to_string(kind);
  }
}

TEST(Detection, TellsABlurredBoard) {
  const CalibrationTarget target = calib_test::chessboard();
  const CameraModel camera = calib_test::lenses()[0].camera;
  std::mt19937 random(3);
  calib_test::BoardLook blurred;
  blurred.blur_px = 3;
  const RigidTransform pose(exp_so3({0.1, 0.2, 0.05}), {-0.1, -0.06, 0.35});
  const auto sharp_view = detect_target(BoardRenderer(camera, target).render(pose, &random), target);
  const auto blurred_view = detect_target(BoardRenderer(camera, target, blurred).render(pose, &random), target);
  ASSERT_TRUE(sharp_view && blurred_view);
  EXPECT_LT(sharp_view->edge_px, 4);
  EXPECT_GT(blurred_view->edge_px, 5.5);
}

}  // namespace
}  // namespace parallax
