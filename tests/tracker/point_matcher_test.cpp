#include "tracker/point_matcher.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/core.hpp>
#include <set>

#include "render/synthetic_source.h"
#include "solver/absolute_pose.h"
#include "tests/tracker/desk_map.h"

namespace parallax {
namespace {

using test::desk_map;
using test::DeskMap;
using test::features_of;

// A map of keyframes of synthetic:desk, at their true poses, with points of true depth.
struct RecordedDesk {
  std::unique_ptr<SyntheticSource> source = open_synthetic_source("synthetic:desk?frames=200");
  CameraModel camera = *source->calibration();
  std::shared_ptr<const TrackingSnapshot> snapshot;

  RecordedDesk() {
    Map map;
    for (int frame : {0, 60, 120}) {
      const auto images = features_of(source->frame(frame).grey);
      const cv::Mat1f depth = source->depth(frame);
      Keyframe kf;
      kf.frame = frame;
      kf.camera_from_world = source->world_from_camera(frame).inverse();
      kf.images = images;
      const KeyframeId id = map.keyframes.insert(std::move(kf));
      for (int level = 0; level < kPyramidLevels; ++level) add_points(&map, id, level, *images, depth);
      map.update_depth(&map.keyframes.at(id));
    }
    snapshot = make_snapshot(map);
  }

  void add_points(Map* map, KeyframeId id, int level, const FrameImages& images, const cv::Mat1f& depth) {
    const GreyImage& image = images.pyramid.level[level];
    std::vector<std::pair<float, Corner>> scored;
    for (const Corner& c : maximal_corners(image, images.corners[level]))
      scored.emplace_back(-shi_tomasi_score(image, c.x, c.y), c);
    std::stable_sort(scored.begin(), scored.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    for (std::size_t i = 0; i < std::min<std::size_t>(scored.size(), 200); ++i) {
      const Eigen::Vector2d at(scored[i].second.x, scored[i].second.y), pixel = level_to_level0(at, level);
      const float z = depth(static_cast<int>(pixel.y()), static_cast<int>(pixel.x()));
      Eigen::Vector3d ray;
      MapPoint p;
      if (!(z > 0) || !camera.unproject(pixel, &ray) || !set_source(&p, id, level, at, camera)) continue;
      const RigidTransform world_from_camera = map->keyframes.at(id).camera_from_world.inverse();
      p.position = world_from_camera * (ray / ray.z() * z);
      p.normal = (world_from_camera.t - p.position).normalized();
      const PointId point = map->points.insert(p);
      map->add_measurement(id, {point, pixel, static_cast<float>(level_scale(level)), static_cast<std::int8_t>(level),
                                MeasurementSource::root});
    }
  }
};

RecordedDesk& recorded_desk() {
  static RecordedDesk d;
  return d;
}

int prepare_all(PointMatcher* matcher, const TrackingSnapshot& map, int budget = 100) {
  int calls = 0;
  while (matcher->prepare(map, budget)) ++calls;
  return calls;
}

// Of the matches, those within three pixels of their level of the true projection.
int right_matches(const std::vector<PoseObservation>& matches, const CameraModel& camera, const RigidTransform& truth) {
  int right = 0;
  for (const PoseObservation& m : matches) {
    Eigen::Vector2d pixel;
    right += camera.project(truth * m.point, &pixel) && (pixel - m.pixel).norm() < 3 * m.sigma_px;
  }
  return right;
}

TEST(PointMatcher, MatchesOfOtherFramesAreMostlyRight) {
  RecordedDesk& d = recorded_desk();
  PointMatcher matcher;
  prepare_all(&matcher, *d.snapshot);
  for (int frame : {20, 45, 75, 90, 110, 130}) {
    const auto matches = matcher.match(*d.snapshot, *features_of(d.source->frame(frame).grey));
    const RigidTransform truth = d.source->world_from_camera(frame).inverse();
    const int right = right_matches(matches, d.camera, truth);
    std::printf("frame %d: %d of %zu right\n", frame, right, matches.size());
    EXPECT_GE(matches.size(), 30u) << frame;
    EXPECT_GE(right, 0.6 * matches.size()) << frame;
    // Enough for a pose without any prior.
    std::mt19937_64 rng(1);
    RigidTransform pose;
    ASSERT_TRUE(solve_absolute_pose(d.camera, matches, AbsolutePoseOptions{}, &rng, &pose).ok) << frame;
    EXPECT_LT(test::centre_distance(pose, truth), 0.03) << frame;
    EXPECT_LT(test::turn_between(pose, truth), 0.04) << frame;
  }
}

// The camera turned about its axis: the small blurry images cannot tell, the descriptors can.
TEST(PointMatcher, MatchesATurnedImage) {
  RecordedDesk& d = recorded_desk();
  PointMatcher matcher;
  prepare_all(&matcher, *d.snapshot);
  GreyImage upside_down;
  cv::flip(d.source->frame(75).grey, upside_down, -1);
  std::vector<double> turns;
  auto matches = matcher.match(*d.snapshot, *features_of(upside_down), &turns);
  ASSERT_EQ(turns.size(), matches.size());
  int by_half = 0;
  for (double turn : turns) by_half += std::abs(std::remainder(turn - M_PI, 2 * M_PI)) < 0.5 ? 1 : 0;
  EXPECT_GE(by_half, 0.6 * static_cast<double>(turns.size()));
  for (PoseObservation& m : matches) m.pixel = Eigen::Vector2d(d.camera.width() - 1, d.camera.height() - 1) - m.pixel;
  EXPECT_GE(matches.size(), 30u);
  EXPECT_GE(right_matches(matches, d.camera, d.source->world_from_camera(75).inverse()), 0.6 * matches.size());
}

TEST(PointMatcher, MatchesAreOneToOne) {
  RecordedDesk& d = recorded_desk();
  PointMatcher matcher;
  prepare_all(&matcher, *d.snapshot);
  const auto matches = matcher.match(*d.snapshot, *features_of(d.source->frame(60).grey));
  std::set<std::tuple<double, double, double>> points;
  std::set<std::tuple<double, double, double>> corners;
  for (const PoseObservation& m : matches) {
    EXPECT_TRUE(points.emplace(m.point.x(), m.point.y(), m.point.z()).second);
    EXPECT_TRUE(corners.emplace(m.pixel.x(), m.pixel.y(), m.sigma_px).second);
  }
  EXPECT_GE(matches.size(), 100u);
}

TEST(PointMatcher, NothingOnBlankNothingOnAnEmptyMap) {
  DeskMap& d = desk_map();
  PointMatcher matcher;
  EXPECT_TRUE(matcher.match(*d.snapshot, *d.views.images(0)).empty());  // nothing described yet
  prepare_all(&matcher, *d.snapshot);
  EXPECT_FALSE(matcher.match(*d.snapshot, *d.views.images(0)).empty());
  EXPECT_TRUE(matcher.match(*d.snapshot, *features_of(GreyImage(240, 320, static_cast<std::uint8_t>(120)))).empty());
  PointMatcher empty;
  EXPECT_FALSE(empty.prepare(TrackingSnapshot(), 5));
  EXPECT_TRUE(empty.match(TrackingSnapshot(), *d.views.images(0)).empty());
}

TEST(PointMatcher, PreparesAFewKeyframesAtATime) {
  DeskMap& d = desk_map();
  PointMatcher whole, parts;
  EXPECT_TRUE(whole.prepare(*d.snapshot, 100));
  EXPECT_FALSE(whole.prepare(*d.snapshot, 100));
  std::set<int> sources(d.snapshot->source.begin(), d.snapshot->source.end());
  const auto complete = whole.match(*d.snapshot, *d.views.images(DeskMap::between));
  std::size_t before = 0;
  for (std::size_t call = 0; call < sources.size(); ++call) {
    EXPECT_TRUE(parts.prepare(*d.snapshot, 1));
    const auto matches = parts.match(*d.snapshot, *d.views.images(DeskMap::between));
    if (call == 0) before = matches.size();
    EXPECT_TRUE(call + 1 == sources.size() || matches.size() != complete.size());
  }
  EXPECT_GT(before, 0u);
  EXPECT_FALSE(parts.prepare(*d.snapshot, 1));
  const auto matches = parts.match(*d.snapshot, *d.views.images(DeskMap::between));
  ASSERT_EQ(matches.size(), complete.size());
  for (std::size_t i = 0; i < matches.size(); ++i) {
    EXPECT_EQ(matches[i].point, complete[i].point);
    EXPECT_EQ(matches[i].pixel, complete[i].pixel);
  }
}

// A point seen better elsewhere gets a new source; a map made anew uses the same numbers for other points.
TEST(PointMatcher, DescribesAgainWhatHasChanged) {
  DeskMap& d = desk_map();
  PointMatcher matcher;
  prepare_all(&matcher, *d.snapshot);
  const auto before = matcher.match(*d.snapshot, *d.views.images(DeskMap::between));

  TrackingSnapshot moved = *d.snapshot;
  for (Eigen::Vector2f& pixel : moved.source_pixel)
    pixel = Eigen::Vector2f(pixel.x() > 60 ? pixel.x() - 30 : pixel.x() + 30, pixel.y());
  EXPECT_TRUE(matcher.match(moved, *d.views.images(DeskMap::between)).empty());  // what is known is of other places
  EXPECT_EQ(prepare_all(&matcher, moved), 1);
  PointMatcher fresh;
  prepare_all(&fresh, moved);
  const auto after = matcher.match(moved, *d.views.images(DeskMap::between));
  const auto expected = fresh.match(moved, *d.views.images(DeskMap::between));
  ASSERT_EQ(after.size(), expected.size());
  for (std::size_t i = 0; i < after.size(); ++i) EXPECT_EQ(after[i].pixel, expected[i].pixel);
  EXPECT_LT(right_matches(after, d.views.camera(), d.views.camera_from_world(DeskMap::between)),
            right_matches(before, d.views.camera(), d.views.camera_from_world(DeskMap::between)) / 4);

  TrackingSnapshot anew = *d.snapshot;
  ++anew.map_version;
  EXPECT_TRUE(matcher.match(anew, *d.views.images(DeskMap::between)).empty());
  EXPECT_EQ(prepare_all(&matcher, anew), 1);
  EXPECT_EQ(matcher.match(anew, *d.views.images(DeskMap::between)).size(), before.size());
  matcher.clear();
  EXPECT_TRUE(matcher.match(anew, *d.views.images(DeskMap::between)).empty());
}

}  // namespace
}  // namespace parallax
