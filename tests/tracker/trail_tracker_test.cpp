#include "tracker/trail_tracker.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <fstream>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <set>
#include <sstream>
#include <string>

#include "core/camera_model.h"
#include "core/se3.h"
#include "tests/tracker/planar_scene.h"
#include "tracker/affine_alignment.h"

namespace parallax {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using test::apply;
using test::PlanarScene;
using test::pyramid_of;
using test::similarity;

constexpr int kWidth = 640, kHeight = 480;

const PlanarScene& scene() {
  static const PlanarScene s(kWidth, kHeight, 7);
  return s;
}

CornerList corners_of(const ImagePyramid& pyramid, int threshold = 12) {
  CornerList list;
  fast_corners(pyramid.level[0], threshold, &list);
  return list;
}

void start(TrailTracker* tracker, const cv::Mat1b& image) {
  const auto pyramid = pyramid_of(image);
  tracker->start(pyramid, corners_of(*pyramid));
}

double rms_error(const std::vector<Trail>& trails, const Matrix3d& H) {
  double sum = 0;
  for (const Trail& t : trails) sum += (t.current - apply(H, t.first)).squaredNorm();
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, trails.size())));
}

double median_error(const std::vector<Trail>& trails, const Matrix3d& H) {
  std::vector<double> e;
  for (const Trail& t : trails) e.push_back((t.current - apply(H, t.first)).norm());
  std::sort(e.begin(), e.end());
  return e.empty() ? 1e9 : e[e.size() / 2];
}

// Of the corners of the first frame, how many are still well inside the frame.
int in_view(const std::vector<Trail>& first, const Matrix3d& H, double border = 10) {
  int n = 0;
  for (const Trail& t : first) {
    const Vector2d p = apply(H, t.first);
    n += p.x() > border && p.y() > border && p.x() < kWidth - border && p.y() < kHeight - border ? 1 : 0;
  }
  return n;
}

// A hand-held path: a slide with rotation, zoom and perspective; frame 0 is the identity.
Matrix3d path(int frame) {
  const double s = frame;
  return similarity(scene().centre(), 0.012 * s, 1 + 0.008 * s, {11.0 * s, 5.0 * std::sin(0.5 * s)},
                    {8e-6 * s, -5e-6 * s});
}

TEST(TrailTracker, StartsManyCornersSpreadOverTheImage) {
  TrailTracker tracker;
  EXPECT_FALSE(tracker.active());
  start(&tracker, scene().render(Matrix3d::Identity()));
  ASSERT_TRUE(tracker.active());
  const auto& trails = tracker.trails();
  EXPECT_EQ(tracker.started(), static_cast<int>(trails.size()));
  EXPECT_EQ(trails.size(), 1000u);
  int cells[4][4] = {};
  for (std::size_t i = 0; i < trails.size(); ++i) {
    EXPECT_EQ(trails[i].id, static_cast<int>(i));
    EXPECT_EQ(trails[i].first, trails[i].current);
    ++cells[static_cast<int>(trails[i].first.y()) * 4 / kHeight][static_cast<int>(trails[i].first.x()) * 4 / kWidth];
    for (std::size_t k = 0; k < i; ++k) ASSERT_GE((trails[i].first - trails[k].first).norm(), 6.0);
  }
  for (const auto& row : cells) {
    for (const int n : row) EXPECT_GE(n, 20);
  }
}

TEST(TrailTracker, FewerTrailsWhenAskedAndNoneOnABlankImage) {
  TrailOptions options;
  options.max_trails = 50;
  TrailTracker tracker(options);
  start(&tracker, scene().render(Matrix3d::Identity()));
  EXPECT_EQ(tracker.trails().size(), 50u);
  start(&tracker, cv::Mat1b(kHeight, kWidth, static_cast<unsigned char>(90)));
  EXPECT_TRUE(tracker.active());
  EXPECT_EQ(tracker.started(), 0);
  tracker.track(pyramid_of(scene().render(Matrix3d::Identity())), {0, 0});
  EXPECT_TRUE(tracker.trails().empty());
  EXPECT_TRUE(tracker.refined().empty());
  tracker.clear();
  EXPECT_FALSE(tracker.active());
}

TEST(TrailTracker, AnUnmovedImageLeavesTrailsWhereTheyAre) {
  TrailTracker tracker;
  const cv::Mat1b image = scene().render(Matrix3d::Identity());
  start(&tracker, image);
  for (int i = 0; i < 5; ++i) tracker.track(pyramid_of(image), {0, 0});
  EXPECT_GE(tracker.trails().size(), 990u);
  EXPECT_LT(rms_error(tracker.trails(), Matrix3d::Identity()), 0.02);
  EXPECT_LT(rms_error(tracker.refined(), Matrix3d::Identity()), 0.005);
}

TEST(TrailTracker, FollowsASmoothPathAndRefinesToATenthOfAPixel) {
  TrailTracker tracker;
  start(&tracker, scene().render(path(0)));
  const std::vector<Trail> at_start = tracker.trails();
  constexpr int kFrames = 15;
  for (int i = 1; i <= kFrames; ++i) tracker.track(pyramid_of(scene().render(path(i))), {0, 0});
  const int possible = in_view(at_start, path(kFrames));
  EXPECT_GE(static_cast<int>(tracker.trails().size()), possible * 8 / 10);
  EXPECT_LT(median_error(tracker.trails(), path(kFrames)), 1.0);  // drift of fifteen frames
  const std::vector<Trail> refined = tracker.refined();
  EXPECT_GE(refined.size(), tracker.trails().size() * 8 / 10);
  EXPECT_LT(rms_error(refined, path(kFrames)), 0.1);
  EXPECT_LT(median_error(refined, path(kFrames)), 0.05);
}

TEST(TrailTracker, NoiseAndChangingExposure) {
  TrailTracker tracker;
  start(&tracker, scene().render(path(0), 1, 0, 3, 100));
  const std::vector<Trail> at_start = tracker.trails();
  constexpr int kFrames = 12;
  for (int i = 1; i <= kFrames; ++i) {
    tracker.track(pyramid_of(scene().render(path(i), 1 - 0.02 * i, 1.5 * i, 3, 100U + static_cast<unsigned>(i))),
                  {0, 0});
  }
  EXPECT_GE(static_cast<int>(tracker.trails().size()), in_view(at_start, path(kFrames)) * 7 / 10);
  const std::vector<Trail> refined = tracker.refined();
  EXPECT_GE(refined.size(), tracker.trails().size() * 7 / 10);
  EXPECT_LT(rms_error(refined, path(kFrames)), 0.2);
}

TEST(TrailTracker, FastMotionWithinTheSearchRadiusNeedsNoPrediction) {
  TrailTracker tracker;
  start(&tracker, scene().render(Matrix3d::Identity()));
  const std::vector<Trail> at_start = tracker.trails();
  const Matrix3d H = similarity(scene().centre(), 0.04, 1.01, {33, -18});
  tracker.track(pyramid_of(scene().render(H)), {0, 0});
  EXPECT_GE(static_cast<int>(tracker.trails().size()), in_view(at_start, H) * 8 / 10);
  EXPECT_LT(rms_error(tracker.refined(), H), 0.1);
}

TEST(TrailTracker, ThePredictedShiftCarriesThroughFasterMotion) {
  const Matrix3d H = similarity(scene().centre(), 0.02, 1, {120, 60});
  TrailTracker tracker;
  start(&tracker, scene().render(Matrix3d::Identity()));
  const std::vector<Trail> at_start = tracker.trails();
  tracker.track(pyramid_of(scene().render(H)), {105, 70});
  EXPECT_GE(static_cast<int>(tracker.trails().size()), in_view(at_start, H) * 8 / 10);
  EXPECT_LT(median_error(tracker.trails(), H), 0.15);
}

TEST(TrailTracker, HiddenTrailsDieAndIdsStay) {
  const PlanarScene other(kWidth, kHeight, 99);
  const cv::Rect block(200, 120, 220, 200);
  const cv::Mat1b cover = other.render(Matrix3d::Identity());
  TrailTracker tracker;
  start(&tracker, scene().render(path(0), 1, 0, 1));
  std::map<int, Vector2d> first;
  for (const Trail& t : tracker.trails()) first[t.id] = t.first;
  constexpr int kFrames = 6;
  for (int i = 1; i <= kFrames; ++i) {
    cv::Mat1b image = scene().render(path(i), 1, 0, 1, static_cast<unsigned>(i));
    if (i >= 3) cover(block).copyTo(image(block));
    tracker.track(pyramid_of(image), {0, 0});
  }
  int hidden = 0, alive_hidden = 0, alive = 0;
  std::set<int> seen;
  std::map<int, Vector2d> now;
  for (const Trail& t : tracker.trails()) {
    EXPECT_TRUE(seen.insert(t.id).second);
    ASSERT_TRUE(first.count(t.id));
    EXPECT_EQ(first[t.id], t.first);
    now[t.id] = t.current;
  }
  for (const auto& [id, p] : first) {
    const Vector2d q = apply(path(kFrames), p);
    const bool covered = q.x() > block.x + 4 && q.y() > block.y + 4 && q.x() < block.x + block.width - 4 &&
                         q.y() < block.y + block.height - 4;
    hidden += covered ? 1 : 0;
    alive_hidden += covered && now.count(id) ? 1 : 0;
    alive += !covered && now.count(id) ? 1 : 0;
  }
  ASSERT_GT(hidden, 60);
  EXPECT_LE(alive_hidden, hidden / 20);
  EXPECT_GE(alive, (static_cast<int>(first.size()) - hidden) * 6 / 10);
  // none of what is given to initialisation stands on the cover
  const auto refined = tracker.refined();
  int wrong = 0;
  for (const Trail& t : refined) wrong += (t.current - apply(path(kFrames), t.first)).norm() > 1 ? 1 : 0;
  EXPECT_LE(wrong, static_cast<int>(refined.size()) / 100);
}

TEST(TrailTracker, SmallImages) {
  const PlanarScene small(160, 120, 3);
  TrailTracker tracker;
  start(&tracker, small.render(Matrix3d::Identity()));
  const auto started = tracker.trails().size();
  ASSERT_GT(started, 60u);
  Matrix3d H = Matrix3d::Identity();
  for (int i = 1; i <= 5; ++i) {
    H = similarity(small.centre(), 0.01 * i, 1, {2.0 * i, 1.0 * i});
    tracker.track(pyramid_of(small.render(H)), {0, 0});
  }
  EXPECT_GE(tracker.trails().size(), started / 2);
  EXPECT_LT(rms_error(tracker.refined(), H), 0.15);
}

TEST(TrailTracker, SameInputSameTrails) {
  std::vector<Trail> results[2];
  for (auto& r : results) {
    TrailTracker tracker;
    start(&tracker, scene().render(path(0), 1, 0, 2));
    for (int i = 1; i <= 3; ++i) {
      tracker.track(pyramid_of(scene().render(path(i), 1, 0, 2, static_cast<unsigned>(i))), {3, 1});
    }
    r = tracker.refined();
  }
  ASSERT_EQ(results[0].size(), results[1].size());
  for (std::size_t i = 0; i < results[0].size(); ++i) {
    EXPECT_EQ(results[0][i].id, results[1][i].id);
    EXPECT_EQ(results[0][i].current, results[1][i].current);
  }
}

TEST(AffineAlignment, FindsSubPixelPositionAndLinearPart) {
  const Matrix3d H = similarity(scene().centre(), 0.1, 1.12, {3.3, -2.6}, {1e-5, 2e-5});
  const cv::Mat1f a = smooth_for_alignment(scene().render(Matrix3d::Identity()));
  const cv::Mat1f b = smooth_for_alignment(scene().render(H, 0.8, 12));
  int tried = 0;
  std::vector<double> errors, linear_errors;
  TrailTracker corners;
  start(&corners, scene().render(Matrix3d::Identity()));
  for (const Trail& corner : corners.trails()) {
    const Vector2d p = corner.first + Vector2d(0.3, -0.4);
    if (p.x() < 60 || p.y() < 60 || p.x() > kWidth - 60 || p.y() > kHeight - 60) continue;
    {
      AffineTemplate t;
      if (!t.prepare(a, p)) continue;
      ++tried;
      const Vector2d truth = apply(H, p);
      const auto r = t.align(b, truth + Vector2d(0.8, -0.7), Eigen::Matrix2d::Identity(), true, 25);
      if (!r.converged || r.correlation < 0.9) continue;
      errors.push_back((r.position - truth).norm());
      Eigen::Matrix2d linear;
      const double h = 0.5;
      linear.col(0) = (apply(H, p + Vector2d(h, 0)) - apply(H, p - Vector2d(h, 0))) / (2 * h);
      linear.col(1) = (apply(H, p + Vector2d(0, h)) - apply(H, p - Vector2d(0, h))) / (2 * h);
      linear_errors.push_back((r.linear - linear).norm());
    }
  }
  ASSERT_GT(tried, 200);
  ASSERT_GE(static_cast<int>(errors.size()), tried * 7 / 10);
  std::sort(errors.begin(), errors.end());
  std::sort(linear_errors.begin(), linear_errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.1);
  EXPECT_LT(errors[errors.size() * 9 / 10], 0.25);
  EXPECT_LT(linear_errors[linear_errors.size() / 2], 0.06);
}

TEST(AffineAlignment, RefusesBlankAndOutside) {
  AffineTemplate t;
  EXPECT_FALSE(t.prepare(cv::Mat1f(60, 80, 10.0F), {40, 30}));
  const cv::Mat1f a = smooth_for_alignment(scene().render(Matrix3d::Identity()));
  EXPECT_FALSE(t.prepare(a, {3, 100}));
  EXPECT_FALSE(t.prepare(a, {100, kHeight - 2.0}));
  EXPECT_FALSE(t.prepare(a, {std::nan(""), 50}));
}

// ---- on a recording with exact poses

struct Recording {
  std::vector<double> times;
  std::vector<std::string> files;
  std::map<long, RigidTransform> world_from_camera;  // by time in 0.1 ms
};

Recording read_desk(const std::string& folder) {
  Recording r;
  std::string line;
  std::ifstream list(folder + "/rgb.txt"), truth(folder + "/groundtruth.txt");
  while (std::getline(list, line)) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream in(line);
    double t = 0;
    std::string file;
    in >> t >> file;
    r.times.push_back(t);
    r.files.push_back(folder + "/" + file);
  }
  while (std::getline(truth, line)) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream in(line);
    double t = 0, x = 0, y = 0, z = 0, qx = 0, qy = 0, qz = 0, qw = 1;
    in >> t >> x >> y >> z >> qx >> qy >> qz >> qw;
    r.world_from_camera[std::lround(t * 1e4)] =
        RigidTransform(Eigen::Quaterniond(qw, qx, qy, qz), Eigen::Vector3d(x, y, z));
  }
  return r;
}

TEST(TrailTracker, DeskRecordingAgreesWithTheTrueEpipolarGeometry) {
  const std::string folder = std::string(PARALLAX_DATA_DIR) + "/desk";
  if (!std::filesystem::exists(folder + "/rgb.txt")) GTEST_SKIP() << "no recording at " << folder;
  const Recording recording = read_desk(folder);
  ASSERT_GT(recording.files.size(), 75u);
  // calibration.yaml of the recording
  const CameraModel camera(CameraModelKind::fov, 640, 480, {375.0, 376.0}, {322.3, 237.1}, {0.9}, 1);
  TrailTracker tracker;
  constexpr std::size_t kFirst = 30, kLast = 75;
  for (std::size_t i = kFirst; i <= kLast; ++i) {
    const cv::Mat1b image = cv::imread(recording.files[i], cv::IMREAD_GRAYSCALE);
    ASSERT_FALSE(image.empty()) << recording.files[i];
    if (i == kFirst) {
      start(&tracker, image);
    } else {
      tracker.track(pyramid_of(image), {0, 0});
    }
  }
  EXPECT_GE(tracker.trails().size(), 300u);
  const std::vector<Trail> refined = tracker.refined();
  EXPECT_GE(refined.size(), 300u);

  const RigidTransform a = recording.world_from_camera.at(std::lround(recording.times[kFirst] * 1e4));
  const RigidTransform b = recording.world_from_camera.at(std::lround(recording.times[kLast] * 1e4));
  const RigidTransform b_from_a = b.inverse() * a;
  const Matrix3d E = hat(b_from_a.t) * b_from_a.R;
  std::vector<double> errors;
  for (const Trail& t : refined) {
    Eigen::Vector3d ra, rb;
    ASSERT_TRUE(camera.unproject(t.first, &ra) && camera.unproject(t.current, &rb));
    // distance in pixels along the image gradient of the epipolar constraint in the second frame
    const auto constraint = [&](const Vector2d& p) {
      Eigen::Vector3d r;
      camera.unproject(p, &r);
      return r.dot(E * ra);
    };
    const double h = 1e-3;
    const Vector2d gradient(
        (constraint(t.current + Vector2d(h, 0)) - constraint(t.current - Vector2d(h, 0))) / (2 * h),
        (constraint(t.current + Vector2d(0, h)) - constraint(t.current - Vector2d(0, h))) / (2 * h));
    errors.push_back(std::abs(constraint(t.current)) / gradient.norm());
  }
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.3);
  EXPECT_LT(errors[errors.size() * 9 / 10], 1.0);
  RecordProperty("alive", static_cast<int>(tracker.trails().size()));
  RecordProperty("refined", static_cast<int>(refined.size()));
  RecordProperty("median_epipolar_error_milli_px", static_cast<int>(1e3 * errors[errors.size() / 2]));
  RecordProperty("p90_epipolar_error_milli_px", static_cast<int>(1e3 * errors[errors.size() * 9 / 10]));
}

}  // namespace
}  // namespace parallax
