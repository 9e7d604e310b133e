#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "app/initialisation_hint.h"
#include "app/view_memory.h"
#include "render/synthetic_path.h"
#include "tests/support/lenses.h"

namespace parallax {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

CameraModel narrow_lens() { return {CameraModelKind::pinhole, 640, 480, {620, 620}, {319.5, 239.5}}; }

// Trails of a flat table seen from 0.6 m, square on or slanted, after the camera has moved.
TrackingResult trails(const CameraModel& camera, const RigidTransform& second_from_first, double slant, double noise_px,
                      int count = 300) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> u(0, 1);
  std::normal_distribution<double> noise(0, noise_px > 0 ? noise_px : 1e-9);
  TrackingResult out;
  out.state = TrackingState::trailing;
  for (int i = 0; i < 3 * count && static_cast<int>(out.trails.size()) < count; ++i) {
    const Vector2d first(640 * u(random), 480 * u(random));
    Vector3d ray;
    if (!camera.unproject(first, &ray)) continue;
    const double depth = 0.6 / (1 + slant * ray.y());
    Vector2d second;
    if (depth <= 0 || !camera.project(second_from_first * (depth * ray), &second) || !camera.in_image(second)) continue;
    second += Vector2d(noise(random), noise(random));
    out.trails.push_back({first.cast<float>(), second.cast<float>()});
  }
  return out;
}

RigidTransform slide(double metres) { return {Eigen::Matrix3d::Identity(), Vector3d(-metres, 0, 0)}; }

TEST(InitialisationHint, MeasuresTheMotionOfTrails) {
  for (const CameraModel& camera : {testing::wide_lens(), narrow_lens()}) {
    // A pure turn: everything is explained by it.
    const RigidTransform turn(exp_so3({0.02, 0.09, 0.01}), Vector3d::Zero());
    TrailMotion motion = trail_motion(camera, trails(camera, turn, 0.4, 0).trails);
    EXPECT_NEAR(motion.median_deg, 5.2, 0.5);
    EXPECT_LT(motion.beyond_rotation_deg, 1e-4);
    // Noise alone.
    motion = trail_motion(camera, trails(camera, {}, 0.4, 0.2).trails);
    EXPECT_LT(motion.median_deg, 0.06);
    // A slide by 5 cm at about 60 cm, square on: 4.8 degrees for what lies ahead, and less to the sides.
    motion = trail_motion(camera, trails(camera, slide(0.05), 0, 0).trails);
    EXPECT_GT(motion.median_deg, 2.5);
    EXPECT_LT(motion.median_deg, 4.8);
    EXPECT_GT(motion.beyond_rotation_deg, 0.05);
  }
  EXPECT_EQ(trail_motion(testing::wide_lens(), {}).median_deg, 0);
}

TEST(InitialisationHint, TellsATurnFromASlide) {
  for (const CameraModel& camera : {testing::wide_lens(), narrow_lens()}) {
    const RigidTransform turn(exp_so3({0.03, 0.12, 0.01}), Vector3d::Zero());
    auto hint = initialisation_hint(camera, trails(camera, turn, 0.4, 0.2), "");
    EXPECT_EQ(hint.kind, HintKind::turning) << hint.text;
    EXPECT_EQ(hint.gauge, 0);
    for (const double slant : {0.0, 0.5}) {
      for (const double metres : {0.02, 0.03, 0.1, 0.15}) {
        hint = initialisation_hint(camera, trails(camera, slide(metres), slant, 0.2), "");
        EXPECT_EQ(hint.kind, metres < 0.05 ? HintKind::slide : HintKind::ready)
            << metres << " m, slant " << slant << ", focal " << camera.focal_px().x() << ": " << hint.text << " gauge "
            << hint.gauge;
      }
    }
    // The gauge grows with the slide.
    double last = -1;
    for (const double metres : {0.0, 0.015, 0.03, 0.045, 0.06}) {
      hint = initialisation_hint(camera, trails(camera, slide(metres), 0.4, 0.1), "");
      EXPECT_GE(hint.gauge, last);
      EXPECT_LE(hint.gauge, 1);
      last = hint.gauge;
    }
    EXPECT_GT(last, 0.5);
  }
}

// A hand that slides turns too, often so that the table stays in the middle of the picture: the patches hardly move,
// and the parallax is there all the same.
TEST(InitialisationHint, ATurnTakesNothingFromASlide) {
  for (const CameraModel& camera : {testing::wide_lens(), narrow_lens()}) {
    for (const double slant : {0.0, 0.5}) {
      for (const double metres : {0.03, 0.05}) {
        const double slid = initialisation_hint(camera, trails(camera, slide(metres), slant, 0.1), "").parallax_deg;
        EXPECT_GT(slid, 0.6 * std::atan(metres / 0.6) * 180 / M_PI);
        EXPECT_LT(slid, 1.1 * std::atan(metres / 0.6) * 180 / M_PI);
        for (const double turn : {-0.08, -0.04, 0.04, 0.08}) {
          RigidTransform motion = slide(metres);
          motion.R = exp_so3({0.01, turn, 0.02});
          motion.t = motion.R * motion.t;
          const TrackingResult both = trails(camera, motion, slant, 0.1);
          EXPECT_NEAR(initialisation_hint(camera, both, "").parallax_deg, slid, 0.25 * slid)
              << metres << " m, turn " << turn << ", slant " << slant << ", focal " << camera.focal_px().x();
        }
      }
    }
  }
}

TEST(InitialisationHint, SaysWhatToDoInEveryState) {
  const CameraModel camera = testing::wide_lens();
  TrackingResult tracked;
  tracked.message = "press Space, then slide the camera sideways";
  HintOptions options;
  options.key = "Enter";
  auto hint = initialisation_hint(camera, tracked, "", options);
  EXPECT_EQ(hint.kind, HintKind::hold_still);
  EXPECT_NE(hint.text.find("Enter"), std::string::npos);
  tracked.message = "too few patches could be followed: press Space to start again";
  hint = initialisation_hint(camera, tracked, "", options);
  EXPECT_EQ(hint.kind, HintKind::refused);
  EXPECT_EQ(hint.text, "Too few patches could be followed: press Space to start again.");

  tracked = trails(camera, slide(0.1), 0.4, 0);
  EXPECT_NE(initialisation_hint(camera, tracked, "", options).text.find("press Enter"), std::string::npos);
  options.automatic = true;
  EXPECT_EQ(initialisation_hint(camera, tracked, "", options).text.find("press"), std::string::npos);
  // A refusal stands before everything else, and the gauge stays.
  hint = initialisation_hint(camera, tracked, "The camera only turned.");
  EXPECT_EQ(hint.kind, HintKind::refused);
  EXPECT_EQ(hint.text, "The camera only turned.");
  EXPECT_EQ(hint.gauge, 1);
  EXPECT_EQ(initialisation_hint(camera, tracked, "The camera only turned.", options).kind, HintKind::ready)
      << "tries that the program makes by itself are nobody's fault";
  EXPECT_EQ(initialisation_hint(camera, trails(camera, slide(0.01), 0.4, 0, 40), "").kind, HintKind::losing);

  hint = initialisation_hint(camera, trails(camera, slide(0.1), 0.4, 0, 10), "");
  EXPECT_EQ(hint.kind, HintKind::losing);
  EXPECT_NE(hint.text.find("texture"), std::string::npos);

  tracked.state = TrackingState::initialising;
  EXPECT_EQ(initialisation_hint(camera, tracked, "").kind, HintKind::working);
  for (const auto state : {TrackingState::tracking, TrackingState::lost}) {
    tracked.state = state;
    EXPECT_EQ(initialisation_hint(camera, tracked, "").kind, HintKind::none);
  }
}

TEST(ViewMemory, KeepsARefusalForSomeSeconds) {
  ViewMemory memory;
  TrackingResult tracked;
  const auto at = [&](double seconds, TrackingState state, const char* message) {
    tracked.time = std::chrono::duration_cast<Timestamp>(std::chrono::duration<double>(seconds));
    tracked.state = state;
    tracked.message = message;
    memory.update(tracked);
    return memory.message();
  };
  EXPECT_EQ(at(1, TrackingState::trailing, ""), "");
  EXPECT_EQ(at(2, TrackingState::trailing, "only turned"), "only turned");
  EXPECT_EQ(at(2 + ViewMemory::kMessage_s - 0.1, TrackingState::trailing, ""), "only turned");
  EXPECT_EQ(at(2 + ViewMemory::kMessage_s + 0.1, TrackingState::trailing, ""), "");
  EXPECT_EQ(at(20, TrackingState::trailing, "once more"), "once more");
  EXPECT_EQ(at(20.1, TrackingState::tracking, ""), "");
  EXPECT_EQ(at(20.2, TrackingState::trailing, ""), "") << "tracking has begun since";
}

TEST(ViewMemory, KnowsWhereTrackingWasLost) {
  ViewMemory memory;
  TrackingSnapshot map;
  map.map_version = 3;
  EXPECT_FALSE(memory.last_pose(map));
  TrackingResult tracked;
  tracked.state = TrackingState::tracking;
  tracked.map_version = 3;
  tracked.world_from_first = SimilarityTransform(2, exp_so3({0.1, 0, 0}), Vector3d(1, 0, 0));
  tracked.camera_from_world = look_at({0.1, -0.5, 0.4}, {0, 0, 0}).inverse();
  memory.update(tracked);
  tracked.state = TrackingState::lost;
  const RigidTransform known = *tracked.camera_from_world;
  tracked.camera_from_world.reset();
  memory.update(tracked);
  // The world has moved since: the same view of the same things.
  const SimilarityTransform change(0.5, exp_so3({0, 0.7, 0.2}), Vector3d(0, 0.3, 0));
  map.world_from_first = change * tracked.world_from_first;
  const auto pose = memory.last_pose(map);
  ASSERT_TRUE(pose);
  const Vector3d p(0.02, 0.03, 0.01);
  const Vector3d before = known * p, after = *pose * (change * p);
  EXPECT_LT((before.normalized() - after.normalized()).norm(), 1e-12);
  EXPECT_NEAR(after.norm() / before.norm(), 0.5, 1e-12);
  map.map_version = 4;
  EXPECT_FALSE(memory.last_pose(map));
}

TEST(ViewMemory, NearestKeyframeLooksTheSameWay) {
  TrackingSnapshot map;
  EXPECT_EQ(nearest_keyframe(map, {}), nullptr);
  const auto add = [&](const RigidTransform& world_from_camera) {
    SnapshotKeyframe kf;
    kf.id = {0, static_cast<int>(map.keyframes.size())};
    kf.camera_from_world = world_from_camera.inverse();
    kf.centre = world_from_camera.t;
    map.keyframes.push_back(kf);
  };
  add(look_at({0, -1, 1}, {0, 0, 0}));
  add(look_at({0.5, -1, 1}, {0.5, 0, 0}));
  add(look_at({0.5, -1, 1}, {0.5, -2, 0}));  // there, but looking back
  const auto* nearest = nearest_keyframe(map, look_at({0.45, -1, 1}, {0.45, -0.1, 0}).inverse());
  ASSERT_NE(nearest, nullptr);
  EXPECT_EQ(nearest->id.index, 1);
  EXPECT_TRUE(keyframe_picture(*nearest).empty()) << "it has no images";
}

}  // namespace
}  // namespace parallax
