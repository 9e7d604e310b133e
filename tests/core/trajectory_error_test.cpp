#include "core/trajectory_error.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/error.h"

namespace parallax {
namespace {

TrajectoryPose pose_at(double seconds, const Eigen::Vector3d& position, const Eigen::Vector3d& rotation = {0, 0, 0}) {
  return {from_seconds(seconds), {exp_so3(rotation), position}};
}

Trajectory at_times(const std::vector<double>& seconds) {
  Trajectory out;
  for (const double s : seconds) out.push_back(pose_at(s, {s, 0, 0}));
  return out;
}

// `count` poses a tenth of a second apart on a wandering path.
Trajectory wandering(int count, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> step(0, 0.1);
  Trajectory out;
  RigidTransform pose;
  for (int i = 0; i < count; ++i) {
    Vector6d mu;
    for (int k = 0; k < 6; ++k) mu(k) = step(random);
    pose = pose * RigidTransform::exp(mu);
    out.push_back({from_seconds(0.1 * i), pose});
  }
  return out;
}

std::vector<PoseMatch> all_of(const Trajectory& t) { return associate_by_line(t, t); }

TEST(ErrorStatistics, OfAFewNumbers) {
  const auto s = summarise_errors({3, 1, 2, 6});
  EXPECT_EQ(s.count, 4);
  EXPECT_DOUBLE_EQ(s.mean, 3);
  EXPECT_DOUBLE_EQ(s.median, 2.5);
  EXPECT_DOUBLE_EQ(s.min, 1);
  EXPECT_DOUBLE_EQ(s.max, 6);
  EXPECT_DOUBLE_EQ(s.rmse, std::sqrt(50.0 / 4));
  EXPECT_DOUBLE_EQ(s.deviation, std::sqrt(14.0 / 4));
  EXPECT_DOUBLE_EQ(summarise_errors({5, 9, 7}).median, 7);
  EXPECT_EQ(summarise_errors({}).count, 0);
  EXPECT_EQ(summarise_errors({}).rmse, 0);
}

TEST(Association, TakesTheNearestWithinTheLimit) {
  const auto matches = associate_by_time(at_times({1.004, 2.02, 3.0}), at_times({0.9, 1.0, 2.0, 2.995, 3.001}), 0.01);
  ASSERT_EQ(matches.size(), 2u);
  EXPECT_EQ(matches[0].estimate, 0);
  EXPECT_EQ(matches[0].truth, 1);
  EXPECT_EQ(matches[1].estimate, 2);
  EXPECT_EQ(matches[1].truth, 4);
}

TEST(Association, IsOneToOne) {
  // Two estimates near one true pose: the nearer of them keeps it.
  const auto matches = associate_by_time(at_times({0.992, 1.003}), at_times({0.5, 1.0, 1.5}), 0.01);
  ASSERT_EQ(matches.size(), 1u);
  EXPECT_EQ(matches[0].estimate, 1);
  EXPECT_EQ(matches[0].truth, 1);
}

TEST(Association, WorksWithTheShorterOneOnEitherSide) {
  const auto a = at_times({0, 1, 2, 3, 4, 5}), b = at_times({1.001, 4.002});
  const auto forward = associate_by_time(a, b, 0.01), backward = associate_by_time(b, a, 0.01);
  ASSERT_EQ(forward.size(), 2u);
  ASSERT_EQ(backward.size(), 2u);
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(forward[i].estimate, backward[i].truth);
    EXPECT_EQ(forward[i].truth, backward[i].estimate);
  }
  EXPECT_TRUE(associate_by_time(a, {}, 0.01).empty());
}

TEST(Association, AgreesWithTryingEveryPair) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> time(0, 20);
  std::vector<double> times_a(80), times_b(200);
  for (auto& t : times_a) t = time(random);
  for (auto& t : times_b) t = time(random);
  std::sort(times_a.begin(), times_a.end());
  std::sort(times_b.begin(), times_b.end());
  const auto a = at_times(times_a), b = at_times(times_b);
  int expected = 0;
  const auto matches = associate_by_time(a, b, 0.02);
  std::vector<int> match_of(b.size(), -1);
  for (const auto& m : matches) match_of[static_cast<size_t>(m.truth)] = m.estimate;
  for (int j = 0; j < static_cast<int>(b.size()); ++j) {
    int best = -1;
    for (int i = 0; i < static_cast<int>(a.size()); ++i) {
      const double d = std::abs(times_a[i] - times_b[j]);
      if (d > 0.02) continue;
      bool nearest = true;
      for (const double other : times_b) nearest = nearest && std::abs(times_a[i] - other) >= d;
      if (nearest && (best < 0 || d < std::abs(times_a[best] - times_b[j]))) best = i;
    }
    EXPECT_EQ(match_of[static_cast<size_t>(j)], best);
    expected += best >= 0;
  }
  EXPECT_EQ(static_cast<int>(matches.size()), expected);
  EXPECT_GT(expected, 20);
}

TEST(Association, ByLineNeedsEqualLengths) {
  EXPECT_EQ(associate_by_line(at_times({0, 1}), at_times({5, 6})).size(), 2u);
  EXPECT_THROW(associate_by_line(at_times({0, 1}), at_times({5})), InputError);
}

TEST(Alignment, RecoversASimilarityExactly) {
  const Trajectory truth = wandering(100, 1);
  const SimilarityTransform estimate_from_truth(0.37, exp_so3({1, -2, 0.5}), {4, 5, 6});
  const Trajectory estimate = transform_trajectory(truth, estimate_from_truth);
  TrajectoryErrorOptions options;
  const auto result = evaluate_trajectory(estimate, truth, options);
  EXPECT_LT(summarise_errors(result.position).max, 1e-12);
  EXPECT_LT(summarise_errors(result.rotation_deg).max, 1e-9);
  EXPECT_LT(summarise_errors(result.relative.translation).max, 1e-12);
  EXPECT_NEAR(result.scale, 1 / 0.37, 1e-12);
  EXPECT_NEAR(result.scale_error, 0.37 - 1, 1e-12);
  EXPECT_DOUBLE_EQ(result.tracked_fraction, 1);

  // A rigid alignment cannot take the scale away, and no alignment takes nothing away.
  options.alignment = Alignment::se3;
  const double rigid = summarise_errors(evaluate_trajectory(estimate, truth, options).position).rmse;
  options.alignment = Alignment::none;
  const double none = summarise_errors(evaluate_trajectory(estimate, truth, options).position).rmse;
  EXPECT_GT(rigid, 0.1);
  EXPECT_GT(none, rigid);
}

TEST(Alignment, NoOtherSimilarityIsBetter) {
  const Trajectory truth = wandering(60, 2);
  Trajectory estimate = transform_trajectory(truth, {2.0, exp_so3({0.2, 0.4, 0.1}), {1, 0, 0}});
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, 0.05);
  for (auto& pose : estimate) pose.world_from_camera.t += Eigen::Vector3d(noise(random), noise(random), noise(random));
  const auto matches = all_of(truth);
  const auto best = find_alignment(estimate, truth, matches, Alignment::sim3);
  const auto cost = [&](const SimilarityTransform& T) {
    return summarise_errors(position_errors(transform_trajectory(estimate, T), truth, matches)).rmse;
  };
  const double least = cost(best);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d turn(noise(random), noise(random), noise(random));
    const Eigen::Vector3d shift(noise(random), noise(random), noise(random));
    EXPECT_GE(cost(SimilarityTransform(1 + noise(random), exp_so3(0.1 * turn), 0.1 * shift) * best), least);
  }
}

TEST(Alignment, RefusesWhatDoesNotDetermineIt) {
  const Trajectory line = at_times({0, 1, 2, 3, 4});
  EXPECT_THROW(find_alignment(line, line, all_of(line), Alignment::se3), InputError);
  const Trajectory two = at_times({0, 1});
  EXPECT_THROW(find_alignment(two, two, all_of(two), Alignment::sim3), InputError);
  EXPECT_NO_THROW(find_alignment(two, two, all_of(two), Alignment::none));
  TrajectoryErrorOptions options;
  options.alignment = Alignment::none;
  EXPECT_EQ(evaluate_trajectory(line, line, options).scale, 0);  // not determined
  EXPECT_THROW(evaluate_trajectory(at_times({100, 101, 102}), line, options), InputError);
}

TEST(Errors, RotationIsTheFullAngle) {
  const Trajectory truth{pose_at(0, {0, 0, 0}, {0.3, 0.1, -0.2})};
  const Eigen::Vector3d axis = Eigen::Vector3d(1, 2, 3).normalized();
  for (const double degrees : {0.0, 1e-3, 30.0, 90.0, 179.9}) {
    Trajectory estimate = truth;
    estimate[0].world_from_camera.R *= exp_so3(axis * (degrees * M_PI / 180));
    EXPECT_NEAR(rotation_errors_deg(estimate, truth, all_of(truth))[0], degrees, 1e-6);
  }
}

TEST(RelativePairs, InFrames) {
  const Trajectory path = at_times({0, 1, 2, 3, 4, 5, 6});
  RelativePairOptions options;
  options.delta = 2;
  auto pairs = relative_pairs(path, options);
  ASSERT_EQ(pairs.size(), 3u);
  EXPECT_EQ(pairs[2].first, 4);
  EXPECT_EQ(pairs[2].second, 6);
  options.all_pairs = true;
  pairs = relative_pairs(path, options);
  ASSERT_EQ(pairs.size(), 5u);
  EXPECT_EQ(pairs[1].first, 1);
  EXPECT_EQ(pairs[1].second, 3);
  options.delta = 7;
  EXPECT_TRUE(relative_pairs(path, options).empty());
  options.delta = 2147483648.0;
  EXPECT_THROW(relative_pairs(path, options), InputError);
}

TEST(RelativePairs, InMetresAlongThePath) {
  // There and back: the path counts, not the distance.
  Trajectory path;
  const double positions[] = {0, 0.6, 1.2, 0.6, 0.1, 0.5, 1.3};
  for (int i = 0; i < 7; ++i) path.push_back(pose_at(i, {positions[i], 0, 0}));
  RelativePairOptions options{1.0, true, false, 0.15};
  auto pairs = relative_pairs(path, options);  // reached at 2 (1.2), 4 (1.1), 6 (1.2)
  ASSERT_EQ(pairs.size(), 2u);
  EXPECT_EQ(pairs[0].first, 2);
  EXPECT_EQ(pairs[0].second, 4);
  EXPECT_EQ(pairs[1].first, 4);
  EXPECT_EQ(pairs[1].second, 6);
  options.all_pairs = true;  // lengths 0 0.6 1.2 1.8 2.3 2.7 3.5; within 15 % of 1 m
  pairs = relative_pairs(path, options);
  ASSERT_EQ(pairs.size(), 2u);
  EXPECT_EQ(pairs[0].first, 2);  // 1.1
  EXPECT_EQ(pairs[0].second, 4);
  EXPECT_EQ(pairs[1].first, 3);  // 0.9
  EXPECT_EQ(pairs[1].second, 5);
}

TEST(RelativeErrors, SeesTheStepThatWasWrongAndIgnoresTheWorld) {
  const Trajectory truth = wandering(50, 4);
  Trajectory estimate = truth;
  // From pose 20 on everything is displaced: one wrong step in an estimate that is right otherwise.
  const RigidTransform slip = RigidTransform::exp((Vector6d() << 0.03, 0, 0, 0, 0.02, 0).finished());
  for (size_t i = 20; i < estimate.size(); ++i) {
    estimate[i].world_from_camera =
        truth[19].world_from_camera * slip * truth[19].world_from_camera.inverse() * truth[i].world_from_camera;
  }
  estimate = transform_trajectory(estimate, {1.0, exp_so3({0.5, 0.5, 0.5}), {7, 8, 9}});
  const auto errors = relative_errors(estimate, truth, all_of(truth), {});
  ASSERT_EQ(errors.rotation_deg.size(), 49u);
  for (size_t i = 0; i < errors.rotation_deg.size(); ++i) {
    EXPECT_NEAR(errors.rotation_deg[i], i == 19 ? 0.02 * 180 / M_PI : 0.0, 1e-6) << i;
    if (i != 19) {
      EXPECT_LT(errors.translation[i], 1e-12) << i;
    }
  }
  EXPECT_GT(errors.translation[19], 0.02);
}

TEST(TrackedFraction, CountsFramesNotTruth) {
  std::vector<double> at_30_hz, at_100_hz;
  for (int i = 0; i < 300; ++i) at_30_hz.push_back(i / 30.0);
  for (int i = 0; i <= 1000; ++i) at_100_hz.push_back(i / 100.0);
  EXPECT_EQ(expected_frames(at_times(at_30_hz), at_times(at_30_hz)), 300);
  EXPECT_EQ(expected_frames(at_times(at_30_hz), at_times(at_100_hz)), 301);
  std::vector<double> half(at_30_hz.begin() + 150, at_30_hz.end());
  EXPECT_EQ(expected_frames(at_times(half), at_times(at_30_hz)), 300);

  const Trajectory truth = wandering(100, 6), half_of_it(truth.begin() + 50, truth.end());
  TrajectoryErrorOptions options;
  EXPECT_DOUBLE_EQ(evaluate_trajectory(half_of_it, truth, options).tracked_fraction, 0.5);
  options.frames = 200;
  EXPECT_DOUBLE_EQ(evaluate_trajectory(half_of_it, truth, options).tracked_fraction, 0.25);
}

}  // namespace
}  // namespace parallax
