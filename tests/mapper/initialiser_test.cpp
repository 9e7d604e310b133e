#include "mapper/initialiser.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "mapper/map_planes.h"
#include "tests/mapper/desk_fixture.h"

namespace parallax {
namespace {

using test::desk_views;

// What the tracker sends for two views, with Gaussian noise instead of its tracking.
InitialisationRequest request_for(test::RenderedViews* views, int first, int second, double noise_px,
                                  int max_matches = 500) {
  InitialisationRequest r;
  r.first_frame = first;
  r.second_frame = second;
  r.first_time = views->time_of(first);
  r.second_time = views->time_of(second);
  r.first = views->images(first);
  r.second = views->images(second);
  std::mt19937 rng(4);
  std::normal_distribution<double> noise(0, std::max(noise_px, 1e-9));
  const GreyImage& image = r.first->pyramid.level[0];
  int trail = 0;
  std::vector<Corner> corners = maximal_corners(image, r.first->corners[0]);
  std::shuffle(corners.begin(), corners.end(), rng);  // from all over the image
  for (const Corner& c : corners) {
    if (static_cast<int>(r.matches.size()) >= max_matches) break;
    if (shi_tomasi_score(image, c.x, c.y) < 40) continue;
    ++trail;
    const auto place = views->seen(first, {c.x, c.y});
    const auto px = place ? views->project_visible(second, *place) : std::nullopt;
    if (px) r.matches.push_back({trail, {c.x, c.y}, *px + Eigen::Vector2d(noise(rng), noise(rng))});
  }
  return r;
}

InitialisationReply initialise(SharedMap* map, const InitialisationRequest& r, const CameraModel& camera) {
  std::mt19937_64 rng(1);
  return initialise_map(map, camera, MapperOptions(), r, &rng);
}

TEST(Initialiser, MakesATrueMapTenCentimetresWide) {
  SharedMap shared;
  const InitialisationRequest request = request_for(&desk_views(), 2, 5, 0.15);
  ASSERT_GT(request.matches.size(), 150U);
  const InitialisationReply reply = initialise(&shared, request, desk_views().camera());
  ASSERT_TRUE(reply.ok) << reply.reason;
  const Map map = test::copy_of(shared);
  EXPECT_EQ(test::faults(map, desk_views().camera()), "");
  ASSERT_EQ(map.keyframes.size(), 2);
  const Keyframe &a = map.keyframes.at({0, 0}), &b = map.keyframes.at({0, 1});
  EXPECT_TRUE(a.fixed);
  EXPECT_FALSE(b.fixed);
  EXPECT_EQ(a.frame, 2);
  EXPECT_EQ(b.frame, 5);
  EXPECT_EQ(a.time, request.first_time);
  EXPECT_NEAR((a.centre() - b.centre()).norm(), 0.1, 1e-9) << "PTAM 6.1: the camera translated 10 cm";
  EXPECT_EQ(reply.second_from_world.t, b.camera_from_world.t);

  // The relative pose is right, up to scale.
  const RigidTransform made = b.camera_from_world * a.camera_from_world.inverse();
  const RigidTransform truth = desk_views().camera_from_world(5) * desk_views().camera_from_world(2).inverse();
  EXPECT_LT(log_so3(made.R * truth.R.transpose()).norm(), 0.006);
  EXPECT_GT(made.t.normalized().dot(truth.t.normalized()), std::cos(0.04));

  // Points: aligned with where they truly are.
  std::vector<Eigen::Vector3d> mine, true_place;
  for (const MapPoint& p : map.points) {
    const int view = p.source == a.id ? 2 : 5;
    const auto place = desk_views().seen(view, level_to_level0(p.source_pixel, p.source_level));
    if (!place) continue;
    mine.push_back(p.position);
    true_place.push_back(*place);
  }
  ASSERT_GT(mine.size(), 200U) << "epipolar search adds to the trails";
  Eigen::Matrix3Xd src(3, mine.size()), dst(3, mine.size());
  for (std::size_t i = 0; i < mine.size(); ++i) {
    src.col(static_cast<Eigen::Index>(i)) = mine[i];
    dst.col(static_cast<Eigen::Index>(i)) = true_place[i];
  }
  SimilarityTransform true_from_map;
  ASSERT_TRUE(align_points(src, dst, true, &true_from_map));
  EXPECT_NEAR(true_from_map.s, 1.2, 0.06) << "12 cm in truth";
  std::vector<double> errors, height;
  for (std::size_t i = 0; i < mine.size(); ++i) {
    errors.push_back((true_from_map * mine[i] - true_place[i]).norm());
    if (std::abs(true_place[i].z()) < 1e-6) height.push_back(mine[i].z());
  }
  std::sort(errors.begin(), errors.end());
  // A standard deviation of 0.15 px at both ends is worth 6 mm of depth at 0.8 m.
  EXPECT_LT(errors[errors.size() / 2], 0.012);

  // The table top is z = 0, seen from above.
  EXPECT_GT((true_from_map.R * Eigen::Vector3d::UnitZ()).z(), 0.985);
  ASSERT_TRUE(map.plane.has_value());
  EXPECT_NEAR((map.plane->world_from_plane.R - Eigen::Matrix3d::Identity()).norm(), 0, 1e-9);
  EXPECT_NEAR(map.plane->world_from_plane.t.norm(), 0, 1e-9);
  EXPECT_GT(map.plane->extent_m, 0.1);
  EXPECT_LT(map.plane->extent_m, 2.0);
  EXPECT_GT(a.centre().z(), 0.2);
  ASSERT_GT(height.size(), 40U);
  std::sort(height.begin(), height.end());
  double sum2 = 0;
  const std::size_t drop = height.size() / 20;
  for (std::size_t i = drop; i < height.size() - drop; ++i) sum2 += height[i] * height[i];
  EXPECT_LT(std::sqrt(sum2 / static_cast<double>(height.size() - 2 * drop)), 0.025)
      << "metres of the map, nine tenths of the points; things lie on the table";

  // Every trail named belongs to a point where it began.
  EXPECT_GT(reply.point_of_trail.size(), 0.7 * static_cast<double>(request.matches.size()));
  std::map<int, Eigen::Vector2d> first_of;
  for (const TrailMatch& m : request.matches) first_of[m.trail] = m.first;
  for (const auto& [trail, id] : reply.point_of_trail) EXPECT_EQ(a.find(id)->pixel, first_of.at(trail));
}

TEST(Initialiser, TheSameRequestGivesTheSameMap) {
  SharedMap one, two;
  const InitialisationRequest request = request_for(&desk_views(), 2, 5, 0.2);
  ASSERT_TRUE(initialise(&one, request, desk_views().camera()).ok);
  ASSERT_TRUE(initialise(&two, request, desk_views().camera()).ok);
  const Map a = test::copy_of(one), b = test::copy_of(two);
  ASSERT_EQ(a.points.size(), b.points.size());
  for (const MapPoint& p : a.points) EXPECT_EQ(p.position, b.points.at(p.id).position);
}

TEST(Initialiser, ReplacesAnEarlierMap) {
  SharedMap shared;
  test::set_map(&shared, test::true_map(&desk_views(), {0, 1, 2}, 10));
  const auto before = shared.snapshot()->map_version;
  ASSERT_TRUE(initialise(&shared, request_for(&desk_views(), 2, 5, 0.2), desk_views().camera()).ok);
  shared.publish();
  EXPECT_EQ(test::copy_of(shared).keyframes.size(), 2);
  EXPECT_GT(shared.snapshot()->map_version, before);
}

// A refusal has a reason for the user, and the map stays what it was.
void expect_refused(const InitialisationRequest& request, const CameraModel& camera, const char* what) {
  SharedMap shared;
  test::set_map(&shared, test::true_map(&desk_views(), {0, 1}, 5));
  const Map before = test::copy_of(shared);
  const InitialisationReply reply = initialise(&shared, request, camera);
  EXPECT_FALSE(reply.ok) << what;
  EXPECT_GT(reply.reason.size(), 15U) << what;
  EXPECT_EQ(reply.reason.find('\n'), std::string::npos);
  EXPECT_TRUE(reply.point_of_trail.empty());
  shared.publish();
  EXPECT_EQ(shared.snapshot()->map_version, 1U) << what;
  EXPECT_EQ(test::copy_of(shared).points.size(), before.points.size()) << what;
}

TEST(Initialiser, RefusesTooFewMatches) {
  InitialisationRequest few = request_for(&desk_views(), 2, 5, 0.2, 20);
  expect_refused(few, desk_views().camera(), "20 matches");
  few.matches.clear();
  expect_refused(few, desk_views().camera(), "none");
}

TEST(Initialiser, RefusesRotationAlone) {
  test::RenderedViews turning({test::above_desk(0), test::above_desk(0) * RigidTransform(exp_so3({0.02, 0.12, 0.05}),
                                                                                         Eigen::Vector3d::Zero())});
  expect_refused(request_for(&turning, 0, 1, 0.2), turning.camera(), "rotation");
}

TEST(Initialiser, RefusesACameraThatDidNotMove) {
  expect_refused(request_for(&desk_views(), 2, 2, 0.2), desk_views().camera(), "no motion");
  test::RenderedViews hardly({test::above_desk(0), test::above_desk(0.001)});
  expect_refused(request_for(&hardly, 0, 1, 0.2), hardly.camera(), "a millimetre");
}

TEST(Initialiser, RefusesMatchesThatMeanNothing) {
  InitialisationRequest r = request_for(&desk_views(), 2, 5, 0.2);
  std::mt19937 rng(7);
  std::uniform_real_distribution<double> x(5, 314), y(5, 234);
  for (TrailMatch& m : r.matches) m.second = {x(rng), y(rng)};
  expect_refused(r, desk_views().camera(), "random");
}

TEST(Initialiser, OutliersAmongTheMatchesAreNoHarm) {
  InitialisationRequest r = request_for(&desk_views(), 2, 5, 0.2);
  std::mt19937 rng(7);
  std::uniform_real_distribution<double> x(5, 314), y(5, 234);
  for (std::size_t i = 0; i < r.matches.size(); i += 5) r.matches[i].second = {x(rng), y(rng)};
  SharedMap shared;
  const InitialisationReply reply = initialise(&shared, r, desk_views().camera());
  ASSERT_TRUE(reply.ok) << reply.reason;
  const RigidTransform made =
      reply.second_from_world * test::copy_of(shared).keyframes.at({0, 0}).camera_from_world.inverse();
  const RigidTransform truth = desk_views().camera_from_world(5) * desk_views().camera_from_world(2).inverse();
  EXPECT_LT(log_so3(made.R * truth.R.transpose()).norm(), 0.01);
}

TEST(Initialiser, DetectsThePlaneOfAMapThatIsThere) {
  SharedMap shared;
  std::mt19937_64 rng(3);
  EXPECT_FALSE(detect_plane(&shared, MapperOptions(), &rng).ok);
  test::set_map(&shared, test::true_map(&desk_views(), {2, 5}, 100));
  ASSERT_TRUE(detect_plane(&shared, MapperOptions(), &rng).ok);
  const Plane plane = *test::copy_of(shared).plane;
  // The true world has the table at z = 0.
  EXPECT_GT(plane.world_from_plane.R.col(2).z(), 0.99);
  EXPECT_NEAR(plane.world_from_plane.t.z(), 0, 0.02) << "the keyboard and the papers lie on it";
}

}  // namespace
}  // namespace parallax
