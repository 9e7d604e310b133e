// CameraModel::project_batch against project(), at every instruction set this processor has.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include "camera_model_cases.h"
#include "core/camera_model.h"
#include "core/cpu_dispatch.h"

namespace parallax {
namespace {

struct Points {
  std::vector<float> x, y, z;
  void add(double a, double b, double c) {
    x.push_back(static_cast<float>(a));
    y.push_back(static_cast<float>(b));
    z.push_back(static_cast<float>(c));
  }
  Eigen::Vector3d at(std::size_t i) const { return {x[i], y[i], z[i]}; }
};

struct Projected {
  std::vector<float> u, v;
  std::vector<unsigned char> visible;
};

Projected project(const CameraModel& camera, const Points& p, float border) {
  const std::size_t n = p.x.size();
  Projected out{std::vector<float>(n + 1, -99), std::vector<float>(n + 1, -99), std::vector<unsigned char>(n + 1, 77)};
  camera.project_batch(p.x.data(), p.y.data(), p.z.data(), static_cast<int>(n), border, out.u.data(), out.v.data(),
                       out.visible.data());
  EXPECT_EQ(out.u.back(), -99) << "wrote past the end";
  EXPECT_EQ(out.visible.back(), 77) << "wrote past the end";
  return out;
}

Points scattered_points() {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  Points p;
  for (int i = 0; i < 20011; ++i) {
    const double depth = std::exp(normal(random)), spread = i % 3 == 0 ? 4 : 0.7;
    p.add(depth * spread * normal(random), depth * spread * normal(random), i % 17 == 0 ? -depth : depth);
  }
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  for (const float bad : {nan, inf, -inf, 0.0f}) {
    p.add(bad, 0.1, 1);
    p.add(0.1, bad, 1);
    p.add(0.1, 0.1, bad);
    p.add(bad, bad, bad);
  }
  for (const double small : {0.0, 1e-30, 1e-20, 1e-12, 1e-6, 1e-3}) p.add(small, -small, 1);
  p.add(0, 0, -1);
  p.add(1e15, 1e15, 1e-15);
  return p;
}

class LevelGuard {
 public:
  LevelGuard() : before_(simd_level()) {}
  ~LevelGuard() { set_simd_level(before_); }

 private:
  SimdLevel before_;
};

TEST(CameraModelBatch, AgreesWithProjectWithin001Pixels) {
  const LevelGuard guard;
  const Points points = scattered_points();
  for (const auto& [name, camera] : testing::camera_cases()) {
    for (const float border : {0.0f, 8.5f, -12.0f, -200.0f}) {
      for (const SimdLevel level : {SimdLevel::kScalar, SimdLevel::kAvx2, SimdLevel::kAvx512}) {
        set_simd_level(level);
        const Projected out = project(camera, points, border);
        int visible = 0;
        for (std::size_t i = 0; i < points.x.size(); ++i) {
          const Eigen::Vector3d p = points.at(i);
          Eigen::Vector2d pixel;
          const bool in_domain = camera.project(p, &pixel);
          const bool clearly_in = in_domain && camera.in_image(pixel, border + 0.01);
          const bool clearly_out = !in_domain || !camera.in_image(pixel, border - 0.01);
          ASSERT_LE(out.visible[i], 1);
          ASSERT_TRUE(!out.visible[i] || (std::isfinite(out.u[i]) && std::isfinite(out.v[i]))) << name;
          if (!p.allFinite()) continue;
          // A point within single precision of the end of the domain may go either way.
          Eigen::Vector2d beyond;
          const bool at_the_edge = camera.project({p.x() * 1.00001, p.y() * 1.00001, p.z()}, &beyond) !=
                                   camera.project({p.x() * 0.99999, p.y() * 0.99999, p.z()}, &beyond);
          if (clearly_in && !at_the_edge) {
            ASSERT_TRUE(out.visible[i]) << name << " " << p.transpose() << " at " << pixel.transpose();
          }
          if (clearly_out && !at_the_edge) {
            ASSERT_FALSE(out.visible[i]) << name << " border " << border << ": " << p.transpose();
          }
          if (!out.visible[i]) continue;
          ++visible;
          const double bound = camera.in_image(pixel) ? 0.01 : 0.05;
          ASSERT_NEAR(out.u[i], pixel.x(), bound) << name << " " << p.transpose();
          ASSERT_NEAR(out.v[i], pixel.y(), bound) << name << " " << p.transpose();
        }
        EXPECT_GT(visible, 2000) << name;
      }
    }
  }
}

TEST(CameraModelBatch, EveryInstructionSetGivesTheSameBits) {
  const LevelGuard guard;
  const Points points = scattered_points();
  for (const auto& [name, camera] : testing::camera_cases()) {
    set_simd_level(SimdLevel::kScalar);
    const Projected reference = project(camera, points, 4.0f);
    for (const SimdLevel level : {SimdLevel::kSse2, SimdLevel::kAvx2, SimdLevel::kAvx512}) {
      set_simd_level(level);
      const Projected out = project(camera, points, 4.0f);
      EXPECT_EQ(out.visible, reference.visible) << name;
      for (std::size_t i = 0; i < points.x.size(); ++i) {
        if (!out.visible[i]) continue;
        ASSERT_EQ(std::memcmp(&out.u[i], &reference.u[i], sizeof(float)), 0) << name << " " << i;
        ASSERT_EQ(std::memcmp(&out.v[i], &reference.v[i], sizeof(float)), 0) << name << " " << i;
      }
    }
  }
}

TEST(CameraModelBatch, EveryLengthUpToSeveralVectors) {
  const CameraModel camera(CameraModelKind::fov, 640, 480, {375, 376}, {322.3, 237.1}, {0.9}, 1);
  for (int n = 0; n <= 70; ++n) {
    Points points;
    for (int i = 0; i < n; ++i) points.add(0.01 * i - 0.3, 0.2 - 0.007 * i, 1);
    const Projected out = project(camera, points, 0);
    for (int i = 0; i < n; ++i) {
      Eigen::Vector2d pixel;
      ASSERT_TRUE(camera.project(points.at(static_cast<std::size_t>(i)), &pixel));
      ASSERT_TRUE(out.visible[static_cast<std::size_t>(i)]);
      ASSERT_NEAR(out.u[static_cast<std::size_t>(i)], pixel.x(), 0.001);
    }
  }
}

TEST(CameraModelBatch, ADefaultCameraSeesNothing) {
  Points points;
  points.add(0, 0, 1);
  EXPECT_EQ(project(CameraModel(), points, 0).visible[0], 0);
}

}  // namespace
}  // namespace parallax
