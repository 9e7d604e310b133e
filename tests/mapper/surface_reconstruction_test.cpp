// What stands on the plane, from the map alone, and what it hides, against the exact depth of the synthetic desk.
#include "mapper/surface_reconstruction.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "core/error.h"
#include "mapper/mapper.h"
#include "render/occlusion_mask.h"
#include "tests/mapper/desk_fixture.h"
#include "tests/support/statistics.h"
#include "tracker/tracker.h"

namespace parallax {
namespace {

using Eigen::Vector2d, Eigen::Vector3d;

std::shared_ptr<const SceneSurface> run_to_end(SurfaceReconstruction* reconstruction, double budget_ms) {
  const Interruption never;
  while (reconstruction->step(budget_ms, never)) {
  }
  return reconstruction->surface();
}

// Intersection over union of what is hidden: of layers of content over the whole field, medians over frames, together
// and each; and of blocks on bare places, of which little is hidden, all of it next to the rims of things. The seed is
// none that anything was tuned on.
constexpr double kLeastOverlap = 0.8, kLeastOfALayer = 0.7, kLeastOfBlocks = 0.45;

// A recording tracked and mapped in lockstep, with true depths in the map's scale.
struct Tracked {
  struct View {
    RigidTransform camera_from_world;
    GreyImage grey;
    cv::Mat1f depth;
  };
  CameraModel camera;
  std::shared_ptr<const TrackingSnapshot> map;
  std::vector<View> views;
};

Tracked track_desk(const std::string& name, int first, int last, int every) {
  Tracked out;
  const auto source = open_synthetic_source(name);
  out.camera = *source->calibration();
  SharedMap map;
  MapperInbox inbox(8);
  Mapper mapper(out.camera, MapperOptions(), &map, &inbox);
  Tracker tracker(out.camera, TrackerOptions(), false, &map, &inbox);
  std::vector<Vector3d> mine, truth;
  for (int i = first; i < last; ++i) {
    const Frame frame = source->frame(i);
    const TrackingResult result = tracker.track(frame, i == first || i == 75);
    while (mapper.step()) {
    }
    if (!result.camera_from_world) continue;
    mine.push_back(result.camera_from_world->inverse().t);
    truth.push_back(source->world_from_camera(i).t);
    if (i % every == 0) out.views.push_back({*result.camera_from_world, frame.grey, source->depth(i)});
  }
  out.map = map.snapshot();
  Eigen::Matrix3Xd a(3, mine.size()), b(3, mine.size());
  for (std::size_t i = 0; i < mine.size(); ++i) {
    a.col(static_cast<Eigen::Index>(i)) = mine[i];
    b.col(static_cast<Eigen::Index>(i)) = truth[i];
  }
  SimilarityTransform true_from_map;
  if (mine.size() > 2 && align_points(a, b, true, &true_from_map))
    for (auto& view : out.views) view.depth = view.depth / true_from_map.s;
  return out;
}

// The mapped part of the plane, as the games have it: the hull of the points on it.
std::vector<cv::Point2f> field_of(const Tracked& desk, const SceneSurface& surface) {
  std::vector<cv::Point2f> on_plane, hull;
  const Vector2d high = surface.corner_m + surface.cell_m * Vector2d(surface.columns, surface.rows);
  for (const Vector3d& point : desk.map->position) {
    const Vector3d p = surface.world_from_plane.inverse() * point;
    if (std::abs(p.z()) > 0.01 || (p.head<2>().array() < surface.corner_m.array()).any() ||
        (p.head<2>().array() > high.array()).any())
      continue;
    on_plane.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
  }
  cv::convexHull(on_plane, hull);
  return hull;
}

bool in_field(const std::vector<cv::Point2f>& field, const Vector2d& at) {
  return cv::pointPolygonTest(field, cv::Point2f(static_cast<float>(at.x()), static_cast<float>(at.y())), false) >= 0;
}

// Blocks 4 cm wide and 8 cm high on bare parts of the plane, everywhere that one of the views sees it bare.
std::vector<Vector2d> bare_places(const Tracked& desk, const SceneSurface& surface,
                                  const std::vector<cv::Point2f>& field) {
  std::vector<Vector2d> out;
  constexpr double spacing = 0.07, half = 0.02;
  for (double y = surface.corner_m.y(); y < surface.corner_m.y() + surface.rows * surface.cell_m; y += spacing) {
    for (double x = surface.corner_m.x(); x < surface.corner_m.x() + surface.columns * surface.cell_m; x += spacing) {
      const auto bare_in = [&](const Tracked::View& view) {
        for (const Vector2d& off : {Vector2d(0, 0), Vector2d(half, half), Vector2d(-half, half), Vector2d(half, -half),
                                    Vector2d(-half, -half)}) {
          const Vector3d p =
              view.camera_from_world * (surface.world_from_plane * Vector3d(x + off.x(), y + off.y(), 0));
          Vector2d px;
          if (!desk.camera.project(p, &px) || !desk.camera.in_image(px, 2)) return false;
          const float d = view.depth(static_cast<int>(std::lround(px.y())), static_cast<int>(std::lround(px.x())));
          if (std::abs(d - p.z()) > 0.008) return false;
        }
        return true;
      };
      if (in_field(field, {x, y}) && std::any_of(desk.views.begin(), desk.views.end(), bare_in)) out.emplace_back(x, y);
    }
  }
  return out;
}

double depth_of_blocks(const std::vector<Vector2d>& places, const RigidTransform& plane_from_camera,
                       const Vector3d& ray) {
  const Vector3d along = plane_from_camera.R * ray, &from = plane_from_camera.t;
  double nearest = 0;
  for (const Vector2d& place : places) {
    const Eigen::Array3d low(place.x() - 0.02, place.y() - 0.02, 0), high(place.x() + 0.02, place.y() + 0.02, 0.08);
    const Eigen::Array3d a = (low - from.array()) / along.array(), b = (high - from.array()) / along.array();
    const double in = a.min(b).maxCoeff(), out = a.max(b).minCoeff();
    if (in < out && in > 0 && (nearest == 0 || in < nearest)) nearest = in;
  }
  return nearest;
}

struct Overlap {
  int both = 0, either = 0;
  void add(bool a, bool b) {
    both += a && b;
    either += a || b;
  }
  double ratio() const { return static_cast<double>(both) / either; }
};

constexpr std::array<double, 4> kLayers_m = {0.01, 0.02, 0.04, 0.08};

// Of each view, sorted: what is hidden, by the mask and in truth, of the layers and of them together; and of the
// blocks.
struct Overlaps {
  std::array<std::vector<double>, kLayers_m.size()> layers;
  std::vector<double> together;
  Overlap blocks;  // of all views: each sees few of them past something
};

Overlaps overlaps(const Tracked& desk, const SceneSurface& surface) {
  OcclusionMask mask(desk.camera);
  const std::vector<cv::Point2f> field = field_of(desk, surface);
  const std::vector<Vector2d> places = bare_places(desk, surface, field);
  EXPECT_GT(places.size(), 20u);
  Overlaps out;
  const auto note = [](const Overlap& overlap, std::vector<double>* to) {
    if (overlap.either >= 40) to->push_back(overlap.ratio());
  };
  for (const Tracked::View& view : desk.views) {
    const cv::Mat1f real = mask.update(surface, view.camera_from_world, view.grey);
    const RigidTransform plane_from_camera = (view.camera_from_world * surface.world_from_plane).inverse();
    std::array<Overlap, kLayers_m.size()> layers;
    Overlap together;
    for (int y = 0; y < real.rows; ++y) {
      for (int x = 0; x < real.cols; ++x) {
        const Vector2d px((x + 0.5) * desk.camera.width() / real.cols - 0.5,
                          (y + 0.5) * desk.camera.height() / real.rows - 0.5);
        Vector3d ray;
        if (!desk.camera.unproject(px, &ray)) continue;
        const double truth = view.depth(static_cast<int>(px.y()), static_cast<int>(px.x())), said = real(y, x);
        const auto hides = [](double thing, double content) { return thing > 0 && thing < content; };
        const Vector3d along = plane_from_camera.R * ray, &from = plane_from_camera.t;
        for (std::size_t i = 0; i < kLayers_m.size(); ++i) {
          const double content = (kLayers_m[i] - from.z()) / along.z();
          if (!(content > 0) || !in_field(field, (from + content * along).head<2>())) continue;
          layers[i].add(hides(truth, content), hides(said, content));
          together.add(hides(truth, content), hides(said, content));
        }
        const double content = depth_of_blocks(places, plane_from_camera, ray);
        if (content > 0) out.blocks.add(hides(truth, content), hides(said, content));
      }
    }
    for (std::size_t i = 0; i < kLayers_m.size(); ++i) note(layers[i], &out.layers[i]);
    note(together, &out.together);
  }
  for (auto& layer : out.layers) std::sort(layer.begin(), layer.end());
  std::sort(out.together.begin(), out.together.end());
  return out;
}

TEST(SurfaceReconstruction, HidesWhatTheDeskHides) {
  const Tracked desk = track_desk("synthetic:desk?size=320x240&seed=6&frames=300", 30, 180, 15);
  ASSERT_TRUE(desk.map->plane);
  ASSERT_GT(desk.views.size(), 4u);
  SurfaceReconstruction reconstruction(desk.camera);
  reconstruction.update(desk.map);
  const auto surface = run_to_end(&reconstruction, 1e6);
  ASSERT_NE(surface, nullptr);
  RecordProperty("keyframes", static_cast<int>(desk.map->keyframes.size()));
  const Overlaps found = overlaps(desk, *surface);
  ASSERT_GT(found.together.size(), 4u);
  RecordProperty("together", std::to_string(testing::median(found.together)));
  RecordProperty("blocks", std::to_string(found.blocks.ratio()));
  EXPECT_GE(testing::median(found.together), kLeastOverlap);
  EXPECT_GE(found.blocks.ratio(), kLeastOfBlocks);
  for (std::size_t i = 0; i < kLayers_m.size(); ++i) {
    RecordProperty("layer_" + std::to_string(i), std::to_string(testing::median(found.layers[i])));
    EXPECT_GE(testing::median(found.layers[i]), kLeastOfALayer) << kLayers_m[i];
  }
}

const Map& small_map() {
  static const Map map = [] {
    Map out = test::true_map(&test::desk_views(), {0, 2, 4, 6}, 80);
    out.plane = Plane();
    return out;
  }();
  return map;
}

SurfaceOptions coarse() {
  SurfaceOptions out;
  out.image_width_px = 80;
  return out;
}

TEST(SurfaceReconstruction, GivesTheSameInOnePieceAndInMany) {
  SurfaceReconstruction whole(test::small_camera(), coarse()), pieces(test::small_camera(), coarse());
  whole.update(make_snapshot(small_map()));
  pieces.update(make_snapshot(small_map()));
  const auto a = run_to_end(&whole, 1e6);
  // Stopped at every second question.
  int steps = 0;
  while (pieces.step(1e6, Interruption::at_poll(2))) ++steps;
  const auto b = pieces.surface();
  ASSERT_TRUE(a && b);
  EXPECT_GT(steps, 100);
  EXPECT_EQ(a->height_m, b->height_m);
  EXPECT_EQ(a->filled, b->filled);
  EXPECT_EQ(a->known, b->known);
  EXPECT_GT(*std::max_element(a->height_m.begin(), a->height_m.end()), 0.03f) << "there are things on the desk";
  EXPECT_GE(*std::min_element(a->height_m.begin(), a->height_m.end()), 0.0f);
  // Nothing new: nothing to do, and the surface stays.
  whole.update(make_snapshot(small_map()));
  EXPECT_EQ(run_to_end(&whole, 1e6), a);
}

TEST(SurfaceReconstruction, FollowsTheMap) {
  SurfaceReconstruction reconstruction(test::small_camera(), coarse());
  const Interruption never;
  EXPECT_FALSE(reconstruction.step(1, never)) << "no map";
  reconstruction.update(make_snapshot(small_map()));
  const auto before = run_to_end(&reconstruction, 1e6);
  ASSERT_TRUE(before);
  // The world is scaled and moved: the same heights in other units, without looking at the images again.
  Map moved = small_map();
  const SimilarityTransform change(2.0, exp_so3({0.1, 0.2, 0.3}), Vector3d(1, 2, 3));
  moved.transform_world(change);
  reconstruction.update(make_snapshot(moved));
  const auto after = run_to_end(&reconstruction, 1e6);
  ASSERT_TRUE(after);
  EXPECT_GT(after->version, before->version);
  EXPECT_NEAR(after->cell_m, 2 * before->cell_m, 0.05 * before->cell_m);
  const float highest = *std::max_element(before->height_m.begin(), before->height_m.end());
  EXPECT_NEAR(*std::max_element(after->height_m.begin(), after->height_m.end()), 2 * highest, 0.2 * highest);
  // Without a plane there is none.
  moved.plane.reset();
  reconstruction.update(make_snapshot(moved));
  EXPECT_EQ(run_to_end(&reconstruction, 1e6), nullptr);
}

TEST(SurfaceReconstruction, RefusesOptionsThatCannotBe) {
  SurfaceOptions options;
  options.cells = 0;
  EXPECT_THROW(SurfaceReconstruction(test::small_camera(), options), InputError);
}

}  // namespace
}  // namespace parallax
