#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "app/marker_scale.h"
#include "core/error.h"
#include "render/synthetic_path.h"
#include "tests/support/lenses.h"

namespace parallax {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kSide_m = 0.06;
constexpr int kId = 17;
constexpr double kTrueScale = 2.5;  // true metres a map metre

// A marker on the table z = 0, turned a little; true metres. Its frame: x right, y down as printed, z into the table.
RigidTransform world_from_marker() { return {exp_so3({M_PI, 0, 0}) * exp_so3({0, 0, 0.3}), Vector3d(0.03, -0.02, 0)}; }

std::array<Vector3d, 4> true_corners() {
  const double h = kSide_m / 2;
  return {world_from_marker() * Vector3d(-h, -h, 0), world_from_marker() * Vector3d(h, -h, 0),
          world_from_marker() * Vector3d(h, h, 0), world_from_marker() * Vector3d(-h, h, 0)};
}

RigidTransform view(int i) {
  return look_at({0.15 * i - 0.2, -0.3 + 0.02 * i, 0.3}, {0.02, 0.0, 0}, 0.1 * i).inverse();
}

// The table with the marker on white paper, as the lens sees it: 5x5 rays a pixel.
GreyImage picture(const CameraModel& camera, const RigidTransform& camera_from_world) {
  cv::Mat1b printed;
  cv::aruco::drawMarker(cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_50), kId, 600, printed, 1);
  const RigidTransform marker_from_camera = world_from_marker().inverse() * camera_from_world.inverse();
  GreyImage out(camera.height(), camera.width());
  for (int y = 0; y < out.rows; ++y) {
    for (int x = 0; x < out.cols; ++x) {
      double sum = 0;
      for (int k = 0; k < 25; ++k) {
        Vector3d ray;
        double value = 90;  // the table
        if (camera.unproject({x + (k % 5 - 2) / 5.0, y + (k / 5 - 2) / 5.0}, &ray)) {
          const Vector3d d = marker_from_camera.R * ray;
          const double distance = -marker_from_camera.t.z() / d.z();
          const Vector3d at = marker_from_camera.t + distance * d;
          const double u = (at.x() / kSide_m + 0.5) * 600, v = (at.y() / kSide_m + 0.5) * 600;
          if (distance > 0 && u >= 0 && v >= 0 && u < 600 && v < 600)
            value = printed(static_cast<int>(v), static_cast<int>(u)) > 0 ? 220 : 25;
          else if (distance > 0 && u >= -100 && v >= -100 && u < 700 && v < 700)
            value = 220;
        }
        sum += value;
      }
      out(y, x) = static_cast<uchar>(std::lround(sum / 25));
    }
  }
  return out;
}

// The map's world is smaller than the true one.
RigidTransform in_map(RigidTransform camera_from_world) {
  camera_from_world.t /= kTrueScale;
  return camera_from_world;
}

MarkerSighting sighting(const CameraModel& camera, const RigidTransform& camera_from_world, double noise_px,
                        std::mt19937_64* random) {
  std::normal_distribution<double> noise(0, std::max(noise_px, 1e-12));
  MarkerSighting out;
  out.camera_from_world = in_map(camera_from_world);
  out.marker.id = kId;
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_TRUE(camera.project(camera_from_world * true_corners()[i], &out.marker.corners_px[i]));
    out.marker.corners_px[i] += Vector2d(noise(*random), noise(*random));
  }
  return out;
}

MarkerOptions options() {
  MarkerOptions out;
  out.side_m = kSide_m;
  return out;
}

TEST(MarkerScale, FindsTheCornersOfARenderedMarker) {
  const CameraModel camera = testing::wide_lens();
  for (const int i : {0, 2}) {
    const auto markers = detect_markers(picture(camera, view(i)));
    ASSERT_EQ(markers.size(), 1U);
    EXPECT_EQ(markers[0].id, kId);
    for (std::size_t c = 0; c < 4; ++c) {
      Vector2d truth;
      ASSERT_TRUE(camera.project(view(i) * true_corners()[c], &truth));
      EXPECT_LT((markers[0].corners_px[c] - truth).norm(), 0.5) << "view " << i << " corner " << c;
    }
  }
  EXPECT_TRUE(detect_markers(GreyImage(480, 640, uchar(128))).empty());
  // What the program gives to print is what it finds.
  const auto printed = detect_markers(marker_sheet(7));
  ASSERT_EQ(printed.size(), 1u);
  EXPECT_EQ(printed[0].id, 7);
  EXPECT_NEAR((printed[0].corners_px[1] - printed[0].corners_px[0]).norm(), 600, 2);
  EXPECT_TRUE(detect_markers({}).empty());
}

TEST(MarkerScale, FromPicturesOfKeyframes) {
  const CameraModel camera = testing::wide_lens();
  TrackingSnapshot map;
  for (int i = 0; i < 3; ++i) {
    SnapshotKeyframe kf;
    kf.id = {0, i};
    kf.camera_from_world = in_map(view(i));
    kf.centre = kf.camera_from_world.inverse().t;
    auto images = std::make_shared<FrameImages>();
    build_pyramid(picture(camera, view(i)), &images->pyramid);
    kf.images = std::move(images);
    map.keyframes.push_back(std::move(kf));
  }
  const MarkerScale scale = scale_from_marker(camera, map, options());
  ASSERT_TRUE(scale.ok) << scale.reason;
  EXPECT_EQ(scale.id, kId);
  EXPECT_EQ(scale.views, 3);
  EXPECT_NEAR(scale.factor, kTrueScale, 0.005 * kTrueScale);
  EXPECT_LT(scale.sigma, 0.01 * kTrueScale);
  for (std::size_t c = 0; c < 4; ++c) EXPECT_LT((kTrueScale * scale.corners[c] - true_corners()[c]).norm(), 0.001) << c;
  // Only one keyframe: refused, but the present frame on the plane does.
  map.keyframes.resize(1);
  EXPECT_FALSE(scale_from_marker(camera, map, options()).ok);
  map.plane = Plane{};
  map.plane->extent_m = 0.01;
  const PresentView present{map.keyframes[0].images->pyramid.level[0], map.keyframes[0].camera_from_world};
  const MarkerScale on_plane = scale_from_marker(camera, map, options(), present);
  ASSERT_TRUE(on_plane.ok) << on_plane.reason;
  EXPECT_EQ(on_plane.views, 1);
  EXPECT_NEAR(on_plane.factor, kTrueScale, 0.01 * kTrueScale);
  EXPECT_FALSE(scale_from_marker(camera, TrackingSnapshot(), options()).ok);
}

TEST(MarkerScale, ExactCornersGiveTheExactScale) {
  const CameraModel camera = testing::wide_lens();
  std::mt19937_64 random(1);
  std::vector<MarkerSighting> sightings{sighting(camera, view(0), 0, &random), sighting(camera, view(3), 0, &random)};
  const MarkerScale scale = scale_from_sightings(camera, sightings, options());
  ASSERT_TRUE(scale.ok) << scale.reason;
  EXPECT_NEAR(scale.factor, kTrueScale, 1e-6);
  EXPECT_LT(scale.residual_px, 1e-6);
  const MarkerScale on_plane = scale_from_plane(camera, sightings[0], Plane{}, options());
  ASSERT_TRUE(on_plane.ok) << on_plane.reason;
  EXPECT_NEAR(on_plane.factor, kTrueScale, 1e-7);
}

// What it says of its own uncertainty is so: errors over many trials, in its standard deviations.
TEST(MarkerScale, UncertaintyIsHonest) {
  const CameraModel camera = testing::wide_lens();
  std::mt19937_64 random(2);
  double sum = 0, sum_plane = 0;
  const int trials = 300;
  for (int t = 0; t < trials; ++t) {
    std::vector<MarkerSighting> sightings;
    for (int i = 0; i < 3; ++i) sightings.push_back(sighting(camera, view(i), options().corner_sigma_px, &random));
    const MarkerScale scale = scale_from_sightings(camera, sightings, options());
    ASSERT_TRUE(scale.ok) << scale.reason;
    sum += std::pow((scale.factor - kTrueScale) / scale.sigma, 2);
    const MarkerScale on_plane = scale_from_plane(camera, sightings[0], Plane{}, options());
    ASSERT_TRUE(on_plane.ok) << on_plane.reason;
    sum_plane += std::pow((on_plane.factor - kTrueScale) / on_plane.sigma, 2);
  }
  // The noise is taken to be what the residuals show when that is more, so the figures are a little cautious.
  EXPECT_GT(std::sqrt(sum / trials), 0.7);
  EXPECT_LT(std::sqrt(sum / trials), 1.1);
  EXPECT_NEAR(std::sqrt(sum_plane / trials), 1, 0.15);
}

TEST(MarkerScale, RefusesWithAReason) {
  const CameraModel camera = testing::wide_lens();
  std::mt19937_64 random(3);
  // The same place twice.
  std::vector<MarkerSighting> sightings{sighting(camera, view(1), 0.2, &random),
                                        sighting(camera, view(1), 0.2, &random)};
  MarkerScale scale = scale_from_sightings(camera, sightings, options());
  EXPECT_FALSE(scale.ok);
  EXPECT_NE(scale.reason.find("same place"), std::string::npos) << scale.reason;
  sightings.pop_back();
  scale = scale_from_sightings(camera, sightings, options());
  EXPECT_NE(scale.reason.find("fewer than two"), std::string::npos) << scale.reason;
  // It moved between the two.
  sightings.push_back(sighting(camera, view(3), 0, &random));
  for (auto& px : sightings.back().marker.corners_px) px += Vector2d(4, 25);
  scale = scale_from_sightings(camera, sightings, options());
  EXPECT_FALSE(scale.ok);
  EXPECT_NE(scale.reason.find("do not agree"), std::string::npos) << scale.reason;
  // One bad sighting among good ones is left out.
  sightings.push_back(sighting(camera, view(0), 0, &random));
  sightings.push_back(sighting(camera, view(2), 0, &random));
  scale = scale_from_sightings(camera, sightings, options());
  ASSERT_TRUE(scale.ok) << scale.reason;
  EXPECT_EQ(scale.views, 3);
  EXPECT_NEAR(scale.factor, kTrueScale, 0.03 * kTrueScale);
  // Standing on its edge it does not lie on the plane.
  Plane upright;
  upright.world_from_plane = RigidTransform(exp_so3({1.0, 0, 0}), Vector3d::Zero());
  scale = scale_from_plane(camera, sightings[0], upright, options());
  EXPECT_FALSE(scale.ok);
  EXPECT_NE(scale.reason.find("plane"), std::string::npos) << scale.reason;
  MarkerOptions bad;
  bad.side_m = 0;
  EXPECT_THROW(scale_from_sightings(camera, sightings, bad), InputError);
}

TEST(MarkerScale, FromTwoPointsAndTheirDistance) {
  const DistanceScale scale = scale_from_distance({0.1, 0.2, 0.3}, {0.1, 0.2, 0.8}, 1.25);
  ASSERT_TRUE(scale.ok);
  EXPECT_NEAR(scale.factor, 2.5, 1e-12);
  EXPECT_FALSE(scale_from_distance({0, 0, 0}, {0, 0, 0}, 1).ok);
  EXPECT_FALSE(scale_from_distance({0, 0, 0}, {1, 0, 0}, 0).ok);
  EXPECT_FALSE(scale_from_distance({0, 0, 0}, {1, 0, 0}, NAN).ok);
  EXPECT_FALSE(scale_from_distance({0, 0, 0}, {1, 0, 0}, -2).reason.empty());
}

}  // namespace
}  // namespace parallax
