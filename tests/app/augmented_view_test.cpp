#include "app/augmented_view.h"

#include <gtest/gtest.h>
#include <imgui.h>

#include <cmath>

#include "app/augmented_interface.h"
#include "app/content_drawing.h"
#include "app/level_colours.h"
#include "app/model_catalogue.h"
#include "core/check.h"
#include "map/hit_test.h"
#include "render/synthetic_path.h"
#include "tests/app/view_scene.h"

namespace parallax {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using testing::ViewScene;

bool same(const DrawColour& a, const DrawColour& b) { return a.r == b.r && a.g == b.g && a.b == b.b; }

class AugmentedView : public ::testing::Test {
 protected:
  AugmentedView() {
    input_.frame = &frame_;
    input_.tracked = &tracked_;
    input_.map = &map_;
    input_.content = &content_;
  }
  DrawList view() const { return augmented_view(scene_.camera(), input_, settings_); }

  // Made once; the map is each test's own.
  static ViewScene& scene() {
    static ViewScene made;
    return made;
  }

  ViewScene& scene_ = scene();
  TrackingSnapshot map_ = scene_.map();
  Frame frame_ = scene_.frame(75);
  TrackingResult tracked_ = scene_.tracked(75);
  Content content_;
  AugmentedInput input_;
  AugmentedSettings settings_;
};

TEST_F(AugmentedView, SharesTheImageAndTheCamera) {
  const DrawList list = view();
  EXPECT_EQ(list.background.data, frame_.colour.data) << "the image is not copied";
  EXPECT_TRUE(list.camera == scene_.camera());
  ASSERT_TRUE(list.camera_from_world);
  EXPECT_EQ(list.camera_from_world->t, tracked_.camera_from_world->t);
  frame_.colour.release();
  EXPECT_EQ(view().background.data, frame_.grey.data);
  input_.frame = nullptr;
  EXPECT_THROW(view(), CheckFailure);
}

TEST_F(AugmentedView, PointsLieWhereTheyWereFoundInTheirLevelsColour) {
  const DrawList list = view();
  std::size_t found = 0;
  for (const TrackedPoint& p : tracked_.points) {
    int discs = 0;
    for (const ScreenPoint& s : list.screen_points)
      if (s.px == p.pixel && same(s.colour, level_colour(p.level))) ++discs;
    EXPECT_EQ(discs, p.found ? 1 : 0);
    found += p.found;
  }
  EXPECT_GT(found, 100U);
  settings_.missed_points = true;
  std::size_t rings = 0;
  for (const ScreenPoint& s : view().screen_points) rings += s.ring;
  EXPECT_EQ(rings, tracked_.points.size() - found);
  settings_ = {};
  settings_.points = false;
  EXPECT_TRUE(view().screen_points.empty());
  tracked_.points = {{{NAN, 1}, 0, true}};
  settings_.points = true;
  EXPECT_TRUE(view().screen_points.empty());
}

TEST_F(AugmentedView, TheGridSaysWhetherTheCoarseStageRan) {
  map_.planes.push_back({RigidTransform(Eigen::Matrix3d::Identity(), Vector3d(0, 0, 0.1)), 0.1});
  DrawList list = view();
  ASSERT_EQ(list.grids.size(), 2U);
  EXPECT_EQ(list.grids[0].half_extent_m, map_.plane->extent_m);
  EXPECT_TRUE(same(list.grids[0].colour, grid_colour(true)));
  EXPECT_FALSE(same(grid_colour(true), grid_colour(false)));
  ASSERT_TRUE(list.shadow_plane);
  tracked_.coarse_stage = false;
  EXPECT_TRUE(same(view().grids[0].colour, grid_colour(false)));
  settings_.other_planes = false;
  EXPECT_EQ(view().grids.size(), 1U);
  settings_.grid = false;
  EXPECT_TRUE(view().grids.empty());
}

TEST_F(AugmentedView, ContentStandsOnTheMap) {
  content_.follow(4, SimilarityTransform(2, Eigen::Matrix3d::Identity(), Vector3d::Zero()));
  const int id = content_.add_model("cube", frame_on_surface({0.1, 0.05, 0}, {0, 0, 1}), 0.08);
  content_.follow(4, SimilarityTransform(4, Eigen::Matrix3d::Identity(), Vector3d::Zero()));
  content_.add_model("no such thing", {}, 0.1);
  content_.add_label("here", {0, 0, 0}, {0, 0, 1});
  content_.add_line({0, 0, 0}, {0.3, 0, 0});
  DrawList list = view();
  ASSERT_EQ(list.meshes.size(), 1U) << "a shape that nobody knows is left out";
  EXPECT_EQ(list.meshes[0].mesh, model_mesh("cube"));
  EXPECT_LT((list.meshes[0].world_from_model.translation() - Eigen::Vector3f(0.2F, 0.1F, 0)).norm(), 1e-6);
  EXPECT_NEAR(list.meshes[0].world_from_model.linear().col(0).norm(), 0.16, 1e-6) << "it has grown with the world";
  EXPECT_FALSE(list.world_lines.empty());
  EXPECT_EQ(list.meshes[0].emission, 0);
  input_.selected = id;
  EXPECT_GT(view().meshes[0].emission, 0);
  settings_.content = false;
  list = view();
  EXPECT_TRUE(list.meshes.empty() && list.world_lines.empty());
}

TEST_F(AugmentedView, LostIsDimmedAndShowsNothingOfTheWorld) {
  tracked_.state = TrackingState::lost;
  tracked_.camera_from_world.reset();
  content_.add_label("here", {0, 0, 0}, {0, 0, 1});
  const cv::Mat3b before = frame_.colour.clone();
  const DrawList list = view();
  EXPECT_FALSE(list.camera_from_world);
  EXPECT_TRUE(list.grids.empty() && list.world_lines.empty() && list.screen_points.empty());
  EXPECT_LT(cv::mean(list.background)[1], 0.5 * cv::mean(frame_.colour)[1]);
  EXPECT_EQ(cv::norm(before, frame_.colour, cv::NORM_INF), 0) << "the frame itself stays as it was";
  settings_.dim_when_lost = false;
  EXPECT_EQ(view().background.data, frame_.colour.data);
}

TEST_F(AugmentedView, TrailsGoFromFirstToPresent) {
  tracked_ = scene_.trailing(30, 60);
  input_.map = nullptr;
  const DrawList list = view();
  ASSERT_EQ(list.screen_lines.size(), tracked_.trails.size());
  ASSERT_GT(list.screen_lines.size(), 100U);
  EXPECT_EQ(list.screen_lines[7].a_px, tracked_.trails[7][0]);
  EXPECT_EQ(list.screen_lines[7].b_px, tracked_.trails[7][1]);
}

TEST_F(AugmentedView, TheAimLiesOnThePlaneUnderThePointer) {
  const std::size_t before = view().world_lines.size();
  Vector2d px;
  ASSERT_TRUE(scene_.camera().project(*tracked_.camera_from_world * Vector3d(0.1, 0.05, 0), &px));
  map_.id.clear();  // no points: only the plane is hit
  map_.position.clear();
  input_.cursor_px = px;
  const DrawList list = view();
  ASSERT_GT(list.world_lines.size(), before + 10);
  Eigen::Vector3f middle = Eigen::Vector3f::Zero();
  int n = 0;
  for (const WorldLine& l : list.world_lines) {
    if (std::abs(l.a.z()) > 0.001F || std::abs(l.b.z()) > 0.001F) continue;  // the normal's tick
    middle += l.a;
    ++n;
  }
  EXPECT_LT((middle / static_cast<float>(n) - Eigen::Vector3f(0.1F, 0.05F, 0)).norm(), 1e-3);
  settings_.crosshair = true;
  EXPECT_EQ(view().screen_lines.size(), 8U);
}

// PTAM Fig. 6: what is placed once is registered from 25 cm and from 2 m.
TEST_F(AugmentedView, ALabelPlacedUnderThePointerStaysThereFromNearAndFar) {
  const CameraModel& camera = scene_.camera();
  const cv::Mat1f depth = scene_.depth(75);
  map_.id.clear();
  map_.position.clear();
  int placed = 0;
  for (int y = 130; y < 230; y += 20) {
    for (int x = 60; x < 260; x += 20) {
      // What the pixel truly shows; only the bare table is on the plane.
      Vector3d ray;
      ASSERT_TRUE(camera.unproject({1.0 * x, 1.0 * y}, &ray));
      const Vector3d truth = tracked_.camera_from_world->inverse() * (static_cast<double>(depth(y, x)) * ray);
      const auto hit = hit_test(camera, *tracked_.camera_from_world, {1.0 * x, 1.0 * y}, map_);
      if (!hit || std::abs(truth.z()) > 1e-4) continue;
      content_.clear();
      content_.add_label("here", hit->position, hit->normal);
      ++placed;
      for (const double distance : {0.25, 2.0}) {
        tracked_.camera_from_world = look_at(truth + distance * Vector3d(0.3, -0.6, 0.74), truth, 0.2).inverse();
        const DrawList list = view();
        ASSERT_EQ(list.world_points.size(), 1U);
        Vector2d drawn, right;
        ASSERT_TRUE(camera.project(*list.camera_from_world * list.world_points[0].position.cast<double>(), &drawn));
        ASSERT_TRUE(camera.project(*tracked_.camera_from_world * truth, &right));
        EXPECT_LT((drawn - right).norm(), 0.1) << x << ", " << y << " from " << distance << " m";
      }
      tracked_ = scene_.tracked(75);
    }
  }
  EXPECT_GT(placed, 5);
}

TEST(ModelCatalogue, ModelsStandOnTheirOrigin) {
  ASSERT_GE(model_names().size(), 6U);
  for (const std::string& name : model_names()) {
    const auto mesh = model_mesh(name);
    ASSERT_NE(mesh, nullptr) << name;
    EXPECT_EQ(mesh, model_mesh(name)) << "made once";
    Eigen::AlignedBox3f box;
    for (const MeshVertex& v : mesh->vertices) {
      box.extend(v.position);
      EXPECT_NEAR(v.normal.norm(), 1, 1e-3) << name;
    }
    EXPECT_GT(box.min().z(), -0.07F) << name;  // arrow heads have a radius
    EXPECT_LT(box.min().z(), 0.03F) << name;
    EXPECT_NEAR(box.sizes().maxCoeff(), 1, 0.1) << name;
    ASSERT_EQ(mesh->indices.size() % 3, 0U);
    for (const std::uint32_t i : mesh->indices) ASSERT_LT(i, mesh->vertices.size());
  }
  EXPECT_EQ(model_mesh("no such thing"), nullptr);
}

TEST(StateLine, SaysWhatIsKnown) {
  TrackingResult tracked;
  EXPECT_EQ(state_line(tracked, {}, false), "waiting");
  tracked.state = TrackingState::tracking;
  tracked.quality = TrackingQuality::poor;
  tracked.camera_from_world = RigidTransform();
  tracked.found = {100, 50, 20, 7};
  tracked.attempted = {120, 60, 30, 10};
  tracked.map_keyframes = 4;
  tracked.map_points = 900;
  tracked.times.total = 3.14F;
  EXPECT_EQ(state_line(tracked, 29.7), "poor  177/220 found  4 keyframes  900 points  30 fps  3.1 ms");
  EXPECT_EQ(state_line(tracked, {}, false), "poor  177/220 found  4 keyframes  900 points");
}

TEST(PictureArea, PixelsAndBack) {
  const CameraModel camera(CameraModelKind::pinhole, 640, 480, {500, 500}, {319.5, 239.5});
  const PictureArea area{100, 50, 1280, 960};
  EXPECT_LT((area.from_pixel(camera, {-0.5, -0.5}) - Eigen::Vector2f(100, 50)).norm(), 1e-4);
  EXPECT_LT((area.from_pixel(camera, {639.5, 479.5}) - Eigen::Vector2f(1380, 1010)).norm(), 1e-3);
  EXPECT_LT((area.to_pixel(camera, area.from_pixel(camera, {123.25, 77})) - Vector2d(123.25, 77)).norm(), 1e-3);
}

// What the interface draws, without a renderer: the box of all its vertices, by draw command.
TEST(AugmentedInterface, StaysInsideThePictureAndMovesWithWhatItNames) {
  ViewScene scene;
  const TrackingResult tracked = scene.tracked(75);
  Content content;
  content.follow(scene.map());
  content.add_label("a label with a rather long text that would not fit on the right of the picture", {0.1, 0.05, 0},
                    {0, 0, 1});
  HeadlessInterface interface(640, 480);
  AugmentedInterface view;
  view.camera = &scene.camera();
  view.area = {40, 30, 560, 420};
  view.tracked = &tracked;
  view.content = &content;
  view.remark = "estimated lens";
  view.banner = "camera disconnected";
  view.message = "a message";
  int vertices = 0;
  const auto before = ImGui::GetCurrentContext();
  for (int round = 0; round < 2; ++round) {
    interface.frame([&] { draw_augmented_interface(view); },
                    [&](const ImDrawData& data) {
                      vertices = data.TotalVtxCount;
                      for (int i = 0; i < data.CmdListsCount; ++i)
                        for (const ImDrawCmd& command : data.CmdLists[i]->CmdBuffer) {
                          if (command.ElemCount == 0) continue;
                          EXPECT_GE(command.ClipRect.x, 40);
                          EXPECT_GE(command.ClipRect.y, 30);
                          EXPECT_LE(command.ClipRect.z, 600);
                          EXPECT_LE(command.ClipRect.w, 450);
                        }
                    });
  }
  EXPECT_GT(vertices, 200);
  EXPECT_EQ(ImGui::GetCurrentContext(), before) << "the context is put back";

  // The label's box is over the projection of its anchor.
  view.state_line = view.hint = false;
  view.banner.clear();
  view.area = {0, 0, 640, 480};
  content.rename(1, "cup");
  Vector2d px;
  ASSERT_TRUE(scene.camera().project(*tracked.camera_from_world * label_anchor(*content.find(1)), &px));
  const Eigen::Vector2f at = view.area.from_pixel(scene.camera(), px);
  interface.frame([&] { draw_augmented_interface(view); },
                  [&](const ImDrawData& data) {
                    float left = 1e9F, right = -1e9F, bottom = -1e9F;
                    for (int i = 0; i < data.CmdListsCount; ++i)
                      for (const ImDrawVert& v : data.CmdLists[i]->VtxBuffer) {
                        left = std::min(left, v.pos.x);
                        right = std::max(right, v.pos.x);
                        bottom = std::max(bottom, v.pos.y);
                      }
                    EXPECT_NEAR((left + right) / 2, at.x(), 1.5);
                    EXPECT_LE(bottom, at.y());
                    EXPECT_GT(bottom, at.y() - 10);
                  });
}

}  // namespace
}  // namespace parallax
