// Each kind of thing that is drawn, as a picture that has been looked at.
#include <gtest/gtest.h>
#include <imgui.h>

#include "render/imgui_fonts.h"
#include "render/mesh_shapes.h"
#include "tests/render/golden.h"
#include "tests/render/offscreen_scene.h"

namespace parallax {
namespace {

using testing::matches_golden;
using testing::OffscreenScene;

class GoldenScene : public ::testing::Test {
 protected:
  static constexpr int kWidth = 320, kHeight = 240;
  GoldenScene() : scene_(kWidth, kHeight) {
    list_.camera = CameraModel(CameraModelKind::fov, kWidth, kHeight, {187, 188}, {161, 118}, {0.9}, 1);
    // A wooden table in even light.
    cv::Mat3b table(kHeight, kWidth);
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x)
        table(y, x) = cv::Vec3b(static_cast<unsigned char>(95 + (x * 7 + y / 2) % 11 + y / 16),
                                static_cast<unsigned char>(130 + (x * 7 + y / 2) % 11 + y / 16),
                                static_cast<unsigned char>(165 + (x * 7 + y / 2) % 11 + y / 16));
    list_.background = table;
    list_.camera_from_world = testing::look_at({0.05, -0.33, 0.3}, {0, 0, 0.01});
    list_.shadow_plane = RigidTransform();
  }

  void add(std::shared_ptr<const Mesh> mesh, const Eigen::Vector3f& place, const DrawColour& tint) {
    MeshInstance instance;
    instance.mesh = std::move(mesh);
    instance.world_from_model.translation() = place;
    instance.tint = tint;
    list_.meshes.push_back(instance);
  }
  void add_things() {
    add(box_mesh({0.06f, 0.06f, 0.06f}), {-0.11f, 0, 0.03f}, {0.9f, 0.25f, 0.2f, 1});
    add(sphere_mesh(0.035f), {0, 0.02f, 0.035f}, {0.25f, 0.45f, 0.9f, 1});
    add(cylinder_mesh(0.025f, 0.07f), {0.11f, 0, 0}, {0.95f, 0.8f, 0.25f, 1});
    add(cone_mesh(0.03f, 0.07f), {0.06f, 0.12f, 0}, {0.3f, 0.8f, 0.35f, 1});
    add(arrow_mesh(0.1f, 0.01f), {-0.07f, 0.12f, 0}, {0.8f, 0.35f, 0.85f, 1});
    add(torus_mesh(0.03f, 0.01f), {-0.02f, -0.1f, 0.05f}, {0.95f, 0.95f, 0.95f, 0.6f});
    add(pin_mesh(0.07f), {0.11f, -0.11f, 0}, {0.9f, 0.4f, 0.1f, 1});
  }

  OffscreenScene scene_;
  DrawList list_;
};

TEST_F(GoldenScene, MeshesWithShadows) {
  add_things();
  EXPECT_TRUE(matches_golden("meshes", scene_.draw(list_)));
}

TEST_F(GoldenScene, MeshesInADimWarmRoom) {
  add_things();
  list_.background = cv::Mat(list_.background) * 0.45;
  list_.ambient_light = Eigen::Vector3f(0.24f, 0.17f, 0.11f);
  EXPECT_TRUE(matches_golden("meshes_dim", scene_.draw(list_)));
}

TEST_F(GoldenScene, TexturedLabelAxesAndFrustum) {
  cv::Mat4b texture(32, 64, cv::Vec4b(250, 245, 225, 255));
  for (int y = 0; y < 32; ++y)
    for (int x = 0; x < 64; ++x)
      if ((x / 8 + y / 8) % 2 == 0) texture(y, x) = cv::Vec4b(200, 60, 40, 255);
  texture(cv::Rect(24, 8, 16, 16)).setTo(cv::Vec4b(0, 0, 0, 0));
  add(quad_mesh(0.16f, 0.08f, texture), {-0.1f, -0.03f, 0.0f}, {});
  add(axes_mesh(0.08f), {0.02f, 0.03f, 0}, {});
  add(frustum_mesh(0.04f, 0.03f, 0.05f), {0.12f, 0.05f, 0.03f}, {0.2f, 0.7f, 1, 0.5f});
  add(disc_mesh(0.03f), {0.12f, -0.08f, 0.001f}, {0.1f, 0.1f, 0.1f, 0.8f});
  EXPECT_TRUE(matches_golden("label", scene_.draw(list_)));
}

TEST_F(GoldenScene, GridAndLines) {
  auto& grid = list_.grids.emplace_back();
  grid.colour = {0.2f, 1, 0.3f, 0.8f};
  list_.world_lines.push_back({{-0.2f, 0.21f, 0}, {0.2f, 0.21f, 0}, {1, 0.9f, 0, 1}, 4});
  for (int i = 0; i < 12; ++i) {
    const float a = 0.5f * static_cast<float>(i);
    list_.world_lines.push_back({{0, 0, 0},
                                 {0.15f * std::cos(a), 0.15f * std::sin(a), 0.05f},
                                 {1, 1, 1, 0.7f},
                                 0.5f + 0.25f * static_cast<float>(i)});
  }
  EXPECT_TRUE(matches_golden("grid", scene_.draw(list_)));
}

TEST_F(GoldenScene, Points) {
  for (int i = 0; i < 300; ++i) {
    const float x = -0.2f + 0.02f * static_cast<float>(i % 20), y = -0.15f + 0.02f * static_cast<float>(i / 20);
    list_.world_points.push_back({{x, y, 0.02f * std::sin(30 * x) * std::cos(25 * y)},
                                  {x * 2.5f + 0.5f, 0.8f, 0.5f - 2.5f * y, 1},
                                  2 + static_cast<float>(i % 5)});
  }
  EXPECT_TRUE(matches_golden("points", scene_.draw(list_)));
}

TEST_F(GoldenScene, ScreenItems) {
  list_.camera_from_world.reset();
  for (int i = 0; i < 16; ++i) {
    const float x = 10 + 20 * static_cast<float>(i);
    list_.screen_lines.push_back(
        {{x, 20}, {x + 15, 60.0f + static_cast<float>(i)}, {1, 1, 0.2f, 1}, 1 + 0.2f * static_cast<float>(i)});
    list_.screen_points.push_back({{x, 110}, {1, 0.3f, 0.2f, 1}, 2 + static_cast<float>(i), false});
    list_.screen_points.push_back({{x, 160}, {0.2f, 0.9f, 1, 1}, 4 + static_cast<float>(i), true});
    list_.screen_points.push_back({{x, 210}, {0, 0, 0, 0.15f + 0.05f * static_cast<float>(i)}, 14, false});
  }
  EXPECT_TRUE(matches_golden("screen", scene_.draw(list_)));
}

TEST_F(GoldenScene, Interface) {
  ImGuiContext* context = ImGui::CreateContext();
  ImGui::GetIO().IniFilename = nullptr;
  ImGui::GetIO().DisplaySize = {kWidth, kHeight};
  ImGui::GetIO().Fonts->AddFontDefault();  // the same everywhere
  ImGui::GetIO().Fonts->Build();
  scene_.draw(list_);
  cv::Mat3b picture(60, 80, cv::Vec3b(0, 200, 255));
  picture(cv::Rect(0, 0, 40, 30)).setTo(cv::Scalar(255, 0, 0));
  for (int frame = 0; frame < 2; ++frame) {
    ImGui::NewFrame();
    ImGui::SetNextWindowPos({20, 20});
    ImGui::SetNextWindowSize({220, 170});
    ImGui::Begin("Map");
    ImGui::TextUnformatted("tracking: good");
    ImGui::ProgressBar(0.6f);
    ImGui::Image(scene_.renderer().picture(7, picture), {80, 60});
    ImGui::Button("Reset");
    ImGui::End();
    ImGui::Render();
  }
  scene_.renderer().draw_interface(*ImGui::GetDrawData(), kWidth, kHeight);
  const cv::Mat3b image = read_framebuffer(kWidth, kHeight);
  ImGui::DestroyContext(context);
  EXPECT_TRUE(matches_golden("interface", image));
}

}  // namespace
}  // namespace parallax
