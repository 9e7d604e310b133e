#include "tracker/motion_model.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include "core/error.h"
#include "tests/tracker/planar_scene.h"

namespace parallax {
namespace {

using test::PlanarScene;
using test::pyramid_of;
using test::similarity;

const CameraModel& camera() {
  static const CameraModel c(CameraModelKind::pinhole, 640, 480, {500, 500}, {319.5, 239.5});
  return c;
}

Timestamp frame_time(double frame, double rate = 30) { return from_seconds(1000 + frame / rate); }

double distance(const RigidTransform& a, const RigidTransform& b) { return (a * b.inverse()).log().norm(); }

Vector6d increment() { return (Vector6d() << 0.01, -0.004, 0.006, 0.01, 0.02, -0.015).finished(); }

RigidTransform start_pose() { return {exp_so3({0.3, -0.2, 0.1}), Eigen::Vector3d(0.1, 0.2, 0.8)}; }

// Poses of a constant velocity per frame; the model has seen frames 0 to n.
RigidTransform run(MotionModel* model, int n, double rate = 30) {
  RigidTransform pose = start_pose();
  model->reset(pose, frame_time(0, rate));
  for (int i = 1; i <= n; ++i) {
    pose = RigidTransform::exp(increment()) * pose;
    model->update(pose, frame_time(i, rate));
  }
  return pose;
}

TEST(MotionModel, WithoutVelocityThePoseStays) {
  MotionModel model(camera());
  EXPECT_LT(distance(model.predict(frame_time(3), nullptr, nullptr), RigidTransform()), 1e-12);
  model.reset(start_pose(), frame_time(0));
  EXPECT_LT(distance(model.predict(frame_time(1), nullptr, nullptr), start_pose()), 1e-12);
  EXPECT_EQ(model.expected_image_motion_px(1), 0);
  EXPECT_TRUE(model.is_nearly_still(1));
}

TEST(MotionModel, PredictsConstantVelocityAtAnyFrameRate) {
  for (const double rate : {10.0, 30.0, 120.0}) {
    MotionModel model(camera());
    const RigidTransform last = run(&model, 25, rate);
    const RigidTransform expected = RigidTransform::exp(increment()) * last;
    EXPECT_LT(distance(model.predict(frame_time(26, rate), nullptr, nullptr), expected), 1e-6) << rate;
  }
}

TEST(MotionModel, AGapIsBridgedByDecayingVelocity) {
  MotionModel model(camera());
  const RigidTransform last = run(&model, 25);
  // three frames' time: 1 + 0.9 + 0.81 increments
  const RigidTransform expected = RigidTransform::exp(increment() * 2.71) * last;
  EXPECT_LT(distance(model.predict(frame_time(28), nullptr, nullptr), expected), 1e-5);
  // a minute later the prediction is still near by
  const double far = distance(model.predict(frame_time(25 + 1800), nullptr, nullptr), last);
  EXPECT_LT(far, 10 * increment().norm());
  // and a time stamp that does not advance predicts the last pose
  EXPECT_LT(distance(model.predict(frame_time(25), nullptr, nullptr), last), 1e-12);
  EXPECT_LT(distance(model.predict(frame_time(20), nullptr, nullptr), last), 1e-12);
}

TEST(MotionModel, MissedFramesDoNotSpoilTheVelocity) {
  MotionModel model(camera());
  RigidTransform pose = run(&model, 25);
  pose = RigidTransform::exp(increment() * 4) * pose;
  model.update(pose, frame_time(29));
  EXPECT_LT(distance(model.predict(frame_time(30), nullptr, nullptr), RigidTransform::exp(increment()) * pose), 1e-6);
}

TEST(MotionModel, UntrackedFramesLetItDecayToAStop) {
  MotionModel model(camera());
  run(&model, 25);
  double speed = model.velocity().norm(), travelled = 0;
  RigidTransform pose = model.pose();
  for (int i = 26; i < 200; ++i) {
    const RigidTransform predicted = model.predict(frame_time(i), nullptr, nullptr);
    travelled += distance(predicted, pose);
    model.update_untracked(predicted, frame_time(i));
    pose = predicted;
    ASSERT_NEAR(model.velocity().norm(), 0.9 * speed, 1e-4 * speed);
    speed = model.velocity().norm();
    ASSERT_LT(distance(model.pose(), predicted), 1e-12);
  }
  EXPECT_LT(speed, 1e-6);
  EXPECT_NEAR(travelled, 10 * increment().norm(), 0.05 * increment().norm());  // 1 / (1 - 0.9) frames' worth
  EXPECT_TRUE(model.is_nearly_still(0.5));
}

TEST(MotionModel, ExpectedImageMotion) {
  MotionModelOptions options;
  options.smoothing = 1;
  MotionModel model(camera(), options);
  const auto after = [&](const Vector6d& step) {
    model.reset(start_pose(), frame_time(0));
    model.update(RigidTransform::exp(step) * start_pose(), frame_time(1));
  };
  Vector6d step = Vector6d::Zero();
  step[0] = 0.004;  // 4 mm sideways at 1 m: 2 px
  after(step);
  EXPECT_NEAR(model.expected_image_motion_px(1), 2, 1e-3);
  EXPECT_NEAR(model.expected_image_motion_px(4), 0.5, 1e-3);
  EXPECT_FALSE(model.is_nearly_still(1));
  EXPECT_TRUE(model.is_nearly_still(4));
  step.setZero();
  step[4] = 0.01;  // 5 px whatever the depth
  after(step);
  EXPECT_NEAR(model.expected_image_motion_px(1), 5, 1e-3);
  EXPECT_NEAR(model.expected_image_motion_px(100), 5, 1e-3);
}

TEST(MotionModel, ARebasedWorldPredictsTheSameImages) {
  MotionModel a(camera()), b(camera());
  run(&a, 10);
  run(&b, 10);
  const SimilarityTransform change(2.5, exp_so3({0.4, 1.0, -0.7}), Eigen::Vector3d(3, -2, 1));
  b.rebase(change);
  for (const double frame : {10.0, 11.0, 14.0}) {
    const RigidTransform old_pose = a.predict(frame_time(frame), nullptr, nullptr);
    const RigidTransform new_pose = b.predict(frame_time(frame), nullptr, nullptr);
    EXPECT_LT(distance(change.rebase(old_pose), new_pose), 1e-12);
    const Eigen::Vector3d x(0.3, -0.4, 2);
    EXPECT_LT((2.5 * (old_pose * x) - new_pose * (change * x)).norm(), 1e-12);
  }
  EXPECT_NEAR(a.expected_image_motion_px(1), b.expected_image_motion_px(2.5), 1e-9);
}

// Two views of a distant scene by a camera that turned about its own centre.
struct Turn {
  SmallBlurryImage last, current;
  Eigen::Matrix3d rotation;
};

Turn make_turn(const Eigen::Vector3d& w) {
  static const PlanarScene scene(640, 480, 21);
  Eigen::Matrix3d K;
  K << 500, 0, 319.5, 0, 500, 239.5, 0, 0, 1;
  Turn turn;
  turn.rotation = exp_so3(w);
  turn.last = make_small_blurry_image(*pyramid_of(scene.render(Eigen::Matrix3d::Identity())));
  turn.current = make_small_blurry_image(*pyramid_of(scene.render(K * turn.rotation * K.inverse())));
  return turn;
}

TEST(MotionModel, AFastTurnIsSeenByTheSmallImages) {
  MotionModel model(camera());
  model.reset(start_pose(), frame_time(0));
  const Turn turn = make_turn({0.03, -0.12, 0.02});
  const RigidTransform predicted = model.predict(frame_time(1), &turn.last, &turn.current);
  EXPECT_LT(log_so3(predicted.R * (turn.rotation * start_pose().R).transpose()).norm(), 0.012);
  // the camera turned about its centre
  const Eigen::Vector3d centre = -(predicted.R.transpose() * predicted.t);
  const Eigen::Vector3d before = -(start_pose().R.transpose() * start_pose().t);
  EXPECT_LT((centre - before).norm(), 1e-9);
}

TEST(MotionModel, TheTranslationComesFromTheModel) {
  MotionModelOptions options;
  options.smoothing = 1;
  MotionModel model(camera(), options);
  model.set_scene_depth(50);
  model.reset(start_pose(), frame_time(0));
  Vector6d step = Vector6d::Zero();
  step.head<3>() = Eigen::Vector3d(-0.02, 0.01, 0.03);
  const RigidTransform pose = RigidTransform::exp(step) * start_pose();
  model.update(pose, frame_time(1));
  const Turn turn = make_turn({0, 0.1, 0});
  const RigidTransform predicted = model.predict(frame_time(2), &turn.last, &turn.current);
  EXPECT_LT(log_so3(predicted.R * (turn.rotation * pose.R).transpose()).norm(), 0.012);
  const RigidTransform modelled = RigidTransform::exp(step) * pose;
  const Eigen::Vector3d centre = -(predicted.R.transpose() * predicted.t);
  EXPECT_LT((centre + modelled.R.transpose() * modelled.t).norm(), 1e-8);  // time stamps are whole nanoseconds
}

// A slide before a near scene moves the image as a turn would: with the depth known, the model is right and is kept.
TEST(MotionModel, AKnownSlideIsNotTakenForATurn) {
  static const PlanarScene scene(640, 480, 22);
  MotionModelOptions options;
  options.smoothing = 1;
  MotionModel model(camera(), options);
  model.reset(start_pose(), frame_time(0));
  Vector6d step = Vector6d::Zero();
  step[0] = 0.04;  // at 1 m: 20 px
  const RigidTransform pose = RigidTransform::exp(step) * start_pose();
  model.update(pose, frame_time(1));
  const auto small = [&](double shift) {
    return make_small_blurry_image(*pyramid_of(scene.render(similarity(scene.centre(), 0, 1, {shift, 0}))));
  };
  const SmallBlurryImage last = small(0), current = small(20);
  model.set_scene_depth(1);
  const RigidTransform expected = RigidTransform::exp(step) * pose;
  EXPECT_LT(distance(model.predict(frame_time(2), &last, &current), expected), 1e-8);
  // without it the turn explains the image, and the slide is left out: the image still moves once, not twice
  model.set_scene_depth(0);
  const RigidTransform turned = model.predict(frame_time(2), &last, &current);
  const Eigen::Vector3d point = pose.inverse() * Eigen::Vector3d(0, 0, 1);
  Eigen::Vector2d px;
  ASSERT_TRUE(camera().project(turned * point, &px));
  EXPECT_NEAR(px.x(), 319.5 + 20, 4);
  EXPECT_NEAR(px.y(), 239.5, 4);
}

TEST(MotionModel, UnsoundAlignmentsAreIgnored) {
  static const PlanarScene scene(640, 480, 23);
  MotionModel model(camera());
  const RigidTransform last = run(&model, 20);
  const RigidTransform expected = RigidTransform::exp(increment()) * last;
  const SmallBlurryImage seen = make_small_blurry_image(*pyramid_of(scene.render(Eigen::Matrix3d::Identity())));
  const SmallBlurryImage blank = make_small_blurry_image(*pyramid_of(cv::Mat1b(480, 640, static_cast<uchar>(80))));
  const SmallBlurryImage none;
  EXPECT_LT(distance(model.predict(frame_time(21), &seen, &blank), expected), 1e-5);
  EXPECT_LT(distance(model.predict(frame_time(21), &none, &seen), expected), 1e-5);
  EXPECT_LT(distance(model.predict(frame_time(21), &seen, nullptr), expected), 1e-5);
}

TEST(MotionModel, ResetForgets) {
  MotionModel model(camera());
  run(&model, 10);
  model.reset(start_pose(), frame_time(50));
  EXPECT_LT(distance(model.predict(frame_time(51), nullptr, nullptr), start_pose()), 1e-12);
  EXPECT_EQ(model.velocity().norm(), 0);
}

TEST(MotionModel, OptionsAreChecked) {
  MotionModelOptions options;
  options.decay_per_frame = 1.5;
  EXPECT_THROW(MotionModel(camera(), options), InputError);
  options = {};
  options.smoothing = 0;
  EXPECT_THROW(MotionModel(camera(), options), InputError);
}

}  // namespace
}  // namespace parallax
