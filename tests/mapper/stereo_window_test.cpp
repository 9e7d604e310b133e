#include "mapper/stereo_window.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <set>

#include "core/error.h"
#include "solver/chi_square.h"

namespace parallax {
namespace {

const StereoCamera kCamera{512, 384, {400, 402}, {255.5, 191.5}, 0.119};

// A rig that goes down a corridor, 0.2 m from keyframe to keyframe, and what its tracker would hand over: exact
// geometry, with noise of the pixels and of the odometry.
struct Walk {
  int keyframes = 30;
  double noise_px = 0, odometry_m = 0, odometry_rad = 0;
  double wrong = 0;                   // part of the tracks that slide off their corner, a little more in every keyframe
  int failure = -1;                   // the keyframe behind a failure
  std::vector<RigidTransform> truth;  // world_from_keyframe
  std::set<std::int64_t> sliding;
  std::vector<StereoKeyframe> made;

  void make(unsigned seed) {
    std::mt19937 rng(seed);
    std::normal_distribution<double> normal;
    const auto uniform = [&](double from, double to) { return std::uniform_real_distribution<double>(from, to)(rng); };
    std::vector<Eigen::Vector3d> points;
    const double end = 0.2 * keyframes + 8;
    for (int i = 0; i < static_cast<int>(25 * end); ++i) {
      const double side = uniform(-1, 1) < 0 ? -1 : 1, z = uniform(0.5, end);
      points.push_back(i % 3 == 0 ? Eigen::Vector3d(uniform(-1.5, 1.5), side * 1.2, z)
                                  : Eigen::Vector3d(side * 1.5, uniform(-1.2, 1.2), z));
    }
    std::vector<bool> slides;
    for (std::size_t i = 0; i < points.size(); ++i) slides.push_back(uniform(0, 1) < wrong);
    std::vector<int> seen(points.size(), 0);
    for (int k = 0; k < keyframes; ++k) {
      truth.emplace_back(exp_so3({0.01 * std::sin(0.7 * k), 0.05 * std::sin(0.3 * k), 0.01 * std::cos(k)}),
                         Eigen::Vector3d(0.1 * std::sin(0.4 * k), 0.02 * std::cos(k), 0.2 * k));
      StereoKeyframe keyframe;
      keyframe.index = k;
      keyframe.frame = 3 * k;
      keyframe.time = Timestamp(150'000'000LL * k);
      keyframe.after_failure = k == failure;
      if (k > 0) {
        Vector6d error;
        for (int i = 0; i < 6; ++i) error[i] = (i < 3 ? odometry_m : odometry_rad) * normal(rng);
        const auto last = static_cast<std::size_t>(k) - 1;
        keyframe.previous_from_this = RigidTransform::exp(error) * truth[last].inverse() * truth.back();
        keyframe.covariance = 1e-4 * Matrix6d::Identity();
        if (k == failure) {
          keyframe.previous_from_this = RigidTransform();
          keyframe.covariance = 0.5 * Matrix6d::Identity();
        }
      }
      const RigidTransform camera_from_world = truth.back().inverse();
      for (std::size_t i = 0; i < points.size(); ++i) {
        StereoMeasurement m;
        // What comes behind a failure is another track of the same point.
        m.track = static_cast<std::int64_t>(i + (failure >= 0 && k >= failure ? points.size() : 0));
        const Eigen::Vector3d p = camera_from_world * points[i];
        if (p.z() < 0.5 || p.z() > 8 || !kCamera.project(p, &m.pixel) ||
            !kCamera.in_image({m.pixel.x(), m.pixel.z()}, 5))
          continue;
        for (int c = 0; c < 3; ++c) m.pixel[c] += noise_px * normal(rng);
        if (slides[i]) m.pixel += seen[i] * Eigen::Vector3d(1.5, 1.2, -1.5), sliding.insert(m.track);
        ++seen[i];
        if (m.pixel.y() < 5) m.pixel.y() = std::numeric_limits<double>::quiet_NaN();
        m.point = kCamera.triangulate(m.pixel);
        keyframe.measurements.push_back(m);
      }
      made.push_back(std::move(keyframe));
    }
    // The window's world is the first keyframe.
    const RigidTransform first = truth.front().inverse();
    for (RigidTransform& pose : truth) pose = first * pose;
  }

  RigidTransform relative(int from, int to) const {
    return truth[static_cast<std::size_t>(from)].inverse() * truth[static_cast<std::size_t>(to)];
  }
};

StereoWindowOptions said(double sigma_px) {
  StereoWindowOptions options;
  options.sigma_px = sigma_px;
  return options;
}

void add_all(const Walk& walk, StereoWindow* window) {
  for (const StereoKeyframe& keyframe : walk.made) window->add(keyframe);
  window->finish();
}

double worst_position(const std::vector<StereoSessionPose>& poses, const std::vector<RigidTransform>& truth) {
  double worst = 0;
  for (std::size_t i = 0; i < poses.size(); ++i)
    worst = std::max(worst, (poses[i].world_from_camera.t - truth[i].t).norm());
  return worst;
}

// Keyframes - 1 constraints, from each to the next, in turn.
void expect_chain(const StereoWindow& window, int keyframes) {
  ASSERT_EQ(static_cast<int>(window.constraints().size()), keyframes - 1);
  for (int i = 0; i + 1 < keyframes; ++i) {
    const StereoConstraint& c = window.constraints()[static_cast<std::size_t>(i)];
    EXPECT_EQ(c.from, i);
    EXPECT_EQ(c.to, i + 1);
    EXPECT_GT(c.covariance.ldlt().vectorD().minCoeff(), 0);
    EXPECT_LT((c.covariance - c.covariance.transpose()).cwiseAbs().maxCoeff(),
              1e-9 * c.covariance.cwiseAbs().maxCoeff());
  }
}

TEST(StereoWindow, WithoutNoiseIsExactWhateverTheOdometrySaid) {
  Walk walk;
  walk.odometry_m = 0.001;
  walk.odometry_rad = 0.0002;
  walk.make(1);
  StereoWindow window(kCamera, said(0.1));
  for (const StereoKeyframe& keyframe : walk.made) {
    const StereoWindowUpdate update = window.add(keyframe);
    EXPECT_EQ(update.keyframe, keyframe.index);
    EXPECT_LT((update.world_from_keyframe.t - window.poses().back().world_from_camera.t).norm(), 1e-12);
    EXPECT_TRUE(std::is_sorted(update.points.begin(), update.points.end(),
                               [](const auto& a, const auto& b) { return a.track < b.track; }));
    for (const auto& point : update.points) {
      const auto& all = keyframe.measurements;
      const auto m =
          std::find_if(all.begin(), all.end(), [&](const StereoMeasurement& x) { return x.track == point.track; });
      ASSERT_NE(m, all.end());
      EXPECT_FALSE(point.outlier);
      EXPECT_GE(point.poses, 2);
      EXPECT_NEAR(point.point.norm(), 1, 1e-9);
      Eigen::Vector3d pixel = Eigen::Vector3d::Zero();
      ASSERT_TRUE(kCamera.project(point.point.hnormalized(), &pixel));
      EXPECT_LT(std::abs(pixel.x() - m->pixel.x()) + std::abs(pixel.z() - m->pixel.z()), 1e-4);
    }
    if (keyframe.index > 0) {
      EXPECT_GT(update.points.size(), 30u);
    }
  }
  window.finish();
  EXPECT_LT(worst_position(window.poses(), walk.truth), 1e-6);
  expect_chain(window, walk.keyframes);
  for (const StereoConstraint& c : window.constraints())
    EXPECT_LT((c.from_from_to * walk.relative(c.from, c.to).inverse()).log().norm(), 1e-6);
  EXPECT_GT(window.points().size(), 200u);
  for (const StereoMapPoint& point : window.points()) {
    const Eigen::Vector3d p = walk.truth[0] * point.world;  // truth[0] is the identity: the walls tell
    EXPECT_LT(std::min(std::abs(std::abs(p.x()) - 1.5), std::abs(std::abs(p.y()) - 1.2)), 0.15);
    EXPECT_GE(point.poses, 3);
  }
}

TEST(StereoWindow, NoisyIsBetterThanOdometryAlone) {
  double chained_error = 0, window_error = 0;
  for (unsigned seed = 0; seed < 4; ++seed) {
    Walk walk;
    walk.noise_px = 0.2;
    walk.odometry_m = 0.002;
    walk.odometry_rad = 0.0005;
    walk.make(seed);
    StereoWindow window(kCamera, said(0.2));
    add_all(walk, &window);
    RigidTransform chained;
    for (const StereoKeyframe& keyframe : walk.made) chained = chained * keyframe.previous_from_this;
    chained_error += (chained.t - walk.truth.back().t).norm();
    window_error += (window.poses().back().world_from_camera.t - walk.truth.back().t).norm();
    for (const StereoWindowTiming& t : window.timings()) EXPECT_LE(t.poses, 15);
    expect_chain(window, walk.keyframes);
  }
  RecordProperty("chained_m", std::to_string(chained_error / 4));
  RecordProperty("window_m", std::to_string(window_error / 4));
  EXPECT_LT(window_error, 0.4 * chained_error);
  EXPECT_LT(window_error / 4, 0.02);  // of 6 m
}

// A pose told wrongly, by half a centimetre or by ten, must not be let go of with all that it saw; and what it alone
// has seen goes along when it is put right.
TEST(StereoWindow, OdometryThatIsFarOffIsMended) {
  for (unsigned seed = 0; seed < 4; ++seed) {
    Walk walk;
    walk.noise_px = 0.1;
    walk.odometry_m = seed % 2 == 0 ? 0.005 : 0.05;
    walk.odometry_rad = walk.odometry_m / 5;
    walk.make(seed);
    StereoWindow window(kCamera, said(0.1));
    for (const StereoKeyframe& keyframe : walk.made) {
      int dropped = 0;
      const StereoWindowUpdate update = window.add(keyframe);
      for (const auto& point : update.points) dropped += static_cast<int>(point.outlier);
      EXPECT_LE(2 * dropped, static_cast<int>(keyframe.measurements.size())) << "keyframe " << keyframe.index;
    }
    window.finish();
    EXPECT_LT(worst_position(window.poses(), walk.truth), 0.02) << "seed " << seed;
  }
}

TEST(StereoWindow, TracksThatSlideAreFoundOut) {
  Walk walk;
  walk.noise_px = 0.1;
  walk.wrong = 0.12;
  walk.make(7);
  StereoWindow window(kCamera, said(0.1));
  std::set<std::int64_t> marked;
  for (const StereoKeyframe& keyframe : walk.made)
    for (const auto& point : window.add(keyframe).points)
      if (point.outlier) marked.insert(point.track);
  window.finish();
  int right = 0;
  for (const std::int64_t track : marked) right += static_cast<int>(walk.sliding.contains(track));
  RecordProperty("sliding", static_cast<int>(walk.sliding.size()));
  RecordProperty("marked", static_cast<int>(marked.size()));
  EXPECT_GE(right, 0.6 * static_cast<double>(walk.sliding.size()));
  std::set<std::int64_t> tracks;
  for (const StereoKeyframe& keyframe : walk.made)
    for (const StereoMeasurement& m : keyframe.measurements) tracks.insert(m.track);
  const auto good = static_cast<double>(tracks.size() - walk.sliding.size());
  RecordProperty("good_marked", std::to_string((static_cast<double>(marked.size()) - right) / good));
  EXPECT_LE(static_cast<double>(marked.size()) - right, 0.15 * good);  // that had to fit beside them
  EXPECT_LT(worst_position(window.poses(), walk.truth), 0.02);
}

// Of each window one constraint: neighbours share their measurements.
TEST(StereoWindow, CovariancesAreTheSizeOfTheErrors) {
  constexpr int kRuns = 60;
  double nees = 0;
  for (unsigned run = 0; run < kRuns; ++run) {
    Walk walk;
    walk.keyframes = 8;
    walk.noise_px = 0.2;
    walk.odometry_m = 0.002;
    walk.odometry_rad = 0.0005;
    walk.make(100 + run);
    StereoWindowOptions options = said(0.2);
    options.solver.estimate_sigma = false;
    options.noise_part = 1;  // what is said is what is there
    StereoWindow window(kCamera, options);
    add_all(walk, &window);
    const StereoConstraint& c = window.constraints()[3];
    const Vector6d error = (c.from_from_to * walk.relative(c.from, c.to).inverse()).log();
    nees += error.dot(c.covariance.ldlt().solve(error));
  }
  const ChiSquareBounds bounds = chi_square_bounds_95(6 * kRuns);
  RecordProperty("nees", std::to_string(nees / kRuns));
  EXPECT_GT(nees, bounds.low) << "mean " << nees / kRuns;
  EXPECT_LT(nees, bounds.high) << "mean " << nees / kRuns;
}

TEST(StereoWindow, FailureBeginsAnewAndIsTold) {
  Walk walk;
  walk.failure = 10;
  walk.make(3);
  StereoWindow window(kCamera, said(0.1));
  add_all(walk, &window);
  expect_chain(window, walk.keyframes);
  for (const StereoConstraint& c : window.constraints()) {
    EXPECT_EQ(c.after_failure, c.to == 10);
    if (c.to == 10) {
      EXPECT_EQ(c.covariance, Matrix6d(0.5 * Matrix6d::Identity()));
      EXPECT_EQ(c.from_from_to.t, Eigen::Vector3d(0, 0, 0));
    } else {
      EXPECT_LT((c.from_from_to * walk.relative(c.from, c.to).inverse()).log().norm(), 1e-6) << c.to;
    }
  }
  // The pose is where the last one was.
  EXPECT_LT((window.poses()[10].world_from_camera.t - window.poses()[9].world_from_camera.t).norm(), 1e-9);
  EXPECT_EQ(window.windows(), 3);  // at the failure, 15 poses later, and at the end
}

// What was mapped stays on the map when the tracker fails.
TEST(StereoWindow, FailureLosesNoPoints) {
  Walk walk, failing;
  walk.keyframes = failing.keyframes = 12;
  walk.make(4);
  failing.failure = 11;
  failing.make(4);
  StereoWindow whole(kCamera, said(0.1)), broken(kCamera, said(0.1));
  for (int k = 0; k < 11; ++k) {
    whole.add(walk.made[static_cast<std::size_t>(k)]);
    broken.add(failing.made[static_cast<std::size_t>(k)]);
  }
  ASSERT_EQ(whole.points().size(), broken.points().size());
  broken.add(failing.made[11]);
  EXPECT_GE(broken.points().size(), whole.points().size());
}

TEST(StereoWindow, SizesOfTheWindow) {
  for (const auto& [poses, kept] : {std::pair(15, 1), std::pair(15, 8), std::pair(5, 4), std::pair(2, 1)}) {
    Walk walk;
    walk.odometry_m = 0.001;
    walk.make(5);
    StereoWindowOptions options = said(0.1);
    options.poses = poses;
    options.kept_poses = kept;
    StereoWindow window(kCamera, options);
    for (const StereoKeyframe& keyframe : walk.made) window.add(keyframe);
    int full = 0;
    for (const StereoWindowTiming& t : window.timings()) {
      EXPECT_LE(t.poses, poses);
      full += static_cast<int>(t.poses == poses);
    }
    // Filled once, and again with every pose that is not kept.
    EXPECT_EQ(full, 1 + (walk.keyframes - poses) / (poses - kept)) << poses << ' ' << kept;
    EXPECT_EQ(window.windows(), (walk.keyframes - kept - 1) / (poses - kept));
    window.finish();
    expect_chain(window, walk.keyframes);
    EXPECT_LT(worst_position(window.poses(), walk.truth), 1e-5) << poses << ' ' << kept;
  }
}

TEST(StereoWindow, LittleIsNoTrouble) {
  StereoWindow nothing(kCamera, {});
  nothing.finish();
  EXPECT_TRUE(nothing.constraints().empty());
  EXPECT_TRUE(nothing.points().empty());
  // Poses that see nothing: odometry's word is passed on.
  Walk walk;
  walk.keyframes = 4;
  walk.make(1);
  StereoWindow blind(kCamera, {});
  for (StereoKeyframe keyframe : walk.made) {
    keyframe.measurements.clear();
    blind.add(keyframe);
  }
  blind.finish();
  expect_chain(blind, walk.keyframes);
  EXPECT_LT(worst_position(blind.poses(), walk.truth), 1e-9);
  EXPECT_EQ(blind.constraints()[1].covariance, walk.made[2].covariance);
}

TEST(StereoWindow, OptionsThatMakeNoSenseAreRefused) {
  for (const auto& [poses, kept, sigma] : {std::tuple(1, 1, 0.1), std::tuple(15, 15, 0.1), std::tuple(15, 0, 0.1),
                                           std::tuple(101, 8, 0.1), std::tuple(15, 8, 0.0)}) {
    StereoWindowOptions options = said(sigma);
    options.poses = poses;
    options.kept_poses = kept;
    EXPECT_THROW(StereoWindow(kCamera, options), InputError);
  }
}

}  // namespace
}  // namespace parallax
