// check_consistency() finds each kind of fault, by breaking a sound map on purpose.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <string>

#include "tests/map/fabricated_map.h"

namespace parallax {
namespace {

using test::fabricate_map;
using test::FabricatedMap;
using test::flat_camera;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

struct Break {
  const char* name;
  std::function<void(FabricatedMap*)> make;
  const char* expected;  // part of a reported line
};

Keyframe& keyframe(FabricatedMap* f, int i) { return f->map.keyframes.at(f->keyframes[i]); }
MapPoint& point(FabricatedMap* f, int i) { return f->map.points.at(f->points[i]); }

const Break kBreaks[] = {
    {"pose_scaled", [](FabricatedMap* f) { keyframe(f, 1).camera_from_world.R *= 1.01; }, "keyframe 1: pose"},
    {"pose_mirrored", [](FabricatedMap* f) { keyframe(f, 1).camera_from_world.R.col(0) *= -1; }, "keyframe 1: pose"},
    {"pose_not_finite", [](FabricatedMap* f) { keyframe(f, 2).camera_from_world.t.x() = kNan; }, "keyframe 2: pose"},
    {"rotation_not_finite", [](FabricatedMap* f) { keyframe(f, 2).camera_from_world.R(0, 0) = kNan; },
     "keyframe 2: pose"},
    {"images_missing", [](FabricatedMap* f) { keyframe(f, 0).images = nullptr; }, "keyframe 0: images"},
    {"images_of_another_size", [](FabricatedMap* f) { keyframe(f, 2).images = test::noise_images(160, 120, 1); },
     "keyframe 2: images"},
    {"depth_zero", [](FabricatedMap* f) { keyframe(f, 1).mean_depth = 0; }, "keyframe 1: depth"},
    {"depth_not_finite", [](FabricatedMap* f) { keyframe(f, 1).mean_depth = kNan; }, "keyframe 1: depth"},
    {"measurements_unsorted",
     [](FabricatedMap* f) { std::swap(keyframe(f, 1).measurements[2], keyframe(f, 1).measurements[5]); }, "not sorted"},
    {"measurement_twice",
     [](FabricatedMap* f) {
       auto& list = keyframe(f, 1).measurements;
       list.insert(list.begin(), list.front());
     },
     "not sorted"},
    {"measurement_of_no_point", [](FabricatedMap* f) { f->map.points.erase(f->points[6]); }, "which is not there"},
    {"measurement_not_listed", [](FabricatedMap* f) { point(f, 3).observers.pop_back(); }, "which does not list it"},
    {"measurement_level", [](FabricatedMap* f) { keyframe(f, 0).measurements[3].level = kPyramidLevels; },
     "out of range"},
    {"measurement_level_negative", [](FabricatedMap* f) { keyframe(f, 0).measurements[3].level = -1; }, "out of range"},
    {"measurement_sigma", [](FabricatedMap* f) { keyframe(f, 0).measurements[3].sigma_px = 0; }, "out of range"},
    {"measurement_not_finite", [](FabricatedMap* f) { keyframe(f, 0).measurements[3].pixel.y() = kNan; },
     "out of range"},
    {"measurement_outside", [](FabricatedMap* f) { keyframe(f, 0).measurements[3].pixel.x() = 330; }, "out of range"},
    {"position_not_finite", [](FabricatedMap* f) { point(f, 4).position.x() = kNan; }, "point 4: position"},
    {"normal_length", [](FabricatedMap* f) { point(f, 4).normal *= 1.1; }, "point 4: normal"},
    {"normal_not_finite", [](FabricatedMap* f) { point(f, 4).normal.x() = kNan; }, "point 4: normal"},
    {"observers_unsorted", [](FabricatedMap* f) { std::swap(point(f, 4).observers[0], point(f, 4).observers[2]); },
     "point 4: lists not sorted"},
    {"observers_twice",
     [](FabricatedMap* f) { point(f, 4).observers.insert(point(f, 4).observers.begin(), f->keyframes[0]); },
     "point 4: lists not sorted"},
    {"observer_gone",
     [](FabricatedMap* f) {
       point(f, 4).observers.push_back({0, 55});
     },
     "lists keyframe 55, which is not there"},
    {"observer_does_not_measure",
     [](FabricatedMap* f) {
       auto& list = keyframe(f, 2).measurements;
       list.erase(list.begin() + 4);
     },
     "lists keyframe 2, which does not measure it"},
    {"measured_and_failed", [](FabricatedMap* f) { point(f, 4).failed.push_back(f->keyframes[1]); },
     "both measured and failed"},
    {"failed_keyframe_gone",
     [](FabricatedMap* f) {
       point(f, 4).failed.push_back({0, 55});
     },
     "keyframe 55"},
    {"source_gone",
     [](FabricatedMap* f) {
       point(f, 4).source = {0, 55};
     },
     "source keyframe 55"},
    {"source_level", [](FabricatedMap* f) { point(f, 4).source_level = kPyramidLevels; }, "source level"},
    {"source_outside", [](FabricatedMap* f) { point(f, 4).source_pixel.x() = 320; }, "source pixel outside"},
    {"source_not_finite", [](FabricatedMap* f) { point(f, 4).source_pixel.x() = kNan; }, "source pixel outside"},
    {"behind_its_source", [](FabricatedMap* f) { point(f, 4).position.z() = -1; }, "lies behind its source"},
    {"plane_not_rigid", [](FabricatedMap* f) { f->map.plane->world_from_plane.R *= 2; }, "plane"},
    {"plane_not_finite", [](FabricatedMap* f) { f->map.plane->world_from_plane.t.z() = kNan; }, "plane"},
    {"plane_without_extent", [](FabricatedMap* f) { f->map.plane->extent_m = 0; }, "plane"},
};

class ConsistencyTest : public ::testing::TestWithParam<Break> {};

TEST_P(ConsistencyTest, FaultIsFound) {
  FabricatedMap f = fabricate_map();
  ASSERT_TRUE(check_consistency(f.map, flat_camera()).empty());
  GetParam().make(&f);
  const auto found = check_consistency(f.map, flat_camera());
  ASSERT_FALSE(found.empty());
  bool named = false;
  std::string all;
  for (const std::string& line : found) {
    named = named || line.find(GetParam().expected) != std::string::npos;
    all += line + "\n";
    EXPECT_EQ(line.find('\n'), std::string::npos);
  }
  EXPECT_TRUE(named) << all;
}

INSTANTIATE_TEST_SUITE_P(Breaks, ConsistencyTest, ::testing::ValuesIn(kBreaks),
                         [](const auto& instance) { return instance.param.name; });

TEST(Consistency, ReportsAreBounded) {
  FabricatedMap f = fabricate_map(12);
  for (int i = 0; i < 12; ++i) f.map.points.erase(f.points[i]);  // 36 dangling measurements
  EXPECT_EQ(check_consistency(f.map, flat_camera()).size(), 20U);
}

}  // namespace
}  // namespace parallax
