// The burning glass's light: where the focus falls, how large the sun's picture is, and that no light is lost; and the
// heat on the sheet against the solution of the heat equation.
#include "games/burning_glass_optics.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "games/burning_glass_sheet.h"

namespace parallax::burning {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;

struct Spot {
  Vector2d centre = Vector2d::Zero();
  double spread = 0, farthest = 0;  // root of the mean square and the largest distance from the centre
  int rays = 0;
};

RayEnd follow(const LightPath& path, const RayBundle& bundle, int ray, Vector2d* at) {
  return path.follow(bundle.on_lens().row(ray).cast<double>().matrix().transpose(),
                     bundle.on_sun().row(ray).cast<double>().matrix().transpose(), at);
}

Spot spot_of(const LightPath& path, int rays = 4000) {
  const RayBundle bundle(rays, 3);
  std::vector<Vector2d> hits;
  for (int i = 0; i < rays; ++i) {
    Vector2d at;
    if (follow(path, bundle, i, &at) == RayEnd::plane) hits.push_back(at);
  }
  Spot out;
  out.rays = static_cast<int>(hits.size());
  for (const Vector2d& hit : hits) out.centre += hit / out.rays;
  for (const Vector2d& hit : hits) {
    out.spread += (hit - out.centre).squaredNorm() / out.rays;
    out.farthest = std::max(out.farthest, (hit - out.centre).norm());
  }
  out.spread = std::sqrt(out.spread);
  return out;
}

double narrowest_height(Lens lens, const Vector3d& sun) {
  double best_height = 0, best_spread = 1e9;
  for (int i = 0; i < 400; ++i) {
    const double height = lens.focal_length_m * (0.8 + 0.001 * i);
    lens.centre_m.z() = height;
    const double spread = spot_of(LightPath(lens, sun), 600).spread;
    if (spread < best_spread) {
      best_spread = spread;
      best_height = height;
    }
  }
  return best_height;
}

TEST(BurningGlassOptics, FocusOfASunAlongTheAxisIsOneFocalLengthBelow) {
  for (const double focal_length : {0.15, 0.3, 0.8}) {
    Lens lens;
    lens.focal_length_m = focal_length;
    EXPECT_NEAR(narrowest_height(lens, Vector3d::UnitZ()), focal_length, 0.02 * focal_length);
    lens.centre_m = {0.01, -0.02, focal_length};
    const LightPath path(lens, Vector3d::UnitZ());
    EXPECT_LT(path.focus_m().z(), 1e-12);
    const Spot spot = spot_of(path);
    EXPECT_LT((spot.centre - Vector2d(0.01, -0.02)).norm(), 0.01 * focal_length * kSunDiameter_rad);
    // The picture of the sun: a disc, evenly bright, so the mean square distance is half the squared radius.
    const double diameter = focal_length * kSunDiameter_rad;
    EXPECT_NEAR(2 * spot.farthest, diameter, 0.02 * diameter);
    EXPECT_NEAR(2 * std::sqrt(2.0) * spot.spread, diameter, 0.02 * diameter);
  }
}

TEST(BurningGlassOptics, ObliqueSunIsFocusedOnTheChiefRay) {
  for (const double elevation : {80.0, 60.0, 40.0}) {
    for (const double azimuth : {0.0, 130.0, 250.0}) {
      const Vector3d sun = sun_direction(azimuth * kDegree, elevation * kDegree);
      // A level lens: the focal plane is level, and the focus is shifted by f / tan(elevation) from below the lens.
      Lens lens;
      lens.centre_m = {0, 0, lens.focal_length_m};
      Spot spot = spot_of(LightPath(lens, sun));
      const Vector2d expected = -lens.focal_length_m / std::tan(elevation * kDegree) *
                                Vector2d(std::cos(azimuth * kDegree), std::sin(azimuth * kDegree));
      const double picture = lens.focal_length_m * kSunDiameter_rad;
      EXPECT_LT((spot.centre - expected).norm(), 0.02 * picture) << elevation << " " << azimuth;
      // A lens that faces the sun, tilted and at the focal length along the ray: the same place on its chief ray.
      lens.axis = -sun;
      lens.centre_m = Vector3d(0.02, 0.03, 0) + lens.focal_length_m * sun;
      const LightPath facing(lens, sun);
      spot = spot_of(facing);
      EXPECT_LT((facing.focus_m() - Vector3d(0.02, 0.03, 0)).norm(), 1e-12);
      EXPECT_LT((spot.centre - Vector2d(0.02, 0.03)).norm(), 0.05 * picture / std::sin(elevation * kDegree));
      EXPECT_NEAR(2 * spot.farthest, picture / std::sin(elevation * kDegree),
                  (0.02 + 0.5 / std::tan(elevation * kDegree)) * picture / std::sin(elevation * kDegree));
    }
  }
}

TEST(BurningGlassOptics, SimpleGlassHasItsParaxialFocusAndSphericalAberration) {
  Lens lens;
  lens.shape = LensShape::simple_glass;
  lens.focal_length_m = 0.3;
  // Rays near the axis, from the sun's middle, cross where the thick lens's equation says.
  lens.centre_m.z() = 1;
  const LightPath high(lens, Vector3d::UnitZ());
  const double below = 1 - high.focus_m().z();
  EXPECT_NEAR(below, lens.focal_length_m, 0.02 * lens.focal_length_m);
  Vector2d at;
  lens.centre_m.z() = below;
  const LightPath path(lens, Vector3d::UnitZ());
  ASSERT_EQ(path.follow({0.02, 0.01}, {0, 0}, &at), RayEnd::plane);
  EXPECT_LT(at.norm(), 2e-5 * lens.focal_length_m);
  // Rays near the rim cross the axis before: for a thin lens with equal faces and parallel light Seidel's formula gives
  // a shortfall of 1.6 h^2 / f at this index (Jenkins and White, Fundamentals of Optics, section 9.4).
  const double h = lens.diameter_m / 2;
  ASSERT_EQ(path.follow({0.999, 0}, {0, 0}, &at), RayEnd::plane);
  const double shortfall = at.norm() * lens.focal_length_m / h;
  EXPECT_NEAR(shortfall / (h * h / lens.focal_length_m), 1.6, 0.25);
  // The narrowest spot lies a little inside the focus.
  const double best = narrowest_height(lens, Vector3d::UnitZ());
  EXPECT_LT(best, 0.995 * below);
  EXPECT_GT(best, 0.95 * below);
}

// Many rays at a time, in single precision, against one at a time in double.
TEST(BurningGlassOptics, RaysTogetherGoWhereEachGoesAlone) {
  const RayBundle bundle(1000, 9);  // no multiple of what is traced together
  const SheetGrid grid{0.4};
  int on_sheet = 0, reflected = 0, sky = 0;
  for (const LensShape shape : {LensShape::corrected, LensShape::simple_glass}) {
    for (const double tilt : {0.0, 0.4, 0.9, 1.5, 2.4}) {
      for (const double height : {0.03, 0.2, 0.3}) {
        Lens lens;
        lens.shape = shape;
        lens.centre_m = {0.02, 0.01, height};
        lens.axis = {0, std::sin(tilt), -std::cos(tilt)};
        const LightPath path(lens, sun_direction(0.3, 60 * kDegree));
        Vector2d middle = Vector2d::Zero();
        double ends[3] = {};
        bool all_on_sheet = true;
        for (int ray = 0; ray < bundle.size(); ++ray) {
          Vector2d at;
          const RayEnd end = follow(path, bundle, ray, &at);
          ends[static_cast<int>(end)] += 1;
          if (end != RayEnd::plane) continue;
          middle += at;
          all_on_sheet &= at.cwiseAbs().maxCoeff() < grid.half_extent_m - grid.cell_m();
        }
        LightOnSheet light;
        trace_light(path, bundle, 0, grid, &light);
        const double ray_m2 = path.power_m2() / bundle.size();
        EXPECT_NEAR(light.sky_m2, ends[1] * ray_m2, 1.01 * ray_m2);  // one may just not
        EXPECT_NEAR(light.reflected_m2, ends[2] * ray_m2, 1.01 * ray_m2);
        EXPECT_NEAR(light.on_sheet_m2 + light.beside_m2, ends[0] * ray_m2, 1.01 * ray_m2);
        sky += ends[1] > 0;
        reflected += ends[2] > 0;
        if (!all_on_sheet || ends[0] < bundle.size()) continue;
        ++on_sheet;
        Vector2d lit = Vector2d::Zero();  // sharing a ray among cells keeps its place
        double sum = 0;
        for (int row = 0; row < kSheetCells; ++row)
          for (int column = 0; column < kSheetCells; ++column) {
            const double value = light.concentration[SheetGrid::index(column, row)];
            lit += value * grid.centre_of(column, row);
            sum += value;
          }
        EXPECT_LT((lit / sum - middle / ends[0]).norm(), 1e-6);
      }
    }
  }
  EXPECT_GE(on_sheet, 6);
  EXPECT_GE(sky, 1);
  EXPECT_GE(reflected, 1);
}

TEST(BurningGlassOptics, EveryRayIsAccountedForAndEnergyIsKept) {
  const RayBundle bundle(2048, 9);
  const SheetGrid grid;
  int with_some_beside = 0, with_some_sky = 0;
  for (const LensShape shape : {LensShape::corrected, LensShape::simple_glass}) {
    for (const double elevation : {90.0, 45.0, 20.0}) {
      for (const double tilt : {0.0, 0.5, 1.2, 2.2}) {
        for (const double height : {0.05, 0.3, 0.6}) {
          Lens lens;
          lens.shape = shape;
          lens.centre_m = {0.12, 0.05, height};
          lens.axis = {0, std::sin(tilt), -std::cos(tilt)};
          const Vector3d sun = sun_direction(0.3, elevation * kDegree);
          const LightPath path(lens, sun);
          const double radius = lens.diameter_m / 2;
          const double face = (kGlassIndex - 1) / (kGlassIndex + 1);
          const double all =
              std::numbers::pi * radius * radius * std::abs(lens.axis.dot(sun)) * (1 - face * face) * (1 - face * face);
          ASSERT_NEAR(path.power_m2(), all, 1e-12);
          LightOnSheet light;
          trace_light(path, bundle, 5, grid, &light);
          ASSERT_NEAR(light.on_sheet_m2 + light.beside_m2 + light.sky_m2 + light.reflected_m2, all, 1e-6 * all);
          double sum = 0, outside = 0;
          for (int row = 0; row < kSheetCells; ++row) {
            for (int column = 0; column < kSheetCells; ++column) {
              const float value = light.concentration[SheetGrid::index(column, row)];
              const bool in_box = column >= light.box.left && column < light.box.right && row >= light.box.bottom &&
                                  row < light.box.top;
              sum += value;
              outside += in_box ? 0 : value;
            }
          }
          EXPECT_NEAR(sum * grid.cell_m() * grid.cell_m(), light.on_sheet_m2, 1e-4 * all);
          EXPECT_EQ(outside, 0);
          with_some_beside += light.beside_m2 > 0;
          with_some_sky += light.sky_m2 > 0;
          if (tilt == 0.0 && elevation == 90.0 && height == 0.3) {
            EXPECT_NEAR(light.on_sheet_m2, all, 1e-9 * all);
          }
        }
      }
    }
  }
  EXPECT_GT(with_some_beside, 0);
  EXPECT_GT(with_some_sky, 0);
}

TEST(BurningGlassOptics, LightOutOfFocusIsAnEvenDiscOfTheRightSizeAndBrightness) {
  Lens lens;
  lens.centre_m.z() = 0.15;  // half the focal length: half the width
  const SheetGrid grid;
  const RayBundle bundle(2048, 9);
  const LightPath path(lens, Vector3d::UnitZ());
  std::vector<double> sum(kSheetSize, 0.0);
  LightOnSheet light;
  const int turns = 200;
  for (int turn = 0; turn < turns; ++turn) {
    trace_light(path, bundle, static_cast<std::uint64_t>(turn), grid, &light);
    for (std::size_t i = 0; i < kSheetSize; ++i) sum[i] += light.concentration[i] / turns;
  }
  const double radius = 0.025;
  for (int row = 0; row < kSheetCells; ++row) {
    for (int column = 0; column < kSheetCells; ++column) {
      const double distance = grid.centre_of(column, row).norm();
      const double there = sum[SheetGrid::index(column, row)];
      if (distance < radius - 3 * grid.cell_m()) {
        ASSERT_NEAR(there, 4 * lens_transmission(), 0.3) << column << " " << row;
      } else if (distance > radius + 3 * grid.cell_m()) {
        ASSERT_EQ(there, 0) << column << " " << row;
      }
    }
  }
}

TEST(BurningGlassSheet, HeatSpreadsAsTheHeatEquationSays) {
  for (const Material& material : materials()) {
    Material glass = material;
    glass.ignition_k = 1e6;  // nothing chars
    Sheet sheet;
    const double before = 6, hottest = 900;  // standard deviation in cells, kelvin
    const double middle_x = 120, middle_y = 131;
    const auto gaussian = [&](double x, double y, double variance) {
      const double r2 = (x - middle_x) * (x - middle_x) + (y - middle_y) * (y - middle_y);
      return std::exp(-r2 / (2 * variance)) * before * before / variance;
    };
    std::vector<float> start(kSheetSize);
    for (int row = 0; row < kSheetCells; ++row) {
      for (int column = 0; column < kSheetCells; ++column) {
        start[SheetGrid::index(column, row)] = static_cast<float>(hottest * gaussian(column, row, before * before));
      }
    }
    sheet.set_temperature(start);
    const double interval = 1.0 / 120;
    const int steps = 60;
    for (int i = 0; i < steps; ++i) sheet.advance(glass, nullptr, 1, interval);
    const double time = steps * interval;
    const double diffusivity = glass.diffusivity * (kSheetCells / 2.0) * (kSheetCells / 2.0);  // cells^2 / s
    const double after = before * before + 2 * diffusivity * time;
    const double left = std::exp(-glass.cooling_per_s * time);
    for (int row = 60; row < 200; ++row) {
      for (int column = 60; column < 200; ++column) {
        const double exact = hottest * left * gaussian(column, row, after);
        ASSERT_NEAR(sheet.temperature_k()[SheetGrid::index(column, row)], exact,
                    0.04 * hottest * left * before * before / after)
            << material.name;
      }
    }
    const double peak = sheet.temperature_k()[SheetGrid::index(120, 131)];
    EXPECT_NEAR(peak, hottest * left * before * before / after, 0.03 * peak) << material.name;
  }
}

TEST(BurningGlassSheet, LongStepsAreCutBelowTheStabilityBoundAndHeatIsKept) {
  Material material = materials()[0];
  material.ignition_k = 1e6;
  material.cooling_per_s = 0;
  material.diffusivity = 0.02;  // some forty times that of wood
  const double interval = 1.0 / 120, cells = kSheetCells / 2.0;
  EXPECT_LE(4 * material.diffusivity * cells * cells * interval / Sheet::steps_for(material, interval), 1.0);
  EXPECT_GT(Sheet::steps_for(material, interval), 1);
  Sheet sheet;
  std::vector<float> start(kSheetSize, 0.0f);
  for (int row = 0; row < 20; ++row) start[SheetGrid::index(3, row)] = 1000;  // by the border: none crosses it
  sheet.set_temperature(start);
  for (int i = 0; i < 60; ++i) {
    sheet.advance(material, nullptr, 1, interval);
    const auto& now = sheet.temperature_k();
    ASSERT_TRUE(std::all_of(now.begin(), now.end(), [](float value) { return value >= 0 && value <= 1000; }));
  }
  const double sum = std::accumulate(sheet.temperature_k().begin(), sheet.temperature_k().end(), 0.0);
  EXPECT_NEAR(sum, 20 * 1000, 0.005 * 20 * 1000);
}

}  // namespace
}  // namespace parallax::burning
