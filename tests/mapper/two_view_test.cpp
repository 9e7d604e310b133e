#include "mapper/two_view.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <sstream>
#include <string>

#include "two_view_scene.h"

namespace parallax {
namespace {

using namespace testing_support;

constexpr int kSeeds = 200;

struct Tally {
  int correct = 0, wrong = 0;  // of those that came back ok
  std::map<TwoViewStatus, int> status;
  std::string text() const {
    std::ostringstream out;
    out << "correct " << correct << " wrong " << wrong << " by status:";
    for (const auto& [s, n] : status) out << ' ' << static_cast<int>(s) << ':' << n;
    return out.str();
  }
  int count(TwoViewStatus s) const {
    const auto at = status.find(s);
    return at == status.end() ? 0 : at->second;
  }
};

Tally run(const CameraModel& camera, const TwoViewSettings& settings, const TwoViewOptions& options = {},
          double max_rotation_deg = 0.5, double max_direction_deg = 5.0) {
  Tally tally;
  for (int seed = 0; seed < kSeeds; ++seed) {
    TwoViewGenerator generator(static_cast<std::uint64_t>(seed) + 1000);
    const TwoViewProblem problem = generator.draw(camera, settings);
    std::mt19937_64 rng(static_cast<std::uint64_t>(seed));
    const TwoViewResult result = solve_two_view(camera, problem.matches, options, &rng);
    ++tally.status[result.status];
    if (result.status != TwoViewStatus::ok) continue;
    const bool correct = rotation_error_deg(result.second_from_first, problem.second_from_first) < max_rotation_deg &&
                         direction_error_deg(result.second_from_first, problem.second_from_first) < max_direction_deg;
    (correct ? tally.correct : tally.wrong) += 1;
  }
  return tally;
}

TwoViewOptions forgiving() {
  TwoViewOptions options;
  options.min_inlier_fraction = 0.5;
  return options;
}

constexpr int k99 = kSeeds * 99 / 100;

struct Case {
  const char* name;
  TwoViewSettings settings;
};

class TwoViewCases : public ::testing::TestWithParam<Case> {};

TEST_P(TwoViewCases, PoseIsRightWithAPinhole) {
  const Tally tally = run(wide_pinhole(), GetParam().settings, forgiving());
  EXPECT_GE(tally.correct, k99) << tally.text();
}

TEST_P(TwoViewCases, PoseIsRightWithADistortedLens) {
  const Tally tally = run(wide_fov(), GetParam().settings, forgiving());
  EXPECT_GE(tally.correct, k99) << tally.text();
}

constexpr auto kPlanar = TwoViewScene::planar;
constexpr auto kClutter = TwoViewScene::planar_with_clutter;
constexpr auto kGeneral = TwoViewScene::general;
constexpr auto kForward = TwoViewScene::forward;
INSTANTIATE_TEST_SUITE_P(
    Scenes, TwoViewCases,
    ::testing::Values(Case{"planar_exact", {.scene = kPlanar, .noise_px = 0, .outliers = 0}},
                      Case{"planar", {.scene = kPlanar, .matches = 500, .noise_px = 0.5, .outliers = 0.25}},
                      Case{"planar_many_outliers",
                           {.scene = kPlanar, .matches = 800, .noise_px = 0.5, .outliers = 0.4}},
                      Case{"clutter", {.scene = kClutter, .matches = 500, .noise_px = 0.5, .outliers = 0.25}},
                      Case{"clutter_few", {.scene = kClutter, .matches = 300, .noise_px = 0.5, .outliers = 0.4}},
                      Case{"clutter_noisy", {.scene = kClutter, .matches = 1000, .noise_px = 1.0, .outliers = 0.4}},
                      Case{"clutter_clean", {.scene = kClutter, .matches = 300, .noise_px = 0.3, .outliers = 0.1}},
                      Case{"general", {.scene = kGeneral, .matches = 500, .noise_px = 0.5, .outliers = 0.4}},
                      Case{"general_noisy", {.scene = kGeneral, .matches = 500, .noise_px = 1.0, .outliers = 0.3}},
                      Case{"forward", {.scene = kForward, .matches = 500, .noise_px = 0.5, .outliers = 0.3}}),
    [](const auto& test) { return test.param.name; });

TEST(TwoView, InliersAreTheTruePointsToScale) {
  const CameraModel camera = wide_fov();
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    TwoViewGenerator generator(seed);
    const TwoViewProblem problem = generator.draw(camera, {.scene = kClutter, .matches = 400, .noise_px = 0.3});
    std::mt19937_64 rng(seed);
    const TwoViewResult result = solve_two_view(camera, problem.matches, {}, &rng);
    ASSERT_EQ(result.status, TwoViewStatus::ok);
    ASSERT_EQ(result.inlier.size(), problem.matches.size());
    ASSERT_EQ(result.points.size(), problem.matches.size());
    EXPECT_NEAR(result.second_from_first.t.norm(), 1.0, 1e-9);
    const double metres = problem.second_from_first.t.norm();
    int true_inliers = 0, kept = 0, false_inliers = 0;
    std::vector<double> errors;
    for (std::size_t i = 0; i < problem.matches.size(); ++i) {
      if (problem.outlier[i] == 0) ++true_inliers;
      if (result.inlier[i] == 0) continue;
      if (problem.outlier[i] != 0) {
        ++false_inliers;
        continue;
      }
      ++kept;
      errors.push_back((metres * result.points[i] - problem.points[i]).norm() / problem.points[i].norm());
      Eigen::Vector2d px;
      ASSERT_TRUE(camera.project(result.points[i], &px));
      EXPECT_LT((px - problem.matches[i].first).norm(), 3.0);
    }
    EXPECT_GE(kept, true_inliers * 98 / 100);
    EXPECT_LE(false_inliers, static_cast<int>(problem.matches.size()) * 6 / 100);
    std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2), errors.end());
    EXPECT_LT(errors[errors.size() / 2], 0.04);
    EXPECT_GT(result.score, 0.5);
  }
}

TEST(TwoView, ExactMatchesGiveTheExactPose) {
  for (const auto scene : {kPlanar, kClutter, kGeneral, kForward}) {
    for (std::uint64_t seed = 0; seed < 30; ++seed) {
      TwoViewGenerator generator(seed);
      const TwoViewProblem problem =
          generator.draw(wide_pinhole(), {.scene = scene, .matches = 200, .noise_px = 0, .outliers = 0});
      std::mt19937_64 rng(seed);
      const TwoViewResult result = solve_two_view(wide_pinhole(), problem.matches, {}, &rng);
      ASSERT_EQ(result.status, TwoViewStatus::ok) << static_cast<int>(scene) << " seed " << seed;
      EXPECT_LT(rotation_error_deg(result.second_from_first, problem.second_from_first), 1e-4);
      EXPECT_LT(direction_error_deg(result.second_from_first, problem.second_from_first), 1e-3);
      EXPECT_EQ(result.planar, scene == kPlanar);
    }
  }
}

TEST(TwoView, RotationOnlyIsRefusedByName) {
  for (const double noise : {0.0, 0.5, 1.0})
    for (const double outliers : {0.0, 0.35}) {
      const Tally tally = run(
          wide_pinhole(), {.scene = TwoViewScene::rotation_only, .noise_px = noise, .outliers = outliers}, forgiving());
      EXPECT_EQ(tally.count(TwoViewStatus::ok), 0) << tally.text();
      EXPECT_GE(tally.count(TwoViewStatus::rotation_only), k99)
          << tally.text() << " noise " << noise << " " << outliers;
    }
}

TEST(TwoView, NoMotionIsRefusedByName) {
  for (const double noise : {0.0, 1.0})
    for (const double outliers : {0.0, 0.3}) {
      const Tally tally =
          run(wide_fov(), {.scene = TwoViewScene::no_motion, .noise_px = noise, .outliers = outliers}, forgiving());
      EXPECT_EQ(tally.count(TwoViewStatus::ok), 0) << tally.text();
      EXPECT_GE(tally.count(TwoViewStatus::too_little_parallax), k99) << tally.text() << " noise " << noise;
    }
}

TEST(TwoView, ATinyBaselineIsNeverAccepted) {
  for (const auto scene : {kPlanar, kGeneral}) {
    const Tally tally = run(wide_pinhole(), {.scene = scene, .noise_px = 0.5, .outliers = 0.2, .baseline = 0.005});
    EXPECT_EQ(tally.count(TwoViewStatus::ok), 0) << tally.text();
    EXPECT_GE(tally.count(TwoViewStatus::rotation_only) + tally.count(TwoViewStatus::too_little_parallax), k99)
        << tally.text();
  }
}

TEST(TwoView, RandomMatchesAreInconsistent) {
  const Tally tally = run(wide_pinhole(), {.scene = TwoViewScene::random, .matches = 300});
  EXPECT_EQ(tally.count(TwoViewStatus::inconsistent), kSeeds) << tally.text();
}

TEST(TwoView, MostlyOutliersAreInconsistent) {
  const Tally tally = run(wide_pinhole(), {.scene = kClutter, .matches = 500, .outliers = 0.6});
  EXPECT_EQ(tally.count(TwoViewStatus::ok), 0) << tally.text();
  EXPECT_GE(tally.count(TwoViewStatus::inconsistent), k99) << tally.text();
}

TEST(TwoView, FewMatchesAreRefusedByName) {
  const Tally tally = run(wide_pinhole(), {.scene = kClutter, .matches = 49, .outliers = 0});
  EXPECT_EQ(tally.count(TwoViewStatus::too_few_matches), kSeeds) << tally.text();
  std::mt19937_64 rng(1);
  EXPECT_EQ(solve_two_view(wide_pinhole(), {}, {}, &rng).status, TwoViewStatus::too_few_matches);
}

TEST(TwoView, SixtyMatchesAreEnoughWhenTheyAreGood) {
  TwoViewOptions options = forgiving();
  options.min_inliers = 30;
  const Tally tally =
      run(wide_pinhole(), {.scene = kClutter, .matches = 60, .noise_px = 0.3, .outliers = 0.2}, options, 1.0, 8.0);
  EXPECT_EQ(tally.wrong, 0) << tally.text();
  EXPECT_GE(tally.correct, kSeeds * 95 / 100) << tally.text();
}

// Moving towards a plane at an angle, both decompositions put every point in front of both cameras: nothing in the
// matches tells them apart, and the answer must be a refusal unless the two are nearly one.
TEST(TwoView, TheMirroredPlaneIsNeverAccepted) {
  for (const double noise : {0.0, 0.5}) {
    const Tally tally =
        run(wide_pinhole(), {.scene = TwoViewScene::approach_plane, .matches = 500, .noise_px = noise, .outliers = 0.2},
            forgiving(), 1.5, 10.0);
    EXPECT_LE(tally.wrong, kSeeds / 100) << tally.text() << " noise " << noise;
    EXPECT_GE(tally.count(TwoViewStatus::ambiguous), kSeeds * 9 / 10) << tally.text();
  }
}

// What stands out of the plane settles it.
TEST(TwoView, ClutterSettlesTheMirroredPlane) {
  Tally tally;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    TwoViewGenerator generator(seed);
    TwoViewProblem problem = generator.draw(
        wide_pinhole(), {.scene = TwoViewScene::approach_plane, .matches = 400, .noise_px = 0.3, .outliers = 0});
    // A fifth of the points come forward by a fifth to two fifths.
    for (std::size_t i = 0; i < problem.matches.size(); i += 5) {
      const Eigen::Vector3d point = problem.points[i] * generator.uniform(0.6, 0.8);
      Eigen::Vector2d a, b;
      if (!wide_pinhole().project(point, &a) || !wide_pinhole().project(problem.second_from_first * point, &b))
        continue;
      problem.matches[i] = {a, b};
    }
    std::mt19937_64 rng(seed);
    const TwoViewResult result = solve_two_view(wide_pinhole(), problem.matches, {}, &rng);
    ++tally.status[result.status];
    if (result.status != TwoViewStatus::ok) continue;
    const bool correct = rotation_error_deg(result.second_from_first, problem.second_from_first) < 0.5 &&
                         direction_error_deg(result.second_from_first, problem.second_from_first) < 5;
    (correct ? tally.correct : tally.wrong) += 1;
  }
  EXPECT_GE(tally.correct, k99) << tally.text();
}

TEST(TwoView, PlanarFlagTellsPlanesFromClutter) {
  int planar = 0, cluttered = 0;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    for (const auto scene : {kPlanar, kGeneral}) {
      TwoViewGenerator generator(seed);
      const TwoViewProblem problem = generator.draw(wide_pinhole(), {.scene = scene, .noise_px = 0.5, .outliers = 0.2});
      std::mt19937_64 rng(seed);
      const TwoViewResult result = solve_two_view(wide_pinhole(), problem.matches, {}, &rng);
      (scene == kPlanar ? planar : cluttered) += result.planar ? 1 : 0;
    }
  }
  EXPECT_GE(planar, 49);
  EXPECT_EQ(cluttered, 0);
}

TEST(TwoView, SameSeedSameAnswerToTheBit) {
  TwoViewGenerator generator(4);
  const TwoViewProblem problem = generator.draw(wide_fov(), {});
  std::mt19937_64 rng1(9), rng2(9);
  const TwoViewResult a = solve_two_view(wide_fov(), problem.matches, {}, &rng1);
  const TwoViewResult b = solve_two_view(wide_fov(), problem.matches, {}, &rng2);
  EXPECT_EQ(a.second_from_first.R, b.second_from_first.R);
  EXPECT_EQ(a.second_from_first.t, b.second_from_first.t);
  EXPECT_EQ(a.inlier, b.inlier);
  EXPECT_EQ(a.points, b.points);
  EXPECT_EQ(rng1, rng2);
}

TEST(TwoView, UnusableMatchesAreSkipped) {
  TwoViewGenerator generator(4);
  TwoViewProblem problem = generator.draw(wide_fov(), {});
  problem.matches[3].first.x() = NAN;
  problem.matches[7].second.y() = INFINITY;
  std::mt19937_64 rng(9);
  const TwoViewResult result = solve_two_view(wide_fov(), problem.matches, {}, &rng);
  EXPECT_EQ(result.status, TwoViewStatus::ok);
  EXPECT_EQ(result.inlier[3], 0);
  EXPECT_EQ(result.inlier[7], 0);
}

TEST(TwoView, EveryStatusHasItsSentence) {
  std::vector<std::string> seen;
  for (const auto status :
       {TwoViewStatus::ok, TwoViewStatus::too_few_matches, TwoViewStatus::rotation_only,
        TwoViewStatus::too_little_parallax, TwoViewStatus::ambiguous, TwoViewStatus::inconsistent}) {
    const std::string text = describe(status);
    EXPECT_GT(text.size(), 10u);
    EXPECT_EQ(text.back(), '.');
    EXPECT_EQ(std::find(seen.begin(), seen.end(), text), seen.end());
    seen.push_back(text);
  }
}

}  // namespace
}  // namespace parallax
