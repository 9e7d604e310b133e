// The renderer: what covers what, light, shadows, the camera's image under it all.
#include "render/scene_renderer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <thread>

#include "core/check.h"
#include "core/error.h"
#include "render/mesh_shapes.h"
#include "tests/render/offscreen_scene.h"

namespace parallax {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using testing::empty_list;
using testing::OffscreenScene;

const CameraModel kNarrowLens(CameraModelKind::pinhole, 320, 240, {250, 250}, {159.5, 119.5});
const CameraModel kWideLens(CameraModelKind::fov, 320, 240, {180, 181}, {158, 121}, {0.9}, 1);

cv::Mat3b noise_image(int width, int height) {
  cv::Mat3b image(height, width);
  cv::RNG random(3);
  random.fill(image, cv::RNG::UNIFORM, 0, 256);
  return image;
}

MeshInstance instance_of(std::shared_ptr<const Mesh> mesh, float x, float y, float z, const DrawColour& tint = {},
                         float emission = 1) {
  MeshInstance out;
  out.mesh = std::move(mesh);
  out.world_from_model.translation() = Eigen::Vector3f(x, y, z);
  out.tint = tint;
  out.emission = emission;
  return out;
}

bool identical(const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b, cv::NORM_INF) == 0; }

// A camera above the plane z = 0 of the world, which is what shadows fall on.
DrawList table_list(const CameraModel& camera) {
  DrawList list = empty_list(camera);
  list.background = cv::Mat3b(camera.height(), camera.width(), cv::Vec3b(180, 180, 180));
  list.camera_from_world = testing::look_at({0, -0.3, 0.4}, {0, 0, 0});
  list.shadow_plane = RigidTransform();
  return list;
}

cv::Vec3b at(const cv::Mat3b& image, const DrawList& list, const Vector3d& world) {
  Vector2d px;
  EXPECT_TRUE(list.camera.project(*list.camera_from_world * world, &px));
  return image(static_cast<int>(std::lround(px.y())), static_cast<int>(std::lround(px.x())));
}

TEST(SceneRenderer, LeavesTheImageAloneWhereNothingIsDrawn) {
  OffscreenScene scene(320, 240);
  DrawList list = empty_list(kWideLens);
  const cv::Mat3b image = noise_image(320, 240);
  list.background = image;
  EXPECT_TRUE(identical(scene.draw(list), image));
  list.meshes.push_back(instance_of(sphere_mesh(0.1f), 0, 0, 1));
  const cv::Mat3b drawn = scene.draw(list);
  EXPECT_FALSE(identical(drawn, image));
  Vector2d centre;
  ASSERT_TRUE(kWideLens.project({0, 0, 1}, &centre));
  int changed = 0;
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 320; ++x) {
      const bool far = (Vector2d(x, y) - centre).norm() > 0.1 * 270 / 1.3 + 3;
      if (far) {
        ASSERT_EQ(drawn(y, x), image(y, x)) << x << " " << y;
      } else {
        changed += drawn(y, x) != image(y, x);
      }
    }
  }
  EXPECT_GT(changed, 500);
}

TEST(SceneRenderer, ShowsGreyImagesAndPartsOfLargerOnes) {
  OffscreenScene scene(320, 240);
  DrawList list = empty_list(kNarrowLens);
  cv::Mat1b grey;
  cv::cvtColor(noise_image(330, 260), grey, cv::COLOR_BGR2GRAY);
  list.background = grey(cv::Rect(5, 7, 320, 240));  // rows that do not follow each other in memory
  cv::Mat3b expected;
  cv::cvtColor(list.background, expected, cv::COLOR_GRAY2BGR);
  EXPECT_TRUE(identical(scene.draw(list), expected));
}

TEST(SceneRenderer, KeepsToItsViewport) {
  OffscreenScene scene(400, 300);
  DrawList list = empty_list(kNarrowLens);
  list.background_colour = {1, 0, 0, 1};
  scene.draw(list);
  DrawList inner = empty_list(kNarrowLens);
  inner.background = noise_image(320, 240);
  inner.screen_lines.push_back({{-50, 100}, {400, 130}, {1, 1, 1, 1}, 9});
  const cv::Mat3b image = scene.draw(inner, {40, 20, 320, 240});
  cv::Mat3b outside = image.clone();
  outside(cv::Rect(40, 40, 320, 240)).setTo(cv::Scalar(0, 0, 255));  // 20 from the bottom is 40 from the top
  EXPECT_TRUE(identical(outside, cv::Mat3b(300, 400, cv::Vec3b(0, 0, 255))));
  EXPECT_EQ(image(40, 40), inner.background.at<cv::Vec3b>(0, 0));
  EXPECT_EQ(image(279, 359), inner.background.at<cv::Vec3b>(239, 319));
}

TEST(SceneRenderer, FitsTheImageIntoTheWindow) {
  const auto expect = [](const Viewport& v, int x, int y, int width, int height) {
    EXPECT_EQ(std::vector<int>({v.x, v.y, v.width, v.height}), std::vector<int>({x, y, width, height}));
  };
  expect(fit_viewport(640, 480, 640, 480), 0, 0, 640, 480);
  expect(fit_viewport(640, 480, 1920, 1080), 240, 0, 1440, 1080);
  expect(fit_viewport(1280, 720, 640, 480), 0, 60, 640, 360);
  expect(fit_viewport(640, 480, 0, 0), 0, 0, 0, 0);
}

TEST(SceneRenderer, NearThingsHideFarOnes) {
  OffscreenScene scene(320, 240);
  DrawList list = empty_list(kNarrowLens);
  // The far one is drawn last.
  list.meshes.push_back(instance_of(box_mesh({0.1f, 0.1f, 0.1f}), 0, 0, 1, {1, 0, 0, 1}));
  list.meshes.push_back(instance_of(box_mesh({0.6f, 0.6f, 0.1f}), 0, 0, 2, {0, 1, 0, 1}));
  list.world_lines.push_back({{-1, 0, 1.5f}, {1, 0, 1.5f}, {0, 0, 1, 1}, 5});
  list.world_points.push_back({{0, 0.02f, 1.5f}, {0, 0, 1, 1}, 5});
  const cv::Mat3b image = scene.draw(list);
  EXPECT_EQ(image(119, 159), cv::Vec3b(0, 0, 255)) << "the near box hides box, line and point";
  EXPECT_EQ(image(124, 159), cv::Vec3b(0, 0, 255));
  EXPECT_EQ(image(119, 180), cv::Vec3b(255, 0, 0)) << "the line lies before the far box";
  EXPECT_EQ(image(100, 175), cv::Vec3b(0, 255, 0));
}

TEST(SceneRenderer, DrawsNothingBehindTheCamera) {
  for (const CameraModel& camera : {kNarrowLens, kWideLens}) {
    OffscreenScene scene(320, 240);
    DrawList list = empty_list(camera);
    list.meshes.push_back(instance_of(box_mesh({0.5f, 0.5f, 0.5f}), 0, 0, -2));
    list.world_lines.push_back({{-1, 0, -1}, {1, 0, -0.5f}, {1, 1, 1, 1}, 3});
    list.world_points.push_back({{0, 0, -1}, {1, 1, 1, 1}, 9});
    EXPECT_TRUE(identical(scene.draw(list), cv::Mat3b::zeros(240, 320)));
  }
}

TEST(SceneRenderer, WithoutAPoseOnlyTheScreenIsDrawn) {
  OffscreenScene scene(320, 240);
  DrawList list = empty_list(kNarrowLens);
  list.camera_from_world.reset();
  list.meshes.push_back(instance_of(box_mesh({0.5f, 0.5f, 0.5f}), 0, 0, 1));
  list.world_points.push_back({{0, 0, 1}, {1, 1, 1, 1}, 9});
  list.grids.emplace_back().world_from_plane.t.z() = 1;
  EXPECT_TRUE(identical(scene.draw(list), cv::Mat3b::zeros(240, 320)));
  list.screen_points.push_back({{100, 50}, {1, 1, 1, 1}, 9});
  EXPECT_EQ(scene.draw(list)(50, 100), cv::Vec3b(255, 255, 255));
}

TEST(SceneRenderer, WithoutACameraTheScreenIsTheBackgrounds) {
  OffscreenScene scene(320, 240);
  DrawList list = empty_list(CameraModel());
  list.background = cv::Mat3b::zeros(120, 160);
  list.world_points.push_back({{0, 0, 1}, {1, 1, 1, 1}, 9});
  list.screen_points.push_back({{100, 50}, {1, 1, 1, 1}, 5});
  const auto found = testing::centroid(scene.draw(list), {200.5, 100.5}, 12);
  ASSERT_TRUE(found);
  EXPECT_LT((*found - Vector2d(200.5, 100.5)).norm(), 0.05);
}

TEST(SceneRenderer, BlendsInLinearLight) {
  OffscreenScene scene(320, 240);
  DrawList list = empty_list(kNarrowLens);
  // Half of white over black is 188 in sRGB; blending encoded values would give 128.
  list.meshes.push_back(instance_of(quad_mesh(10, 10), 0, 0, 1, {1, 1, 1, 0.5f}));
  EXPECT_NEAR(scene.draw(list)(100, 100)[1], 188, 1);
  list.meshes.clear();
  list.screen_lines.push_back({{0, 100}, {320, 100}, {1, 1, 1, 0.5f}, 9});
  EXPECT_NEAR(scene.draw(list)(100, 100)[1], 188, 1);
  list.screen_lines = {{{0, 100}, {320, 100}, {0, 0.5f, 1, 1}, 9}};
  EXPECT_NEAR(scene.draw(list)(100, 100)[1], 128, 1) << "colours come out as they were given";
}

TEST(SceneRenderer, SeeThroughThingsLieOverWhatIsBehindWhateverTheirOrder) {
  OffscreenScene scene(320, 240);
  cv::Mat3b pictures[2];
  for (int order = 0; order < 2; ++order) {
    DrawList list = empty_list(kNarrowLens);
    const auto near = instance_of(quad_mesh(0.4f, 0.4f), 0, 0, 1, {1, 0, 0, 0.5f});
    const auto far = instance_of(quad_mesh(0.8f, 0.8f), 0, 0, 1.2f, {0, 0, 1, 0.5f});
    const auto solid = instance_of(quad_mesh(2, 2), 0, 0, 2, {0, 1, 0, 1});
    list.meshes = order == 0 ? std::vector{near, far, solid} : std::vector{solid, far, near};
    pictures[order] = scene.draw(list);
  }
  EXPECT_TRUE(identical(pictures[0], pictures[1]));
  const cv::Vec3b middle = pictures[0](120, 160);
  EXPECT_GT(middle[2], middle[0]) << "more of the near one";
  EXPECT_GT(middle[1], 100) << "the solid one shows through both";
}

TEST(SceneRenderer, IsLitByTheScenesLight) {
  OffscreenScene scene(320, 240);
  DrawList list = table_list(kNarrowLens);
  list.meshes.push_back(instance_of(box_mesh({0.1f, 0.1f, 0.1f}), 0, 0, 0.05f, {0.8f, 0.8f, 0.8f, 1}, 0));
  const Vector3d top(0, 0, 0.1), front(0, -0.05, 0.05);
  const cv::Mat3b bright = scene.draw(list);
  EXPECT_GT(at(bright, list, top)[1], at(bright, list, front)[1] + 30) << "light comes from above";
  EXPECT_NEAR(at(bright, list, top)[1], 204, 20) << "a surface that faces the light shows about its own colour";
  list.ambient_light = Eigen::Vector3f(0.1f, 0.1f, 0.1f);
  const cv::Mat3b dark = scene.draw(list);
  EXPECT_NEAR(testing::linear_light(at(dark, list, top)[1]), 0.1 * testing::linear_light(at(bright, list, top)[1]),
              0.01);
  list.ambient_light = Eigen::Vector3f(0.9f, 0.5f, 0.3f);
  const cv::Vec3b warm = at(scene.draw(list), list, top);
  EXPECT_GT(warm[2], warm[1] + 20);
  EXPECT_GT(warm[1], warm[0] + 20);
  list.meshes[0].emission = 1;
  EXPECT_EQ(at(scene.draw(list), list, top), cv::Vec3b(204, 204, 204)) << "what gives off light needs none";
}

TEST(SceneRenderer, CastsSoftContactShadows) {
  OffscreenScene scene(320, 240);
  DrawList list = table_list(kNarrowLens);
  list.meshes.push_back(instance_of(box_mesh({0.08f, 0.08f, 0.08f}), 0, 0, 0.04f));
  const auto row = [&](const cv::Mat3b& image) {
    std::vector<int> out;
    for (const double x : {0.05, 0.06, 0.075, 0.10, 0.2}) out.push_back(at(image, list, {x, 0, 0})[1]);
    return out;
  };
  const auto touching = row(scene.draw(list));
  EXPECT_LT(touching[0], 155) << "dark where it stands";
  for (std::size_t i = 1; i < touching.size(); ++i) EXPECT_GT(touching[i], touching[i - 1]);
  EXPECT_EQ(touching.back(), 180) << "none far away";
  // Lifted, it is fainter at its foot and softer.
  list.meshes[0].world_from_model.translation().z() = 0.12f;
  const auto lifted = row(scene.draw(list));
  EXPECT_GT(lifted[0], touching[0] + 10);
  EXPECT_LT(lifted[3] - lifted[0], touching[3] - touching[0]);
  // Moved and turned on the plane, the same shadow goes with it.
  list.meshes[0].world_from_model = Eigen::Translation3f(0.03f, 0.02f, 0.04f) *
                                    Eigen::AngleAxisf(0.5f * std::numbers::pi_v<float>, Eigen::Vector3f::UnitZ());
  EXPECT_NEAR(at(scene.draw(list), list, {0.03 + 0.06, 0.02, 0})[1], touching[1], 6);
  // Asked not to, or without a plane, there is none.
  list.meshes[0].casts_shadow = false;
  EXPECT_EQ(at(scene.draw(list), list, {0.09, 0.02, 0})[1], 180);
  list.meshes[0].casts_shadow = true;
  list.shadow_plane.reset();
  EXPECT_EQ(at(scene.draw(list), list, {0.09, 0.02, 0})[1], 180);
}

TEST(SceneRenderer, SmoothsEdges) {
  OffscreenScene smooth(320, 240), hard(320, 240, {1});
  DrawList list = empty_list(kNarrowLens);
  MeshInstance tilted = instance_of(quad_mesh(0.5f, 0.5f), 0, 0, 1);
  tilted.world_from_model = Eigen::Translation3f(0, 0, 1) * Eigen::AngleAxisf(0.2f, Eigen::Vector3f::UnitZ());
  list.meshes.push_back(tilted);
  const auto levels_between = [](const cv::Mat3b& image) {
    int count = 0;
    for (const cv::Vec3b& px : image) count += px[1] > 20 && px[1] < 235;
    return count;
  };
  EXPECT_GT(levels_between(smooth.draw(list)), 150);
  hard.draw(list);  // both contexts stay usable
  list.meshes.clear();
  list.screen_lines.push_back({{20, 30}, {300, 90}, {1, 1, 1, 1}, 1.5f});
  EXPECT_GT(levels_between(hard.draw(list)), 250) << "lines are smooth without several samples";
}

TEST(SceneRenderer, LinesAreAsWideAsAsked) {
  OffscreenScene scene(320, 240);
  for (const float width : {0.6f, 1.0f, 2.0f, 5.0f}) {
    DrawList list = empty_list(kNarrowLens);
    list.screen_lines.push_back({{10, 100.3f}, {310, 131.7f}, {1, 1, 1, 1}, width});
    const cv::Mat3b image = scene.draw(list);
    double light = 0;
    for (int x = 100; x < 200; ++x)
      for (int y = 0; y < 240; ++y) light += testing::linear_light(image(y, x)[1]);
    const double slope = 31.4 / 300;
    EXPECT_NEAR(light / 100, width * std::hypot(1, slope), 0.06 * width + 0.02) << width;
  }
}

TEST(SceneRenderer, UpdatesAndForgetsMeshes) {
  OffscreenScene scene(320, 240);
  for (int frame = 0; frame < 20; ++frame) {
    // A new mesh every frame, most likely where the last one was in memory.
    DrawList list = empty_list(kNarrowLens);
    const float level = frame % 2 ? 1.0f : 0.0f;
    list.meshes.push_back(
        instance_of(quad_mesh(10, 10, cv::Mat4b(2, 2, cv::Vec4b(0, frame % 2 ? 255 : 0, 0, 255))), 0, 0, 1));
    const cv::Mat3b image = scene.draw(list);
    EXPECT_EQ(image(120, 160)[1], static_cast<int>(255 * level)) << frame;
  }
}

TEST(SceneRenderer, TexturesAreUprightAndRgba) {
  OffscreenScene scene(320, 240);
  DrawList list = empty_list(kNarrowLens);
  cv::Mat4b texture(2, 2);
  texture(0, 0) = {255, 0, 0, 255};
  texture(0, 1) = {0, 255, 0, 255};
  texture(1, 0) = {0, 0, 255, 255};
  texture(1, 1) = {0, 0, 0, 0};
  MeshInstance quad = instance_of(quad_mesh(0.4f, 0.4f, texture), 0, 0, 1);
  // Towards the camera, its y up in the image.
  quad.world_from_model =
      Eigen::Translation3f(0, 0, 1) * Eigen::AngleAxisf(std::numbers::pi_v<float>, Eigen::Vector3f::UnitX());
  list.meshes.push_back(quad);
  const cv::Mat3b image = scene.draw(list);
  EXPECT_EQ(image(80, 120), cv::Vec3b(0, 0, 255)) << "top left is red";
  EXPECT_EQ(image(80, 200), cv::Vec3b(0, 255, 0));
  EXPECT_EQ(image(160, 120), cv::Vec3b(255, 0, 0));
  EXPECT_EQ(image(160, 200), cv::Vec3b(0, 0, 0)) << "see-through";
}

TEST(SceneRenderer, ShowsOnlyOutsidesUnlessTwoSided) {
  OffscreenScene scene(320, 240);
  DrawList list = empty_list(kNarrowLens);
  list.meshes.push_back(instance_of(quad_mesh(1, 1, {}, false), 0, 0, 1));  // faces away: +z
  EXPECT_EQ(scene.draw(list)(120, 160)[1], 0);
  list.meshes[0].world_from_model.linear().col(2) *= -1;
  list.meshes[0].world_from_model.linear().col(1) *= -1;
  EXPECT_EQ(scene.draw(list)(120, 160)[1], 255);
  list.meshes[0].world_from_model.linear().col(0) *= -1;  // mirrored: it still faces the camera
  EXPECT_EQ(scene.draw(list)(120, 160)[1], 255);
  list.meshes[0] = instance_of(quad_mesh(1, 1), 0, 0, 1);
  EXPECT_EQ(scene.draw(list)(120, 160)[1], 255);
}

// Every shape is closed and faces outwards: rays from the middle leave through the front of as many faces as they must.
TEST(SceneRenderer, ShapesFaceOutwards) {
  for (const auto& mesh : {box_mesh({0.2f, 0.3f, 0.1f}), sphere_mesh(0.2f), cylinder_mesh(0.1f, 0.3f),
                           cone_mesh(0.1f, 0.3f), arrow_mesh(0.3f, 0.02f), torus_mesh(0.2f, 0.05f), pin_mesh(0.2f)}) {
    double volume = 0;
    for (std::size_t i = 0; i < mesh->indices.size(); i += 3) {
      const MeshVertex &a = mesh->vertices[mesh->indices[i]], &b = mesh->vertices[mesh->indices[i + 1]],
                       &c = mesh->vertices[mesh->indices[i + 2]];
      const Eigen::Vector3f normal = (b.position - a.position).cross(c.position - a.position);
      EXPECT_GT(normal.norm(), 0) << "an empty triangle";
      EXPECT_GT(normal.dot(a.normal + b.normal + c.normal), 0);
      volume += a.position.dot(b.position.cross(c.position)) / 6;
    }
    EXPECT_GT(volume, 1e-5);
  }
}

TEST(SceneRenderer, TwoContextsOnTwoThreads) {
  DrawList list = table_list(kWideLens);
  list.meshes.push_back(instance_of(sphere_mesh(0.05f), 0, 0, 0.05f, {0.2f, 0.5f, 0.9f, 1}, 0));
  list.grids.emplace_back();
  cv::Mat3b pictures[2];
  const auto draw = [&](int i) {
    OffscreenScene scene(320, 240);
    for (int frame = 0; frame < 5; ++frame) pictures[i] = scene.draw(list);
  };
  std::thread other([&] { draw(1); });
  draw(0);
  other.join();
  EXPECT_TRUE(identical(pictures[0], pictures[1]));
}

TEST(SceneRenderer, RefusesWhatItCannotDraw) {
  EXPECT_THROW(OffscreenContext(0, 100), RunError);
  OffscreenScene scene(64, 48);
  DrawList list = empty_list(kNarrowLens);
  list.background = cv::Mat(48, 64, CV_32FC1, cv::Scalar(0));
  EXPECT_THROW(scene.draw(list), CheckFailure);
  list.background = cv::Mat();
  auto broken = std::make_shared<Mesh>();
  broken->vertices.resize(2);
  broken->indices = {0, 1, 2};
  list.meshes.push_back(instance_of(broken, 0, 0, 1));
  EXPECT_THROW(scene.draw(list), CheckFailure);
  // Values that are no numbers are left out.
  list.meshes.clear();
  list.world_points.push_back({{NAN, 0, 1}, {}, 4});
  list.world_lines.push_back({{0, 0, 1}, {INFINITY, 0, 1}, {}, 4});
  list.screen_points.push_back({{NAN, 5}, {}, 4});
  list.screen_lines.push_back({{NAN, 5}, {5, 5}, {}, 4});
  EXPECT_EQ(cv::countNonZero(scene.draw(list).reshape(1)), 0);
}

}  // namespace
}  // namespace parallax
