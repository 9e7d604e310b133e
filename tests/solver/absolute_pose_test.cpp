#include "solver/absolute_pose.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "tests/support/lenses.h"

namespace parallax {
namespace {

double uniform(std::mt19937_64& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

RigidTransform random_pose(std::mt19937_64& random, double metres, double radians) {
  std::normal_distribution<double> gauss;
  Vector6d mu;
  for (int k = 0; k < 6; ++k) mu[k] = (k < 3 ? metres : radians) * gauss(random);
  return RigidTransform::exp(mu);
}

// Angle and, in parts of `depth`, distance.
double pose_error(const RigidTransform& a, const RigidTransform& b, double depth) {
  return std::max((a.R * b.R.transpose() - Eigen::Matrix3d::Identity()).norm(),
                  (a.inverse().t - b.inverse().t).norm() / depth);
}

struct Triple {
  RigidTransform truth;
  std::array<Eigen::Vector3d, 3> points, rays;
  double depth = 1;
};

Triple triple_of(const RigidTransform& truth, const std::array<Eigen::Vector3d, 3>& in_camera,
                 std::mt19937_64& random) {
  Triple t;
  t.truth = truth;
  for (int i = 0; i < 3; ++i) {
    t.points[i] = truth.inverse() * in_camera[i];
    t.rays[i] = in_camera[i] * uniform(random, 0.1, 4);
    t.depth = std::max(t.depth, in_camera[i].norm());
  }
  return t;
}

double nearest_solution(const Triple& t) {
  std::array<RigidTransform, 4> poses;
  const int n = solve_three_points(t.points, t.rays, &poses);
  EXPECT_LE(n, 4);
  double best = std::numeric_limits<double>::infinity();
  for (int k = 0; k < n; ++k) {
    EXPECT_TRUE(poses[k].R.allFinite() && poses[k].t.allFinite());
    EXPECT_NEAR(poses[k].R.determinant(), 1, 1e-9);
    // Every solution is one: each point lies on its ray, in front.
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d p = poses[k] * t.points[i];
      EXPECT_LT(p.normalized().cross(t.rays[i].normalized()).norm(), 1e-6);
      EXPECT_GT(p.dot(t.rays[i]), 0);
    }
    best = std::min(best, pose_error(poses[k], t.truth, t.depth));
  }
  return best;
}

TEST(ThreePoints, TheTruthIsAmongTheSolutions) {
  std::mt19937_64 random(1);
  constexpr int draws = 5000;
  int found = 0;
  double worst = 0;
  for (int i = 0; i < draws; ++i) {
    std::array<Eigen::Vector3d, 3> p;
    for (auto& v : p)
      v = Eigen::Vector3d(uniform(random, -0.8, 0.8), uniform(random, -0.6, 0.6), 1) * uniform(random, 0.3, 5);
    const double error = nearest_solution(triple_of(random_pose(random, 2, 1.5), p, random));
    found += error < 1e-6;
    if (error < 1e-6) worst = std::max(worst, error);
  }
  std::printf("%d of %d draws to 1e-6\n", found, draws);
  EXPECT_GE(found, draws * 0.998);
}

// Nearly on one line, nearly the same ray, far away and small, and on the cylinder through the camera on which two
// solutions meet (Thompson 1966; there the pose itself is known to half the digits only).
TEST(ThreePoints, NearlyDegenerateTriples) {
  std::mt19937_64 random(2);
  const char* names[] = {"flat triangle", "close rays", "far and small", "dangerous cylinder"};
  const double tolerance[] = {1e-4, 1e-4, 1e-4, 1e-3};
  for (int kind = 0; kind < 4; ++kind) {
    constexpr int draws = 1000;
    int found = 0, exact = 0;
    for (int i = 0; i < draws;) {
      std::array<Eigen::Vector3d, 3> p;
      for (auto& v : p)
        v = Eigen::Vector3d(uniform(random, -0.6, 0.6), uniform(random, -0.5, 0.5), 1) * uniform(random, 0.5, 3);
      const Eigen::Vector3d small =
          Eigen::Vector3d(uniform(random, -1, 1), uniform(random, -1, 1), uniform(random, -1, 1));
      if (kind == 0) p[2] = p[0] + uniform(random, 0.2, 0.8) * (p[1] - p[0]) + 1e-3 * small;
      if (kind == 1) p[1] = p[0] * uniform(random, 1.3, 2) + 1e-3 * small;
      if (kind == 2)
        for (auto& v : p) v = Eigen::Vector3d(0.2, 0.1, 50) + 0.5 * v;
      if (kind == 3) {
        // The camera stands on the circular cylinder over the circle through the three points.
        const Eigen::Vector3d camera(1, 0, uniform(random, 1, 3));
        const Eigen::Matrix3d turn = exp_so3(random_pose(random, 1, 0).t);
        for (auto& v : p) {
          const double angle = uniform(random, 0.3, 2 * M_PI - 0.3);
          v = turn * (Eigen::Vector3d(std::cos(angle), std::sin(angle), 0) - camera);
        }
        const double closest = std::min({(p[0] - p[1]).norm(), (p[0] - p[2]).norm(), (p[1] - p[2]).norm()});
        if (closest < 0.2) continue;
      }
      ++i;
      const double error = nearest_solution(triple_of(random_pose(random, 2, 1.5), p, random));
      found += error < tolerance[kind];
      exact += error < 1e-6;
    }
    std::printf("%-20s %d of %d to %g, %d to 1e-6\n", names[kind], found, draws, tolerance[kind], exact);
    EXPECT_GE(found, 0.99 * draws) << names[kind];
  }
}

// Straight above an equilateral triangle, and other poses where all cosines are the same or a distance ratio is one.
TEST(ThreePoints, SymmetricPoses) {
  std::mt19937_64 random(3);
  for (double height : {0.3, 0.7, 1.0, 2.0, 10.0}) {
    for (double side : {0.1, 1.0}) {
      std::array<Eigen::Vector3d, 3> p;
      for (int i = 0; i < 3; ++i) {
        const double angle = 2 * M_PI * i / 3 + 0.2;
        p[i] = Eigen::Vector3d(side * std::cos(angle), side * std::sin(angle), height);
      }
      // At height = radius * sqrt(2) ... the answers may touch: half the digits.
      EXPECT_LT(nearest_solution(triple_of(random_pose(random, 1, 1), p, random)), 1e-5) << height << " " << side;
      p[0] *= 1.5;  // isosceles
      EXPECT_LT(nearest_solution(triple_of(random_pose(random, 1, 1), p, random)), 1e-5) << height << " " << side;
    }
  }
  // Three corners of a square tile seen straight on.
  const std::array<Eigen::Vector3d, 3> tile = {Eigen::Vector3d(0, 0, 1), {1, 0, 1}, {0, 1, 1}};
  EXPECT_LT(nearest_solution(triple_of(RigidTransform(), tile, random)), 1e-5);
}

TEST(ThreePoints, DegenerateTriplesGiveNothing) {
  std::mt19937_64 random(4);
  std::array<RigidTransform, 4> poses;
  const std::array<Eigen::Vector3d, 3> rays = {Eigen::Vector3d(0, 0, 1), {0.3, 0, 1}, {0, 0.2, 1}};
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 500; ++i) {
    const RigidTransform from = random_pose(random, 3, 2);
    const Eigen::Vector3d a = from * Eigen::Vector3d(0.1, 0.2, 1), b = from * Eigen::Vector3d(-0.3, 0.1, 1.4);
    const Eigen::Vector3d on_line = a + uniform(random, -2, 3) * (b - a);
    EXPECT_EQ(solve_three_points({a, b, on_line}, rays, &poses), 0);
    EXPECT_EQ(solve_three_points({a, a, b}, rays, &poses), 0);
    EXPECT_EQ(solve_three_points({a, b, a}, rays, &poses), 0);
    EXPECT_EQ(solve_three_points({b, a, a}, rays, &poses), 0);
    EXPECT_EQ(solve_three_points({a, a, a}, rays, &poses), 0);
  }
  const std::array<Eigen::Vector3d, 3> good = {Eigen::Vector3d(0, 0, 2), {0.5, 0, 2}, {0, 0.5, 2.5}};
  EXPECT_GT(solve_three_points(good, {good[0], good[1], good[2]}, &poses), 0);
  for (int k = 0; k < 3; ++k) {
    for (double bad : {nan, inf, 0.0}) {
      auto spoilt = rays;
      spoilt[k] = Eigen::Vector3d::Constant(bad);
      EXPECT_EQ(solve_three_points(good, spoilt, &poses), 0) << k << " " << bad;
      if (bad == 0.0) continue;
      spoilt = good;
      spoilt[k].y() = bad;
      EXPECT_EQ(solve_three_points(spoilt, rays, &poses), 0) << k << " " << bad;
    }
  }
  // The same ray three times or twice: whatever comes back is finite.
  for (const auto& r : {std::array{rays[0], rays[0], rays[0]}, std::array{rays[0], rays[0], rays[1]}}) {
    const int n = solve_three_points(good, r, &poses);
    for (int k = 0; k < n; ++k) EXPECT_TRUE(poses[k].R.allFinite() && poses[k].t.allFinite());
  }
}

struct Scene {
  CameraModel camera;
  RigidTransform truth;
  std::vector<PoseObservation> matches;
  double depth = 0;
};

// Matches of points before the camera; of them a part is wrong: pixels anywhere in the image. Noise in units of
// sigma_px.
Scene make_scene(int kind, int n, double outliers, double noise, bool planar, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> gauss;
  Scene s;
  s.camera = testing::lens(kind);
  s.truth = random_pose(random, 1.0, 1.0);
  const Eigen::Vector3d slope(uniform(random, -0.5, 0.5), uniform(random, -0.5, 0.5), 0);
  while (static_cast<int>(s.matches.size()) < n) {
    const Eigen::Vector2d pixel(uniform(random, 5, 634), uniform(random, 5, 474));
    Eigen::Vector3d ray;
    if (!s.camera.unproject(pixel, &ray)) continue;
    const Eigen::Vector3d point = ray * (planar ? 1.2 / (1 - slope.dot(ray) * 0.8) : uniform(random, 0.6, 2.0));
    if (point.z() < 0.3 || point.z() > 4) continue;
    PoseObservation o;
    o.sigma_px = static_cast<double>(1 << (random() % 3));
    o.point = s.truth.inverse() * point;
    const bool wrong = static_cast<int>(s.matches.size()) < outliers * n;
    o.pixel = wrong ? Eigen::Vector2d(uniform(random, 0, 639), uniform(random, 0, 479))
                    : Eigen::Vector2d(pixel + noise * o.sigma_px * Eigen::Vector2d(gauss(random), gauss(random)));
    s.matches.push_back(o);
    s.depth += point.z() / n;
  }
  std::shuffle(s.matches.begin(), s.matches.end(), random);
  return s;
}

class AbsolutePose : public ::testing::TestWithParam<std::tuple<int, bool, double>> {};

TEST_P(AbsolutePose, FindsThePoseAmongOutliers) {
  const auto [kind, planar, outliers] = GetParam();
  constexpr int seeds = 200;
  int right = 0;
  double sum2 = 0;
  for (int seed = 0; seed < seeds; ++seed) {
    const Scene s = make_scene(kind, 100, outliers, 0.7, planar, 1000 + seed);
    std::mt19937_64 rng(seed);
    RigidTransform pose;
    const AbsolutePoseSummary summary = solve_absolute_pose(s.camera, s.matches, AbsolutePoseOptions{}, &rng, &pose);
    if (!summary.ok) continue;
    const double turn = (pose * s.truth.inverse()).angle();
    const double moved = (pose.inverse().t - s.truth.inverse().t).norm() / s.depth;
    // Several standard deviations of what 40 to 70 matches of some 1.4 px tell; a plane seen from before tells less.
    const double limit = planar ? 0.02 : 0.008;
    right += turn < limit && moved < limit;
    sum2 += moved * moved;
    EXPECT_GE(summary.inliers, 0.9 * (1 - outliers) * 100);
    EXPECT_LE(summary.inliers, (1 - outliers) * 100 + 6);
  }
  std::printf("%d of %d; rms position %.3f %% of depth\n", right, seeds, 100 * std::sqrt(sum2 / seeds));
  EXPECT_GE(right, 0.99 * seeds);
  EXPECT_LT(std::sqrt(sum2 / seeds), planar ? 0.006 : 0.003);
}

INSTANTIATE_TEST_SUITE_P(Scenes, AbsolutePose,
                         ::testing::Combine(::testing::Range(0, 4), ::testing::Bool(), ::testing::Values(0.3, 0.6)));

// Nine of ten are wrong: chance finds the pose rarely, how each match turns tells which go together.
TEST(AbsolutePose, TurnsTellWhichGoTogether) {
  constexpr int seeds = 100;
  int right = 0, right_without = 0;
  for (int seed = 0; seed < seeds; ++seed) {
    Scene s = make_scene(1, 160, 0.9, 0.7, false, 5000 + seed);
    std::mt19937_64 random(seed);
    const double turn = uniform(random, -M_PI, M_PI);
    std::vector<double> turns;
    for (const PoseObservation& m : s.matches) {
      Eigen::Vector2d pixel;
      const bool fits = s.camera.project(s.truth * m.point, &pixel) && (pixel - m.pixel).norm() < 5 * m.sigma_px;
      turns.push_back((fits ? turn + uniform(random, -0.25, 0.25) : uniform(random, -M_PI, M_PI)) +
                      2 * M_PI * static_cast<double>(random() % 3));
    }
    for (bool known : {true, false}) {
      AbsolutePoseOptions options;
      options.max_hypotheses = 400;
      if (known) options.turns = turns;
      RigidTransform pose;
      std::mt19937_64 rng(seed);
      if (!solve_absolute_pose(s.camera, s.matches, options, &rng, &pose).ok) continue;
      (known ? right : right_without) += pose_error(pose, s.truth, s.depth) < 0.03 ? 1 : 0;
    }
  }
  std::printf("%d of %d, %d without turns\n", right, seeds, right_without);
  EXPECT_GE(right, 0.9 * seeds);
  EXPECT_LT(right_without, 0.5 * seeds);
}

// Each turned otherwise: there is nothing to try, and nothing is found.
TEST(AbsolutePose, MatchesThatAllTurnDifferentlyGiveNothing) {
  const Scene s = make_scene(0, 12, 0, 0.3, false, 3);
  std::vector<double> turns;
  for (int i = 0; i < 12; ++i) turns.push_back(2 * M_PI * i / 12);
  AbsolutePoseOptions options;
  options.turns = turns;
  RigidTransform pose;
  std::mt19937_64 rng(1);
  EXPECT_FALSE(solve_absolute_pose(s.camera, s.matches, options, &rng, &pose).ok);
  options.max_turn_difference = 0.6;
  EXPECT_TRUE(solve_absolute_pose(s.camera, s.matches, options, &rng, &pose).ok);
}

TEST(AbsolutePose, WithoutNoiseIsExact) {
  for (int kind = 0; kind < 4; ++kind) {
    const Scene s = make_scene(kind, 60, 0.4, 0.0, false, 5);
    std::mt19937_64 rng(1);
    RigidTransform pose;
    ASSERT_TRUE(solve_absolute_pose(s.camera, s.matches, AbsolutePoseOptions{}, &rng, &pose).ok);
    EXPECT_LT(pose_error(pose, s.truth, s.depth), 1e-6);
  }
}

// All matches wrong, from few to very many, in a small and in a large image, fine and coarse.
TEST(AbsolutePose, RefusesMatchesByChance) {
  const CameraModel small(CameraModelKind::pinhole, 320, 240, {250, 250}, {160, 120});
  for (int n : {12, 40, 150, 600}) {
    for (double sigma : {1.0, 4.0}) {
      int accepted = 0;
      for (int seed = 0; seed < 20; ++seed) {
        Scene s = make_scene(0, n, 1.0, 0, seed % 2 != 0, 77 + seed);
        for (PoseObservation& o : s.matches) {
          o.sigma_px = sigma;
          o.pixel /= 2;
        }
        std::mt19937_64 rng(seed);
        const RigidTransform before = random_pose(rng, 1, 1);
        RigidTransform pose = before;
        const bool ok = solve_absolute_pose(small, s.matches, AbsolutePoseOptions{}, &rng, &pose).ok;
        accepted += ok;
        EXPECT_TRUE(ok || (pose.R == before.R && pose.t == before.t));
      }
      EXPECT_EQ(accepted, 0) << n << " matches of " << sigma << " px";
    }
  }
}

TEST(AbsolutePose, RefusesTooFew) {
  const Scene s = make_scene(0, 40, 0, 0.5, false, 9);
  RigidTransform pose;
  for (std::size_t n : {0u, 1u, 3u, 11u}) {
    std::mt19937_64 rng(1);
    EXPECT_FALSE(solve_absolute_pose(s.camera, std::span(s.matches).first(n), AbsolutePoseOptions{}, &rng, &pose).ok)
        << n;
  }
  std::mt19937_64 rng(1);
  EXPECT_TRUE(solve_absolute_pose(s.camera, s.matches, AbsolutePoseOptions{}, &rng, &pose).ok);
  AbsolutePoseOptions strict;
  strict.min_inliers = 41;
  EXPECT_FALSE(solve_absolute_pose(s.camera, s.matches, strict, &rng, &pose).ok);
  // All the same place: no pose.
  std::vector<PoseObservation> same(50, s.matches.front());
  EXPECT_FALSE(solve_absolute_pose(s.camera, same, AbsolutePoseOptions{}, &rng, &pose).ok);
}

TEST(AbsolutePose, LeavesOutWhatIsNotFinite) {
  Scene s = make_scene(1, 60, 0.2, 0.5, false, 12);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  RigidTransform clean, pose;
  std::mt19937_64 rng(1), same(1);
  const AbsolutePoseSummary without = solve_absolute_pose(s.camera, s.matches, AbsolutePoseOptions{}, &rng, &clean);
  ASSERT_TRUE(without.ok);
  for (int i = 0; i < 30; ++i) {
    PoseObservation bad = s.matches[i];
    (i % 3 == 0 ? bad.point.z() : i % 3 == 1 ? bad.pixel.x() : bad.sigma_px) = nan;
    s.matches.push_back(bad);
  }
  const AbsolutePoseSummary with = solve_absolute_pose(s.camera, s.matches, AbsolutePoseOptions{}, &same, &pose);
  EXPECT_TRUE(with.ok);
  EXPECT_EQ(with.inliers, without.inliers);
  EXPECT_TRUE(pose.R == clean.R && pose.t == clean.t);
}

TEST(AbsolutePose, TheSameGeneratorGivesTheSamePose) {
  const Scene s = make_scene(2, 120, 0.5, 0.8, false, 4);
  RigidTransform first, second;
  std::mt19937_64 a(8), b(8);
  const auto one = solve_absolute_pose(s.camera, s.matches, AbsolutePoseOptions{}, &a, &first);
  const auto two = solve_absolute_pose(s.camera, s.matches, AbsolutePoseOptions{}, &b, &second);
  ASSERT_TRUE(one.ok && two.ok);
  EXPECT_EQ(one.inliers, two.inliers);
  EXPECT_TRUE(first.R == second.R && first.t == second.t);
  EXPECT_EQ(a(), b());
}

}  // namespace
}  // namespace parallax
