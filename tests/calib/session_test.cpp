// Calibrating live, with a camera and a board that are rendered and a user who does as told.
#include <gtest/gtest.h>

#include <set>

#include "calib/calibration_session.h"
#include "calib/planar_pose.h"
#include "core/error.h"
#include "tests/calib/rendered_board.h"

namespace parallax {
namespace {

using namespace calib_test;

class Session : public ::testing::Test {
 protected:
  const CameraModel camera_ = lenses()[5].camera;  // fov
  const CalibrationTarget target_ = chessboard();
  const BoardRenderer renderer_{camera_, target_};
  std::mt19937 random_{9};

  // The board where the outline says, by the true lens.
  RigidTransform as_told(const WantedView& wanted) const {
    const auto points = target_points(target_);
    RigidTransform pose;
    double rms = 0;
    EXPECT_EQ(wanted.inner_px.size(), points.size());
    EXPECT_TRUE(find_planar_pose(camera_, points, wanted.inner_px, &pose, &rms));
    return pose;
  }
};

TEST_F(Session, KeepsOnlyStillSharpAndNewViews) {
  CalibrationSession session(target_, 640, 480);
  const RigidTransform pose(exp_so3({0.3, 0.1, 0.05}), {-0.1, -0.06, 0.35});
  EXPECT_EQ(session.add_frame(GreyImage(480, 640, 120), 0).verdict, FrameVerdict::no_target);
  // Moving by some 12 px a frame.
  for (int i = 0; i < 4; ++i) {
    RigidTransform moving = pose;
    moving.t.x() += 0.01 * (i - 4);
    EXPECT_EQ(session.add_frame(renderer_.render(moving, &random_), 1 + i).verdict, FrameVerdict::moving) << i;
  }
  EXPECT_EQ(session.add_frame(renderer_.render(pose, &random_), 5).verdict, FrameVerdict::moving);
  EXPECT_EQ(session.add_frame(renderer_.render(pose, &random_), 6).verdict, FrameVerdict::kept);
  EXPECT_EQ(session.add_frame(renderer_.render(pose, &random_), 7).verdict, FrameVerdict::seen_before);
  BoardLook look;
  look.blur_px = 4;
  const BoardRenderer blurred(camera_, target_, look);
  const RigidTransform elsewhere(exp_so3({-0.3, 0.4, 0.05}), {-0.02, -0.06, 0.33});
  (void)session.add_frame(blurred.render(elsewhere, &random_), 8);
  EXPECT_EQ(session.add_frame(blurred.render(elsewhere, &random_), 9).verdict, FrameVerdict::blurred);
  EXPECT_EQ(session.add_frame(renderer_.render(elsewhere, &random_), 10).verdict, FrameVerdict::kept);
  ASSERT_EQ(session.data().views.size(), 2u);
  EXPECT_EQ(session.data().views[0].frame, 6);
  EXPECT_EQ(session.data().views[1].frame, 10);
  EXPECT_EQ(session.coverage().views, 2);
  EXPECT_TRUE(session.drop_last_view());
  EXPECT_EQ(session.coverage().views, 1);
  EXPECT_EQ(session.data().views.size(), 1u);
}

TEST_F(Session, WhoFollowsItsWishesIsCalibrated) {
  CalibrationSession session(target_, 640, 480);
  double progress = 0;
  std::set<std::string> wishes;
  int frames = 0;
  std::normal_distribution<double> sway(0, 0.03);
  for (int step = 0; step < 40 && !session.ready(); ++step) {
    const WantedView wanted = session.wanted_view();
    EXPECT_FALSE(wanted.text.empty());
    EXPECT_GE(wanted.outline_px.size(), 16u);
    wishes.insert(wanted.text);
    RigidTransform pose = as_told(wanted);
    // Nobody is that exact.
    pose = RigidTransform::exp((Vector6d() << 0.2 * sway(random_), 0.2 * sway(random_), 0.2 * sway(random_),
                                sway(random_), sway(random_), sway(random_))
                                   .finished()) *
           pose;
    for (int i = 0; i < 2; ++i) (void)session.add_frame(renderer_.render(pose, &random_), frames++);
    EXPECT_GE(session.progress(), progress);
    progress = session.progress();
  }
  EXPECT_TRUE(session.ready()) << session.progress() << " after " << session.data().views.size() << " views, wants "
                               << session.wanted_view().text;
  EXPECT_GT(wishes.size(), 4u);
  CalibrationRequest request;
  request.model = LensModel::fov;
  const auto outcome = run_calibration(session.data(), request);
  ASSERT_TRUE(outcome.ok) << outcome.reason;
  const Eigen::VectorXd truth = lens_parameters(camera_);
  for (int i = 0; i < truth.size(); ++i)
    EXPECT_LT(std::abs(outcome.calibration.parameters(i) - truth(i)), 3.5 * outcome.calibration.cautious_sigma()(i));
  const CalibrationJudgement judgement = session.judge(outcome);
  EXPECT_TRUE(judgement.enough) << (judgement.missing.empty() ? "" : judgement.missing[0]);
}

TEST_F(Session, SaysWhatIsMissing) {
  CalibrationSession session(target_, 640, 480);
  // Four views, all in the middle.
  int frame = 0;
  for (const Eigen::Vector3d& turn : {Eigen::Vector3d(0, 0.4, 0), Eigen::Vector3d(0.1, -0.5, 0),
                                      Eigen::Vector3d(0, 0.5, 0.4), Eigen::Vector3d(0.1, 0.1, -0.4)}) {
    const Eigen::Matrix3d R = exp_so3(turn);
    const RigidTransform pose(R, Eigen::Vector3d(0, 0, 0.6) - R * Eigen::Vector3d(0.1, 0.0625, 0));
    for (int i = 0; i < 2; ++i) (void)session.add_frame(renderer_.render(pose, &random_), frame++);
  }
  EXPECT_LT(session.progress(), 1);
  CalibrationRequest request;
  request.model = LensModel::fov;
  const auto outcome = run_calibration(session.data(), request);
  const CalibrationJudgement judgement = session.judge(outcome);
  EXPECT_FALSE(judgement.enough);
  ASSERT_GE(judgement.missing.size(), 2u);
  EXPECT_NE(judgement.missing[0].find("Take more views"), std::string::npos);
}

TEST(SessionOptions, AreChecked) {
  CalibrationSessionOptions options;
  options.fewest_views = 1;
  EXPECT_THROW(CalibrationSession(chessboard(), 640, 480, options), InputError);
  CalibrationTarget target = chessboard();
  target.rows = 1;
  EXPECT_THROW(CalibrationSession(target, 640, 480), InputError);
}

}  // namespace
}  // namespace parallax
