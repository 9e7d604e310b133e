#include "map/tracking_snapshot.h"

#include <gtest/gtest.h>

#include "tests/map/fabricated_map.h"

namespace parallax {
namespace {

using test::fabricate_map;
using test::FabricatedMap;

TEST(TrackingSnapshot, HoldsEveryPointInOrderOfAge) {
  FabricatedMap f = fabricate_map();
  f.map.erase_point(f.points[2]);
  f.map.points.at(f.points[4]).normal = Eigen::Vector3d(1, 0, 0);  // edge-on from its source
  const auto s = make_snapshot(f.map);
  ASSERT_EQ(s->size(), f.map.points.size());
  ASSERT_EQ(s->keyframes.size(), 3U);
  int row = 0;
  for (const MapPoint& p : f.map.points) {
    const auto i = static_cast<std::size_t>(row++);
    EXPECT_EQ(s->id[i], p.id);
    EXPECT_EQ(s->position[i], p.position);
    EXPECT_EQ(s->x[i], static_cast<float>(p.position.x()));
    EXPECT_EQ(s->y[i], static_cast<float>(p.position.y()));
    EXPECT_EQ(s->z[i], static_cast<float>(p.position.z()));
    EXPECT_EQ(s->nx[i], static_cast<float>(p.normal.x()));
    EXPECT_EQ(s->ny[i], static_cast<float>(p.normal.y()));
    EXPECT_EQ(s->nz[i], static_cast<float>(p.normal.z()));
    EXPECT_EQ(s->keyframes[static_cast<std::size_t>(s->source[i])].id, p.source);
    EXPECT_EQ(s->source_level[i], p.source_level);
    EXPECT_EQ(s->source_pixel[i], p.source_pixel.cast<float>());
    EXPECT_EQ(s->quality[i], p.observers.size());
    Eigen::Matrix<double, 3, 2> axes;
    if (patch_axes(p, f.map.keyframes.at(p.source).camera_from_world, &axes)) {
      EXPECT_NEAR((s->axes[i] - axes.cast<float>()).norm(), 0, 1e-9);
    } else {
      EXPECT_EQ(p.id, f.points[4]);
      EXPECT_EQ(s->axes[i].norm(), 0);
    }
  }
  ASSERT_TRUE(s->plane.has_value());
  EXPECT_EQ(s->plane->extent_m, f.map.plane->extent_m);
}

TEST(TrackingSnapshot, RowsOfKeyframesFollowRemovals) {
  FabricatedMap f = fabricate_map();
  // All points of the first keyframe go, then the keyframe: the second becomes row 0.
  for (int i = 0; i < 11; ++i) f.map.erase_point(f.points[i]);
  f.map.erase_keyframe(f.keyframes[0]);
  const auto s = make_snapshot(f.map);
  ASSERT_EQ(s->keyframes.size(), 2U);
  ASSERT_EQ(s->size(), 1);
  EXPECT_EQ(s->source[0], 0);
  EXPECT_EQ(s->keyframes[0].id, f.keyframes[1]);
  EXPECT_EQ(s->keyframes[0].images, f.map.keyframes.at(f.keyframes[1]).images) << "shared, not copied";
  EXPECT_NEAR((s->keyframes[0].centre - f.map.keyframes.at(f.keyframes[1]).centre()).norm(), 0, 1e-15);
}

TEST(TrackingSnapshot, OfAnEmptyMap) {
  const auto s = make_snapshot(Map());
  EXPECT_TRUE(s->empty());
  EXPECT_EQ(s->size(), 0);
  EXPECT_FALSE(s->plane.has_value());
}

}  // namespace
}  // namespace parallax
