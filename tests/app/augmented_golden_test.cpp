// The views as they look, held against pictures that were looked at.
#include <gtest/gtest.h>

#include <optional>

#include "app/map_view.h"
#include "app/offscreen_view.h"
#include "core/error.h"
#include "tests/app/view_scene.h"
#include "tests/render/golden.h"

namespace parallax {
namespace {

using testing::matches_golden;
using testing::ViewScene;

class AugmentedGolden : public ::testing::Test {
 protected:
  void SetUp() override {
    try {
      view_.emplace(scene().camera());
    } catch (const RunError& error) {
      GTEST_SKIP() << error.what();
    }
  }
  static ViewScene& scene() {
    static ViewScene made(480);
    return made;
  }
  // Soft, so that the pictures are small and what is drawn stands out.
  static Frame soft(int index) {
    Frame frame = scene().frame(index);
    cv::GaussianBlur(frame.colour, frame.colour, {}, 4);
    frame.colour.convertTo(frame.colour, -1, 1.0 / 16);
    frame.colour.convertTo(frame.colour, -1, 16);
    return frame;
  }

  TrackingSnapshot map_ = scene().map();
  std::optional<OffscreenView> view_;
};

Content things(const TrackingSnapshot& map) {
  Content out;
  out.follow(map);
  out.add_label("coffee cup", {-0.15, 0.1, 0}, {0, 0, 1});
  out.add_model("house", frame_on_surface({0.1, -0.02, 0}, {0, 0, 1}, {1, 0.4, 0}), 0.09);
  out.add_model("ball", frame_on_surface({0.05, -0.2, 0}, {0, 0, 1}), 0.06);
  out.add_line({-0.15, -0.02, 0}, {0.02, 0.08, 0}, "ruler");
  return out;
}

TEST_F(AugmentedGolden, Tracking) {
  const Content content = things(map_);
  EXPECT_TRUE(matches_golden("augmented_tracking", view_->draw(soft(75), scene().tracked(75), &map_, &content)));
}

// The coarse stage was off; rings for what was not found; the aim; a second plane.
TEST_F(AugmentedGolden, FineStageOnly) {
  TrackingResult tracked = scene().tracked(120);
  tracked.coarse_stage = false;
  tracked.quality = TrackingQuality::poor;
  map_.planes.push_back({RigidTransform(exp_so3({M_PI / 2, 0, 0}), {0, 0.3, 0.15}), 0.12});
  view_->settings.missed_points = true;
  view_->settings.crosshair = true;
  EXPECT_TRUE(matches_golden("augmented_fine_only", view_->draw(soft(120), tracked, &map_, nullptr, "estimated lens")));
}

TEST_F(AugmentedGolden, Trails) {
  EXPECT_TRUE(matches_golden("augmented_trails", view_->draw(soft(52), scene().trailing(30, 52), nullptr)));
}

TEST_F(AugmentedGolden, ReadyForTheSecondKey) {
  EXPECT_TRUE(matches_golden("augmented_ready", view_->draw(soft(70), scene().trailing(30, 70), nullptr)));
}

TEST_F(AugmentedGolden, Refused) {
  TrackingResult tracked = scene().trailing(30, 33);
  tracked.message = "The camera hardly moved: move it further sideways, about a tenth of its distance from the scene.";
  EXPECT_TRUE(matches_golden("augmented_refused", view_->draw(soft(33), tracked, nullptr)));
}

TEST_F(AugmentedGolden, Waiting) {
  TrackingResult tracked;
  tracked.message = "press Space, then slide the camera sideways";
  EXPECT_TRUE(matches_golden("augmented_waiting", view_->draw(soft(10), tracked, nullptr)));
}

TEST_F(AugmentedGolden, Lost) {
  view_->draw(soft(200), scene().tracked(200), &map_);
  TrackingResult tracked = scene().tracked(260);
  tracked.state = TrackingState::lost;
  tracked.quality = TrackingQuality::lost;
  tracked.camera_from_world.reset();
  tracked.points.clear();
  tracked.found = {};
  tracked.attempted = {};
  EXPECT_TRUE(matches_golden("augmented_lost", view_->draw(soft(260), tracked, &map_)));
}

TEST_F(AugmentedGolden, MapView) {
  CameraPath path;
  for (int i = 30; i < 200; ++i) {
    TrackingResult tracked;
    tracked.camera_from_world = scene().pose(i);
    path.add(tracked);
  }
  const TrackingResult tracked = scene().tracked(200);
  const Content content = things(map_);
  MapViewInput input;
  input.map = &map_;
  input.tracked = &tracked;
  input.camera = &scene().camera();
  input.path = &path;
  input.content = &content;
  input.selected = map_.keyframes[1].id;
  OffscreenContext context(480, 360);
  SceneRenderer renderer;
  renderer.draw(map_view(input, fit_to_map(map_, {}), 480, 360), {0, 0, 480, 360});
  EXPECT_TRUE(matches_golden("map_view", read_framebuffer(480, 360)));
}

}  // namespace
}  // namespace parallax
