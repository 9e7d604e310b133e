#include "mapper/normal_estimation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "map/source_patch.h"
#include "mapper/patch_slope.h"
#include "mapper/remeasure.h"
#include "tests/support/statistics.h"

namespace parallax {
namespace {

const CameraModel& camera() {
  static const CameraModel c(CameraModelKind::pinhole, 320, 240, {250, 250}, {159.5, 119.5});
  return c;
}

// A plane inclined by `tilt` about the y axis through (0, 0, 1), covered with soft noise, seen by cameras that slide
// and turn around it. Normals start towards the source.
class SlantedPlane {
 public:
  SlantedPlane(double tilt, const std::vector<double>& angles) : normal_(std::sin(tilt), 0, -std::cos(tilt)) {
    cv::Mat1f texture(512, 512);
    cv::RNG rng(7);
    rng.fill(texture, cv::RNG::NORMAL, 0, 1);
    cv::GaussianBlur(texture, texture, {}, 1.8, 1.8, cv::BORDER_REFLECT);
    cv::Scalar mean, deviation;
    cv::meanStdDev(texture, mean, deviation);
    texture_ = texture * (38.0 / deviation[0]) + 128.0;
    map_.write([&](Map& m) {
      for (double angle : angles) m.keyframes.insert(view(angle, m.keyframes.empty()));
      const Keyframe source = *m.keyframes.begin();
      for (int y = 40; y < 210; y += 14) {
        for (int x = 50; x < 280; x += 14) add_point(&m, source, Eigen::Vector2d(x, y));
      }
    });
  }

  SharedMap& map() { return map_; }
  std::vector<double> errors_deg(bool estimated_only = false) const {
    std::vector<double> out;
    map_.read([&](const Map& m) {
      for (const MapPoint& p : m.points)
        if (p.normal_estimated || !estimated_only)
          out.push_back(std::acos(std::clamp(p.normal.dot(normal_), -1.0, 1.0)) * 180.0 / M_PI);
    });
    std::sort(out.begin(), out.end());
    return out;
  }

 private:
  double depth(const Eigen::Vector3d& from, const Eigen::Vector3d& ray) const {
    return normal_.dot(Eigen::Vector3d(0, 0, 1) - from) / normal_.dot(ray);
  }

  Keyframe view(double angle, bool fixed) const {
    Keyframe kf;
    const Eigen::Matrix3d world_from_camera = Eigen::AngleAxisd(-angle, Eigen::Vector3d::UnitY()).toRotationMatrix();
    const Eigen::Vector3d centre = Eigen::Vector3d(0, 0, 1) - world_from_camera.col(2);
    kf.camera_from_world = RigidTransform{world_from_camera, centre}.inverse();
    kf.fixed = fixed;
    GreyImage image(camera().height(), camera().width());
    constexpr int kOver = 3;
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        double sum = 0;
        for (int s = 0; s < kOver * kOver; ++s) {
          Eigen::Vector3d ray;
          camera().unproject({x + (s % kOver - 1) / 3.0, y + (s / kOver - 1) / 3.0}, &ray);
          ray = world_from_camera * ray;
          const Eigen::Vector3d p = centre + depth(centre, ray) * ray;
          const Eigen::Vector3d along = Eigen::Vector3d::UnitY().cross(normal_);
          const double u = p.dot(along) * 300 + 256, v = p.y() * 300 + 256;
          const int iu = static_cast<int>(std::floor(u)), iv = static_cast<int>(std::floor(v));
          const double fu = u - iu, fv = v - iv;
          const auto at = [&](int i, int j) { return static_cast<double>(texture_(j & 511, i & 511)); };
          sum += (1 - fv) * ((1 - fu) * at(iu, iv) + fu * at(iu + 1, iv)) +
                 fv * ((1 - fu) * at(iu, iv + 1) + fu * at(iu + 1, iv + 1));
        }
        image(y, x) = cv::saturate_cast<std::uint8_t>(sum / (kOver * kOver));
      }
    }
    auto images = std::make_shared<FrameImages>();
    build_pyramid(image, &images->pyramid);
    kf.images = images;
    return kf;
  }

  void add_point(Map* m, const Keyframe& source, const Eigen::Vector2d& pixel) {
    MapPoint p;
    ASSERT_TRUE(set_source(&p, source.id, 0, pixel, camera()));
    const RigidTransform world_from_source = source.camera_from_world.inverse();
    const Eigen::Vector3d ray = world_from_source.R * p.source_rays.col(0);
    p.position = world_from_source.t + depth(world_from_source.t, ray) * ray;
    p.normal = -ray.normalized();
    const PointId id = m->points.insert(p);
    for (const Keyframe& kf : m->keyframes) {
      Measurement x;
      x.point = id;
      if (!camera().project(kf.camera_from_world * p.position, &x.pixel) || !camera().in_image(x.pixel, 12)) continue;
      if (kf.id == source.id) x.source = MeasurementSource::root;
      m->add_measurement(kf.id, x);
    }
  }

  Eigen::Vector3d normal_;
  cv::Mat1f texture_;
  SharedMap map_;
};

TEST(PatchSlope, SlopeAndNormalAreInverse) {
  Eigen::Matrix3d rays;
  rays << 0.2, 0.204, 0.2, -0.1, -0.1, -0.096, 1, 1, 1;
  const Eigen::Vector3d n = Eigen::Vector3d(0.5, -0.3, -0.8).normalized();
  EXPECT_LT((normal_of_slope(rays, slope_of_normal(rays, n)) - n).norm(), 1e-9);
  EXPECT_LT((slope_of_normal(rays, normal_of_slope(rays, {0.002, -0.003})) - Eigen::Vector2d(0.002, -0.003)).norm(),
            1e-9);
}

TEST(NormalEstimation, FindsTheSlantOfATexturedPlane) {
  for (double tilt : {0.7, -0.5, 0.0}) {
    SlantedPlane scene(tilt, {0, 0.12, -0.15, 0.25, -0.28});
    NormalEstimation estimation(camera());
    const auto changed = estimation.estimate(&scene.map(), {});
    const std::vector<double> errors = scene.errors_deg(true);
    ASSERT_GT(errors.size(), 100U);
    EXPECT_LT(testing::median(errors), 5.0) << "inclined by " << tilt;
    EXPECT_LT(errors[errors.size() * 9 / 10], 12.0) << "inclined by " << tilt;
    if (tilt != 0.0) {
      EXPECT_GT(changed.size(), 100U);
    }
    EXPECT_TRUE(estimation.estimate(&scene.map(), {}).empty()) << "nothing new is known";
  }
}

// Without neighbours or a plane to copy: the refinement from the images alone.
TEST(NormalEstimation, TheImagesAloneSayIt) {
  SlantedPlane scene(0.6, {0, 0.15, -0.2, 0.28});
  scene.map().write([](Map& m) {
    std::vector<PointId> drop;
    for (const MapPoint& p : m.points)
      if (p.id.index % 9 != 0) drop.push_back(p.id);
    for (PointId id : drop) m.erase_point(id);
  });
  const double before = testing::median(scene.errors_deg());
  EXPECT_GT(before, 20.0);
  EXPECT_GT(estimate_normals(&scene.map(), camera(), {}), 5);
  EXPECT_LT(testing::median(scene.errors_deg(true)), 5.0);
}

TEST(NormalEstimation, LeavesPointsWithTooLittleBaseline) {
  SlantedPlane scene(0.7, {0, 0.02, -0.03, 0.04});
  const std::vector<double> before = scene.errors_deg();
  EXPECT_EQ(estimate_normals(&scene.map(), camera(), {}), 0);
  EXPECT_EQ(scene.errors_deg(), before);
  EXPECT_TRUE(scene.errors_deg(true).empty());
}

TEST(NormalEstimation, StopsWhenAskedAndGoesOnLater) {
  SlantedPlane scene(0.7, {0, 0.12, -0.15, 0.25});
  NormalEstimation estimation(camera());
  std::stop_source stop;
  stop.request_stop();
  EXPECT_TRUE(estimation.estimate(&scene.map(), stop.get_token()).empty());
  EXPECT_TRUE(scene.errors_deg(true).empty());
  EXPECT_GT(estimation.estimate(&scene.map(), {}).size(), 100U);
}

TEST(Remeasure, BringsMeasurementsBackWithTheTrueNormal) {
  SlantedPlane scene(0.6, {0, 0.15, -0.2, 0.28});
  const std::vector<PointId> changed = NormalEstimation(camera()).estimate(&scene.map(), {});
  ASSERT_GT(changed.size(), 50U);
  const auto errors = [&] {
    std::vector<double> out;
    scene.map().read([&](const Map& m) {
      for (PointId id : changed)
        for (KeyframeId kf : m.points.at(id).observers) {
          Eigen::Vector2d px;
          camera().project(m.keyframes.at(kf).camera_from_world * m.points.at(id).position, &px);
          if (kf != m.points.at(id).source) out.push_back((m.keyframes.at(kf).find(id)->pixel - px).norm());
        }
    });
    std::sort(out.begin(), out.end());
    return out;
  };
  scene.map().write([&](Map& m) {
    for (PointId id : changed)
      for (KeyframeId kf : m.points.at(id).observers)
        if (kf != m.points.at(id).source) m.keyframes.at(kf).find(id)->pixel += Eigen::Vector2d(0.5, -0.3);
  });
  EXPECT_GT(testing::median(errors()), 0.5);
  EXPECT_GT(remeasure_points(&scene.map(), camera(), MapperOptions(), changed, {}), 50);
  EXPECT_LT(testing::median(errors()), 0.1);
}

}  // namespace
}  // namespace parallax
