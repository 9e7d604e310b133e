#include "tracker/patch_search.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "tests/support/rendered_views.h"
#include "tests/tracker/planar_scene.h"

namespace parallax {
namespace {

using test::apply;
using test::features_of;
using test::PlanarScene;
using test::similarity;

// A plane seen by one keyframe; points at its best corners on levels 0 to 2.
struct PlaneMap {
  std::shared_ptr<TrackingSnapshot> map = std::make_shared<TrackingSnapshot>();
  PlanarScene scene{640, 480, 11};

  PlaneMap() {
    SnapshotKeyframe kf;
    kf.id = {0, 0};
    kf.images = features_of(scene.render(Eigen::Matrix3d::Identity()));
    for (int level = 0; level < 3; ++level) {
      const GreyImage& image = kf.images->pyramid.level[static_cast<std::size_t>(level)];
      int made = 0;
      for (const Corner& c : maximal_corners(image, kf.images->corners[static_cast<std::size_t>(level)])) {
        const int border = 60 >> level;
        if (c.x < border || c.y < border || c.x >= image.cols - border || c.y >= image.rows - border) continue;
        if (shi_tomasi_score(image, c.x, c.y) < 60 || ++made % 4 != 0) continue;
        map->id.push_back({0, map->size()});
        map->source.push_back(0);
        map->source_level.push_back(static_cast<std::uint8_t>(level));
        map->source_pixel.emplace_back(c.x, c.y);
      }
    }
    map->keyframes.push_back(std::move(kf));
  }

  Eigen::Vector2d level0(int row) const {
    const auto i = static_cast<std::size_t>(row);
    return level_to_level0(map->source_pixel[i].cast<double>(), map->source_level[i]);
  }

  // The candidate that an exact pose would give, moved by `error`.
  Candidate candidate(int row, const Eigen::Matrix3d& H, const Eigen::Vector2d& error) const {
    const Eigen::Vector2d p = level0(row);
    Candidate c;
    c.row = row;
    constexpr double h = 1e-3;
    for (int k = 0; k < 2; ++k) {
      Eigen::Vector2d d = Eigen::Vector2d::Zero();
      d[k] = h;
      c.warp.col(k) = (apply(H, p + d) - apply(H, p - d)) / (2 * h);
    }
    c.warp *= level_scale(map->source_level[static_cast<std::size_t>(row)]);
    c.level = static_cast<std::int8_t>(target_level(c.warp.determinant()));
    c.pixel = apply(H, p) + error;
    return c;
  }
};

const PlaneMap& plane_map() {
  static const PlaneMap m;
  return m;
}

std::vector<Eigen::Matrix3d> warps() {
  const Eigen::Vector2d c = plane_map().scene.centre();
  return {similarity(c, 0.0, 1.0, {3.37, -2.61}), similarity(c, 0.5, 1.25, {-4.4, 6.7}),
          similarity(c, -0.9, 0.75, {5.15, 2.25}, {2e-4, -1e-4}), similarity(c, 0.15, 2.1, {1.3, 0.4})};
}

TEST(PatchSearch, FindsPointsToAFractionOfAPixelInWarpedViews) {
  const PlaneMap& m = plane_map();
  ASSERT_GT(m.map->size(), 80);
  for (const Eigen::Matrix3d& H : warps()) {
    const auto frame = features_of(m.scene.render(H, 1.05, 4, 1.5));
    PatchSearch search{TrackerOptions()};
    int tried = 0, found = 0, right = 0;
    std::vector<double> errors;
    for (int row = 0; row < m.map->size(); ++row) {
      const Candidate c = m.candidate(row, H, {2.5, -2.0});
      const Eigen::Vector2d truth = apply(H, m.level0(row));
      if (c.level < 0 || truth.x() < 50 || truth.y() < 50 || truth.x() > 590 || truth.y() > 430) continue;
      ++tried;
      const PatchMatch match = search.find(*m.map, c, *frame, 8, true);
      if (!match.found) continue;
      ++found;
      EXPECT_EQ(match.sigma_px, level_scale(c.level));
      const double error = (match.pixel - truth).norm() / level_scale(c.level);
      errors.push_back(error);
      right += error < 1.0 ? 1 : 0;
    }
    ASSERT_GT(tried, 30);
    EXPECT_GT(found, 0.8 * tried);
    EXPECT_GT(right, 0.95 * found);
    std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2), errors.end());
    EXPECT_LT(errors[errors.size() / 2], 0.12) << "pixels of the level, median";
  }
}

TEST(PatchSearch, FindsNothingInAnImageOfSomethingElse) {
  const PlaneMap& m = plane_map();
  const Eigen::Matrix3d H = warps()[0];
  const PlanarScene other(640, 480, 77);
  const auto other_frame = features_of(other.render(H));
  const auto blank = features_of(GreyImage(480, 640, static_cast<std::uint8_t>(90)));
  PatchSearch search{TrackerOptions()};
  int wrong = 0;
  for (int row = 0; row < m.map->size(); ++row) {
    const Candidate c = m.candidate(row, H, {1, 1});
    EXPECT_FALSE(search.find(*m.map, c, *blank, 8, true).found);
    wrong += search.find(*m.map, c, *other_frame, 8, true).found ? 1 : 0;
  }
  EXPECT_LT(wrong, 0.12 * m.map->size());
}

TEST(PatchSearch, RadiusIsALimit) {
  const PlaneMap& m = plane_map();
  const Eigen::Matrix3d H = warps()[0];
  const auto frame = features_of(m.scene.render(H));
  PatchSearch search{TrackerOptions()};
  int near = 0, far = 0;
  for (int row = 0; row < m.map->size(); ++row) {
    const Candidate c = m.candidate(row, H, {14, 0});
    const Eigen::Vector2d truth = apply(H, m.level0(row));
    const PatchMatch wide = search.find(*m.map, c, *frame, 30, false);
    near += wide.found && (wide.pixel - truth).norm() < 1.5 * level_scale(c.level) ? 1 : 0;
    const PatchMatch narrow = search.find(*m.map, c, *frame, 5, false);
    if (narrow.found) {
      EXPECT_LE((narrow.pixel - c.pixel).norm(), 5 + 2 * level_scale(c.level));
    }
    far += narrow.found && (narrow.pixel - truth).norm() < 1.0 ? 1 : 0;
  }
  EXPECT_GT(near, 0.7 * m.map->size());
  EXPECT_EQ(far, 0);
}

TEST(PatchSearch, AlignsDirectlyWhereThereIsNoCorner) {
  const PlaneMap& m = plane_map();
  const Eigen::Matrix3d H = warps()[0];
  FrameImages frame = *features_of(m.scene.render(H));
  for (int level = 0; level < kPyramidLevels; ++level) {
    frame.corners[static_cast<std::size_t>(level)].corners.clear();
    for (int& r : frame.corners[static_cast<std::size_t>(level)].rows) r = 0;
  }
  PatchSearch search{TrackerOptions()};
  int found = 0;
  for (int row = 0; row < m.map->size(); ++row) {
    const Candidate c = m.candidate(row, H, {0.5, 0.4});
    EXPECT_FALSE(search.find(*m.map, c, frame, 8, false).found);
    const PatchMatch match = search.find(*m.map, c, frame, 8, true);
    found += match.found && (match.pixel - apply(H, m.level0(row))).norm() < 0.3 * level_scale(c.level) ? 1 : 0;
  }
  EXPECT_GT(found, 0.8 * m.map->size());
}

// The cache is seen from outside by taking the source's pixels away: a kept template still finds its point.
TEST(PatchSearch, TemplatesAreKeptUntilWarpOrSourceChange) {
  const PlaneMap& m = plane_map();
  const Eigen::Matrix3d H = warps()[1];
  const auto frame = features_of(m.scene.render(H));
  TrackingSnapshot bare = *m.map;
  bare.keyframes[0].images = features_of(GreyImage(480, 640, static_cast<std::uint8_t>(90)));
  const auto count = [&](PatchSearch* search, const TrackingSnapshot& map, double stretch) {
    int found = 0;
    for (int row = 0; row < map.size(); ++row) {
      Candidate c = m.candidate(row, H, {1, 1});
      if (c.level < 0) continue;
      c.warp *= stretch;
      found += search->find(map, c, *frame, 8, true).found ? 1 : 0;
    }
    return found;
  };
  PatchSearch search{TrackerOptions()};
  const int fresh = count(&search, *m.map, 1.0);
  ASSERT_GT(fresh, 30);
  EXPECT_EQ(count(&search, bare, 1.0), fresh) << "made once, used again";
  EXPECT_EQ(count(&search, bare, 1.002), fresh) << "a hair's change is not worth a new template";
  TrackingSnapshot moved = bare;
  moved.keyframes[0].id = {0, 1};
  EXPECT_EQ(count(&search, moved, 1.0), 0) << "another source keyframe";

  EXPECT_EQ(count(&search, *m.map, 1.0), fresh);
  EXPECT_EQ(count(&search, bare, 1.1), 0) << "another warp";
  EXPECT_EQ(count(&search, *m.map, 1.0), fresh);
  search.clear();
  EXPECT_EQ(count(&search, bare, 1.0), 0) << "another map";
}

}  // namespace
}  // namespace parallax
