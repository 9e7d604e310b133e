#include "render/overlay.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "core/check.h"
#include "render/synthetic_path.h"

namespace parallax {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

CameraModel wide_lens() { return {CameraModelKind::fov, 640, 480, {375.0, 376.0}, {321.4, 238.2}, {0.9}, 1}; }

double distance_to(const std::vector<std::vector<Vector2d>>& pieces, const Vector2d& px) {
  double best = 1e9;
  for (const auto& piece : pieces)
    for (std::size_t i = 1; i < piece.size(); ++i) {
      const Vector2d a = piece[i - 1], d = piece[i] - a;
      const double s = d.squaredNorm() > 0 ? std::clamp((px - a).dot(d) / d.squaredNorm(), 0.0, 1.0) : 0.0;
      best = std::min(best, (a + s * d - px).norm());
    }
  return best;
}

TEST(Overlay, LinesBendWithTheLens) {
  const CameraModel camera = wide_lens();
  const Vector3d a(-0.7, -0.5, 0.8), b(0.7, -0.45, 0.9);
  const auto pieces = project_segment(camera, a, b);
  ASSERT_EQ(pieces.size(), 1u);
  Vector2d pa, pb;
  ASSERT_TRUE(camera.project(a, &pa) && camera.project(b, &pb));
  double bend = 0;
  for (int i = 0; i <= 100; ++i) {
    Vector2d px;
    ASSERT_TRUE(camera.project(a + (b - a) * i / 100.0, &px));
    EXPECT_LT(distance_to(pieces, px), 0.5) << i;
    const Vector2d chord = (pb - pa).normalized();
    bend = std::max(bend, std::abs(chord.x() * (px - pa).y() - chord.y() * (px - pa).x()));
  }
  EXPECT_GT(bend, 5) << "a straight line would have done: the test proves nothing";
}

TEST(Overlay, WhatIsBehindTheCameraIsCutOff) {
  const CameraModel camera = wide_lens();
  EXPECT_TRUE(project_segment(camera, {0, 0, -1}, {0.2, 0.1, -0.5}).empty());
  const Vector3d a(0, 0.1, 1), b(0.1, 0.2, -1);
  const auto pieces = project_segment(camera, a, b);
  ASSERT_FALSE(pieces.empty());
  Vector2d first;
  ASSERT_TRUE(camera.project(a, &first));
  EXPECT_LT((pieces.front().front() - first).norm(), 1e-9);
  for (const auto& piece : pieces)
    for (const auto& px : piece) EXPECT_TRUE(px.allFinite());
  // A long line whose ends are out of sight but whose middle is not.
  const auto across = project_segment(camera, {-30, 0.1, 1}, {30, 0.1, 1});
  ASSERT_FALSE(across.empty());
  Vector2d middle;
  ASSERT_TRUE(camera.project({0.05, 0.1, 1}, &middle));
  EXPECT_LT(distance_to(across, middle), 0.5);
}

TEST(Overlay, GridPointsAreDrawnWhereCamProjPutsThem) {
  OverlayInput input;
  input.background = cv::Mat1b::zeros(480, 640);
  input.camera = wide_lens();
  input.camera_from_world = look_at({0.1, -0.5, 0.5}, {0, 0, 0}).inverse();
  input.tracked = true;
  const RigidTransform world_from_plane(exp_so3({0.05, -0.02, 0.3}), {0.02, 0.01, 0.01});
  input.grid = OverlayGrid{world_from_plane, 0.3, 6};
  const cv::Mat3b out = draw_overlay(input);
  for (int i = 1; i < 6; ++i) {
    // Half way between two crossings of an inner line x = const: the centre of brightness across it.
    const Vector3d on_plane(-0.3 + 0.1 * i, 0.05, 0);
    Vector2d px, ahead;
    const RigidTransform camera_from_plane = input.camera_from_world * world_from_plane;
    ASSERT_TRUE(input.camera.project(camera_from_plane * on_plane, &px));
    ASSERT_TRUE(input.camera.project(camera_from_plane * (on_plane + Vector3d(0, 0.001, 0)), &ahead));
    ASSERT_GT(std::abs((ahead - px).y()), 0.5 * std::abs((ahead - px).x())) << "the line must not run along the rows";
    double weight = 0, sum = 0;
    const int row = static_cast<int>(std::lround(px.y()));
    for (int x = static_cast<int>(px.x()) - 5; x <= static_cast<int>(px.x()) + 6; ++x) {
      weight += out(row, x)[1];
      sum += out(row, x)[1] * x;
    }
    ASSERT_GT(weight, 100) << i;
    const double slope = (ahead - px).x() / (ahead - px).y();
    EXPECT_NEAR(sum / weight, px.x() + slope * (row - px.y()), 0.5) << i;
  }
  // The colour says whether the coarse stage ran.
  input.coarse_stage = false;
  EXPECT_GT(cv::norm(out, draw_overlay(input), cv::NORM_INF), 50);
}

TEST(Overlay, PointsAreSubPixelAndColouredByLevel) {
  OverlayInput input;
  input.background = cv::Mat3b(480, 640, cv::Vec3b(0, 0, 0));
  input.camera = wide_lens();
  input.tracked = true;
  std::vector<OverlayPoint> points;
  for (int level = 0; level < 4; ++level)
    points.push_back({{100.0f + 100.0f * static_cast<float>(level), 200.25f}, level, true});
  points.push_back({{NAN, 10.0f}, 0, true});  // never drawn, never a crash
  points.push_back({{1e9f, -1e9f}, 0, true});
  input.points = points;
  const cv::Mat3b out = draw_overlay(input);
  for (int level = 0; level < 4; ++level)
    EXPECT_EQ(out(200, 100 + 100 * level), overlay_level_colours()[static_cast<std::size_t>(level)]);
  input.tracked = false;
  EXPECT_EQ(cv::norm(draw_overlay(input), cv::NORM_L1), 0) << "nothing is drawn when lost";
  EXPECT_EQ(cv::norm(input.background, cv::NORM_L1), 0) << "the input stays as it was";
}

TEST(Overlay, StateLineAndTrailsShow) {
  OverlayInput input;
  input.background = cv::Mat1b(480, 640, uchar(128));
  input.camera = wide_lens();
  const cv::Mat3b bare = draw_overlay(input);
  EXPECT_EQ(bare(10, 10), cv::Vec3b(128, 128, 128));
  input.state_line = std::string(500, 'x');
  const cv::Mat3b with_strip = draw_overlay(input);
  EXPECT_LT(with_strip(478, 1)[0], 60);
  EXPECT_EQ(with_strip(400, 320), cv::Vec3b(128, 128, 128));
  const std::vector<OverlayTrail> trails = {{{100, 100}, {150, 100}}};
  input.trails = trails;
  EXPECT_NE(draw_overlay(input)(100, 125), cv::Vec3b(128, 128, 128));
  // Any size of picture, however small.
  input.background = cv::Mat1b(8, 8, uchar(0));
  EXPECT_EQ(draw_overlay(input).size(), cv::Size(8, 8));
  input.background = cv::Mat();
  EXPECT_THROW(draw_overlay(input), CheckFailure);
}

}  // namespace
}  // namespace parallax
