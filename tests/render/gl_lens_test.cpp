// The lens: what is drawn lies where CameraModel::project() says, everywhere in the image, for every model.
#include <gtest/gtest.h>

#include "render/mesh_shapes.h"
#include "tests/core/camera_model_cases.h"
#include "tests/render/offscreen_scene.h"

namespace parallax {
namespace testing {
static void PrintTo(const CameraCase& item, std::ostream* out) { *out << item.name; }
}  // namespace testing
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using testing::CameraCase;
using testing::centroid;
using testing::empty_list;
using testing::OffscreenScene;

constexpr double kAllowed_px = 0.5;

class Lens : public ::testing::TestWithParam<CameraCase> {
 protected:
  const CameraModel& camera() const { return GetParam().camera; }

  // Rays through pixels `spacing` apart, over the whole image.
  std::vector<Vector3d> rays(int spacing, int border) const {
    std::vector<Vector3d> out;
    for (int y = border; y < camera().height() - border; y += spacing)
      for (int x = border; x < camera().width() - border; x += spacing) {
        Vector3d ray;
        if (camera().unproject(Vector2d(x + 0.3, y + 0.7), &ray)) out.push_back(ray.normalized());
      }
    return out;
  }

  // Every drawn spot's centre against project(), the worst.
  void expect_spots(const cv::Mat3b& image, const std::vector<Vector3d>& points, int reach) const {
    double worst = 0;
    for (const Vector3d& p : points) {
      Vector2d px;
      ASSERT_TRUE(camera().project(p, &px));
      const auto found = centroid(image, px, reach);
      ASSERT_TRUE(found) << "nothing drawn at " << px.transpose();
      worst = std::max(worst, (*found - px).norm());
    }
    EXPECT_GT(points.size(), 50u);
    EXPECT_LT(worst, kAllowed_px);
    RecordProperty("worst_px", std::to_string(worst));
    std::printf("  %s: %zu spots, worst %.3f px\n", GetParam().name.c_str(), points.size(), worst);
  }
};

TEST_P(Lens, PutsPointsWhereTheyProject) {
  OffscreenScene scene(camera().width(), camera().height(), {1});
  DrawList list = empty_list(camera());
  std::vector<Vector3d> points;
  for (const Vector3d& ray : rays(20, 8)) {
    const double distance = 0.2 + 0.1 * static_cast<double>(points.size() % 37);
    points.push_back(distance * ray);
    list.world_points.push_back({points.back().cast<float>(), {1, 1, 1, 1}, 5});
  }
  expect_spots(scene.draw(list), points, 6);
}

TEST_P(Lens, PutsSmallMeshesWhereTheyProject) {
  OffscreenScene scene(camera().width(), camera().height());
  DrawList list = empty_list(camera());
  const auto ball = sphere_mesh(1, 10);
  std::vector<Vector3d> points;
  for (const Vector3d& ray : rays(50, 10)) {
    const double distance = 0.5 + 0.1 * static_cast<double>(points.size() % 7);
    points.push_back(distance * ray);
    Eigen::Matrix<double, 2, 3> jacobian;
    Vector2d px;
    camera().project(points.back(), &px, &jacobian);
    MeshInstance instance;
    instance.mesh = ball;
    instance.emission = 1;
    // About two pixels, the longer way.
    const double radius = 2 / jacobian.jacobiSvd().singularValues()[0];
    instance.world_from_model = Eigen::Translation3f(points.back().cast<float>()) * Eigen::Scaling(float(radius));
    list.meshes.push_back(instance);
  }
  expect_spots(scene.draw(list), points, 6);
}

// Two big triangles, cut by the renderer: the dots of their texture lie where they project.
TEST_P(Lens, BendsABigSurface) {
  OffscreenScene scene(camera().width(), camera().height());
  DrawList list = empty_list(camera());
  constexpr int dots = 24, texture_size = 1536;
  cv::Mat4b texture(texture_size, texture_size, cv::Vec4b(0, 0, 0, 255));
  constexpr int pitch = texture_size / dots;
  for (int i = 0; i < dots; ++i)
    for (int k = 0; k < dots; ++k)
      texture(cv::Rect(k * pitch + pitch / 2 - 3, i * pitch + pitch / 2 - 3, 6, 6)).setTo(cv::Vec4b::all(255));
  const float side = 2.4f;
  MeshInstance instance;
  instance.mesh = quad_mesh(side, side, texture);
  instance.emission = 1;
  instance.world_from_model =
      Eigen::Translation3f(0.05f, -0.02f, 1) * Eigen::AngleAxisf(0.3f, Eigen::Vector3f(0.7f, 0.7f, 0.1f).normalized());
  list.meshes.push_back(instance);
  const cv::Mat3b image = scene.draw(list);
  std::vector<Vector3d> points;
  for (int i = 0; i < dots; ++i) {
    for (int k = 0; k < dots; ++k) {
      const Eigen::Vector3f model(side * ((k + 0.5f) / dots - 0.5f), side * (0.5f - (i + 0.5f) / dots), 0);
      const Vector3d p = (instance.world_from_model * model).cast<double>();
      Vector2d px;
      if (!camera().project(p, &px) || !camera().in_image(px, 6)) continue;
      // Only where the next dots are out of reach.
      double nearest = 1e9;
      for (const Eigen::Vector3f& step : {Eigen::Vector3f(side / dots, 0, 0), Eigen::Vector3f(0, side / dots, 0)}) {
        for (const float sign : {-1.0f, 1.0f}) {
          Vector2d other;
          const Vector3d q = (instance.world_from_model * Eigen::Vector3f(model + sign * step)).cast<double>();
          if (camera().project(q, &other)) nearest = std::min(nearest, (other - px).norm());
        }
      }
      if (nearest > 15) points.push_back(p);
    }
  }
  expect_spots(image, points, 5);
}

TEST_P(Lens, BendsLines) {
  OffscreenScene scene(camera().width(), camera().height(), {1});
  double worst = 0;
  int measured = 0;
  for (int n = 0; n < 6; ++n) {
    DrawList list = empty_list(camera());
    const double turn = n * 0.55;
    const Vector3d along(std::cos(turn), std::sin(turn), 0.3 * (n % 3 - 1)), across(-std::sin(turn), std::cos(turn), 0);
    const Vector3d a = Vector3d(0, 0, 1) + 0.35 * (n % 4 - 1.5) * across - 1.1 * along;
    const Vector3d b = a + 2.2 * along;
    list.world_lines.push_back({a.cast<float>(), b.cast<float>(), {1, 1, 1, 1}, 3});
    const cv::Mat3b image = scene.draw(list);
    for (int i = 1; i < 200; ++i) {
      const Vector3d p = a + (b - a) * (i / 200.0);
      Vector2d px, before, after;
      if (!camera().project(p, &px) || !camera().in_image(px, 8)) continue;
      if (!camera().project(p - 0.005 * along, &before) || !camera().project(p + 0.005 * along, &after)) continue;
      // Straight across the line, light is weighed in a disc around the place.
      const auto found = centroid(image, px, 4);
      ASSERT_TRUE(found) << "line " << n << " is not drawn at " << px.transpose();
      const Vector2d direction = (after - before).normalized();
      const Vector2d off = *found - px;
      worst = std::max(worst, std::abs(off.x() * direction.y() - off.y() * direction.x()));
      ++measured;
    }
  }
  EXPECT_GT(measured, 100);
  EXPECT_LT(worst, kAllowed_px);
  std::printf("  %s: %d places, worst %.3f px\n", GetParam().name.c_str(), measured, worst);
}

// The ground all around and below the camera: a pixel is coloured if, and only if, its ray meets the ground.
TEST_P(Lens, DrawsTheGroundAroundTheCamera) {
  OffscreenScene scene(camera().width(), camera().height());
  DrawList list = empty_list(camera());
  const float side = 3;
  MeshInstance ground;
  ground.mesh = quad_mesh(side, side);
  ground.emission = 1;
  list.meshes.push_back(ground);
  const RigidTransform camera_from_world =
      testing::look_at({0.1, -0.3, 0.25}, {0.15, 0.1, 0.2}, Vector3d(0.05, 0, 1).normalized());
  list.camera_from_world = camera_from_world;
  const RigidTransform world_from_camera = camera_from_world.inverse();
  const cv::Mat3b image = scene.draw(list);
  const auto meets_ground = [&](const Vector2d& px, bool* known) {
    Vector3d ray;
    Vector2d back;
    *known = camera().unproject(px, &ray) && camera().project(ray, &back);
    if (!*known) return false;
    const Vector3d direction = world_from_camera.R * ray;
    if (direction.z() > -1e-9) return false;
    const Vector3d at = world_from_camera.t - direction * (world_from_camera.t.z() / direction.z());
    return std::max(std::abs(at.x()), std::abs(at.y())) < 0.5 * side;
  };
  int grounds = 0, skies = 0, wrong = 0;
  for (int y = 3; y < image.rows - 3; y += 7) {
    for (int x = 3; x < image.cols - 3; x += 7) {
      bool known = true, mixed = false;
      const bool here = meets_ground(Vector2d(x, y), &known);
      if (!known) continue;
      for (const Vector2d& off : {Vector2d(1, 0), Vector2d(-1, 0), Vector2d(0, 1), Vector2d(0, -1)}) {
        bool also = true;
        mixed |= meets_ground(Vector2d(x, y) + off, &also) != here || !also;
      }
      if (mixed) continue;  // at the edge
      (here ? grounds : skies) += 1;
      const int level = image(y, x)[1];
      wrong += here ? level < 250 : level > 5;
    }
  }
  EXPECT_GT(grounds, 300);
  EXPECT_GT(skies, 100);
  EXPECT_EQ(wrong, 0);
}

INSTANTIATE_TEST_SUITE_P(Models, Lens, ::testing::ValuesIn(testing::camera_cases()),
                         [](const auto& test) { return test.param.name; });

// A picture drawn at twice its size: the centre of pixel (x, y) is at 2 (x + 0.5) - 0.5.
TEST(LensScale, KeepsTheHalfPixel) {
  const CameraModel camera(CameraModelKind::fov, 320, 240, {180, 181}, {158, 121}, {0.9}, 1);
  OffscreenScene scene(640, 480);
  DrawList list = empty_list(camera);
  list.world_points.push_back({{0.2f, 0.1f, 1}, {1, 1, 1, 1}, 4});
  list.screen_points.push_back({{40, 200}, {1, 1, 1, 1}, 4});
  const cv::Mat3b image = scene.draw(list);
  Vector2d px;
  ASSERT_TRUE(camera.project({0.2, 0.1, 1}, &px));
  for (const Vector2d& at : {px, Vector2d(40, 200)}) {
    const Vector2d expected = 2 * (at.array() + 0.5) - 0.5;
    const auto found = centroid(image, expected, 8);
    ASSERT_TRUE(found);
    EXPECT_LT((*found - expected).norm(), 0.05);
  }
}

}  // namespace
}  // namespace parallax
