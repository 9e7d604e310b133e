#include "render/synthetic_raycaster.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "render/synthetic_path.h"

namespace parallax {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kSquares = 12;

// A chess board 0.8 m square on z = 0 about the origin; squares of 64 texels.
std::shared_ptr<const SyntheticScene> chess_scene() {
  cv::Mat3b board(kSquares * 64, kSquares * 64);
  for (int y = 0; y < board.rows; ++y)
    for (int x = 0; x < board.cols; ++x)
      board(y, x) = ((x / 64 + y / 64) % 2 ? cv::Vec3b(210, 210, 210) : cv::Vec3b(40, 40, 40));
  auto scene = std::make_shared<SyntheticScene>();
  scene->add_rectangle({-0.4, 0.4, 0}, {0.8, 0, 0}, {0, -0.8, 0}, scene->add_texture(board));
  return scene;
}

std::vector<CameraModel> all_lenses() {
  return {
      {CameraModelKind::pinhole, 640, 480, {330.0, 331.0}, {320.7, 238.9}},
      {CameraModelKind::radtan, 640, 480, {390.0, 391.0}, {318.2, 241.3}, {-0.26, 0.07, 0.0004, -0.0003}, 4},
      {CameraModelKind::kannala_brandt, 640, 480, {370.0, 370.4}, {322.1, 240.8}, {-0.012, 0.004, -0.001, 0.0001}, 4},
      {CameraModelKind::fov, 640, 480, {375.0, 376.0}, {321.4, 238.2}, {0.9}, 1}};
}

TEST(RayCaster, ChessCornersAppearWhereTheLensProjectsThem) {
  const auto scene = chess_scene();
  for (const CameraModel& camera : all_lenses()) {
    RayCaster caster(scene, camera);
    int checked = 0;
    double worst = 0, sum_squares = 0, sum_x = 0, sum_y = 0;
    for (const Vector3d& eye : {Vector3d(0.03, -0.02, 0.45), Vector3d(0.25, -0.3, 0.5), Vector3d(-0.2, -0.1, 0.7)}) {
      const RigidTransform camera_from_world = look_at(eye, {0.02, 0.05, 0}, 0.2).inverse();
      cv::Mat1f grey;
      const std::vector<RigidTransform> poses(8, camera_from_world);
      caster.render(poses, &grey, nullptr);
      // The corner finder is at its best (0.03 px) on slightly blurred corners, which symmetric blur does not move.
      cv::GaussianBlur(grey, grey, {0, 0}, 1.2);
      for (int i = 1; i < kSquares; ++i)
        for (int j = 1; j < kSquares; ++j) {
          const Vector3d p(-0.4 + 0.8 * i / kSquares, -0.4 + 0.8 * j / kSquares, 0);
          Vector2d px;
          if (!camera.project(camera_from_world * p, &px) || !camera.in_image(px, 12)) continue;
          // The corner finder's window must hold one corner only.
          double nearest = 1e9;
          for (const Vector3d& side : {Vector3d(0.8 / kSquares, 0, 0), Vector3d(0, 0.8 / kSquares, 0)})
            for (const double sign : {-1.0, 1.0}) {
              Vector2d next;
              if (camera.project(camera_from_world * (p + sign * side), &next))
                nearest = std::min(nearest, (next - px).norm());
            }
          if (nearest < 20) continue;
          std::vector<cv::Point2f> found = {
              {std::round(static_cast<float>(px.x())), std::round(static_cast<float>(px.y()))}};
          cv::cornerSubPix(grey, found, {6, 6}, {-1, -1}, {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 50, 1e-3});
          const double dx = found[0].x - px.x(), dy = found[0].y - px.y();
          worst = std::max(worst, std::hypot(dx, dy));
          sum_squares += dx * dx + dy * dy;
          sum_x += dx, sum_y += dy;
          ++checked;
        }
    }
    EXPECT_GT(checked, 100) << to_string(camera.kind());
    EXPECT_LT(worst, 0.1) << to_string(camera.kind());
    EXPECT_LT(std::sqrt(sum_squares / checked), 0.03) << to_string(camera.kind());
    // No common shift: the half-pixel convention is kept.
    EXPECT_LT(std::hypot(sum_x, sum_y) / checked, 0.01) << to_string(camera.kind());
  }
}

TEST(RayCaster, DepthIsTheAnalyticIntersection) {
  // The furnished room: rectangles, discs and cylinders; every lens.
  const auto scene = synthetic_scene("desk", 5);
  for (const CameraModel& camera : all_lenses()) {
    RayCaster caster(scene, camera);
    const RigidTransform world_from_camera = look_at({-0.1, -0.5, 0.5}, {0.0, 0.1, 0}, 0.1);
    const cv::Mat1f depth = caster.depth(world_from_camera.inverse());
    int checked = 0, different = 0, cylinders = 0;
    for (int y = 3; y < camera.height(); y += 7)
      for (int x = 2; x < camera.width(); x += 5) {
        Vector3d ray;
        if (!camera.unproject(Vector2d(x, y), &ray)) continue;
        const auto hit = scene->cast(world_from_camera.t, world_from_camera.R * ray);
        ++checked;
        if (!hit) {
          different += depth(y, x) != 0;
          continue;
        }
        cylinders += scene->surfaces()[static_cast<std::size_t>(hit->surface)].shape == SurfaceShape::cylinder;
        different += std::abs(depth(y, x) - hit->distance) > 2e-5 * hit->distance;
      }
    EXPECT_GT(checked, 5000);
    EXPECT_GT(cylinders, 20);
    // At silhouettes a ray may go either way by the last bit of a float.
    EXPECT_LE(different, checked / 1000) << to_string(camera.kind());
  }
}

TEST(RayCaster, APictureMovesAcrossTheMantleOfACan) {
  // A can's picture must not be mirrored: its left half dark, its right half bright, seen from where it begins.
  cv::Mat3b halves(128, 512, cv::Vec3b(220, 220, 220));
  halves(cv::Rect(256, 0, 256, 128)) = cv::Vec3b(30, 30, 30);
  SyntheticScene scene;
  const int label = scene.add_texture(halves);
  scene.add_can({0, 0}, 0, 0.1, 0.4, 0, label, label);
  const CameraModel camera(CameraModelKind::pinhole, 160, 128, {200, 200}, {79.5, 63.5});
  RayCaster caster(std::make_shared<const SyntheticScene>(scene), camera);
  // The picture begins (s = 0) on the +x side, and runs to the right as one looks at it.
  const std::vector<RigidTransform> poses(4, look_at({1, 0, 0.2}, {0, 0, 0.2}).inverse());
  cv::Mat1f grey;
  caster.render(poses, &grey, nullptr);
  EXPECT_GT(grey(64, 88), 100);  // right of the middle: the first half of the picture
  EXPECT_LT(grey(64, 71), 60);   // left of it: the last
}

TEST(RayCaster, FineTextureAveragesOutInTheDistance) {
  // A one-texel chequer seen from far away is an even grey, not a moire pattern.
  cv::Mat3b fine(512, 512);
  for (int y = 0; y < 512; ++y)
    for (int x = 0; x < 512; ++x) fine(y, x) = (x + y) % 2 ? cv::Vec3b(255, 255, 255) : cv::Vec3b(0, 0, 0);
  auto scene = std::make_shared<SyntheticScene>();
  scene->add_rectangle({-1, 1, 0}, {2, 0, 0}, {0, -2, 0}, scene->add_texture(fine));
  const CameraModel camera(CameraModelKind::pinhole, 160, 128, {200, 200}, {79.5, 63.5});
  RayCaster caster(scene, camera);
  const std::vector<RigidTransform> poses(4, look_at({0.1, -0.1, 3.5}, {0, 0.01, 0}).inverse());
  cv::Mat1f grey;
  caster.render(poses, &grey, nullptr);
  cv::Scalar mean, deviation;
  cv::meanStdDev(grey(cv::Rect(50, 40, 60, 48)), mean, deviation);
  EXPECT_GT(mean[0], 100);
  EXPECT_LT(deviation[0], 3);
}

TEST(RayCaster, MotionBlurIsTheAverageOfSharpPictures) {
  const auto scene = chess_scene();
  const CameraModel camera = all_lenses()[3];
  RayCaster caster(scene, camera);
  const RigidTransform a = look_at({0, -0.1, 0.5}, {0, 0, 0}).inverse();
  const RigidTransform b = look_at({0.02, -0.1, 0.5}, {0.02, 0, 0}).inverse();
  std::vector<RigidTransform> both(4, a);
  both.insert(both.end(), 4, b);
  cv::Mat1f blurred, sharp_a, sharp_b;
  caster.render(both, &blurred, nullptr);
  caster.render(std::vector<RigidTransform>(4, a), &sharp_a, nullptr);
  caster.render(std::vector<RigidTransform>(4, b), &sharp_b, nullptr);
  cv::Mat1f difference;
  cv::absdiff(blurred, (sharp_a + sharp_b) / 2, difference);
  // Within anti-aliasing: samples 4 to 7 sit elsewhere in the pixel than 0 to 3.
  EXPECT_LT(cv::mean(difference)[0], 1.0);
  cv::absdiff(blurred, sharp_a, difference);
  EXPECT_GT(cv::mean(difference)[0], 10.0);
}

}  // namespace
}  // namespace parallax
