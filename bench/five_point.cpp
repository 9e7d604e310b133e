// The five-point solver and the two-view solver beside OpenCV's findEssentialMat, on the same synthetic matches.
//
// Counters: correct_percent is the part of 50 problems whose pose is within 0.5 degrees (rotation) and 5 degrees
// (direction of translation) of the truth.
#include "mapper/five_point.h"

#include <benchmark/benchmark.h>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <vector>

#include "mapper/two_view.h"
#include "tests/mapper/two_view_scene.h"

namespace {

using namespace parallax;
using namespace parallax::testing_support;

constexpr int kProblems = 50;

std::vector<TwoViewProblem> problems(int matches, TwoViewScene scene) {
  std::vector<TwoViewProblem> out;
  for (int i = 0; i < kProblems; ++i)
    out.push_back(TwoViewGenerator(static_cast<std::uint64_t>(i))
                      .draw(wide_pinhole(), {.scene = scene, .matches = matches, .noise_px = 0.5, .outliers = 0.3}));
  return out;
}

bool correct(const RigidTransform& found, const RigidTransform& truth) {
  return rotation_error_deg(found, truth) < 0.5 && direction_error_deg(found, truth) < 5.0;
}

void five_point_minimal(benchmark::State& state) {
  TwoViewGenerator generator(1);
  struct Sample {
    std::array<Eigen::Vector3d, 5> a, b;
  };
  std::vector<Sample> samples;
  for (int k = 0; k < 256; ++k) {
    const TwoViewProblem p = generator.draw(wide_pinhole(), {.matches = 5, .noise_px = 0.5, .outliers = 0});
    Sample s;
    for (std::size_t i = 0; i < 5; ++i) {
      wide_pinhole().unproject(p.matches[i].first, &s.a[i]);
      wide_pinhole().unproject(p.matches[i].second, &s.b[i]);
    }
    samples.push_back(s);
  }
  FivePointSolutions solutions;
  std::size_t i = 0;
  double total = 0;
  for (auto _ : state) {
    solve_five_point(samples[i % samples.size()].a, samples[i % samples.size()].b, &solutions);
    benchmark::DoNotOptimize(solutions);
    total += solutions.count;
    ++i;
  }
  state.counters["solutions"] = total / static_cast<double>(i);
}
BENCHMARK(five_point_minimal)->Unit(benchmark::kMicrosecond);

void two_view_ours(benchmark::State& state) {
  const auto set = problems(static_cast<int>(state.range(0)), static_cast<TwoViewScene>(state.range(1)));
  TwoViewOptions options;
  options.min_inlier_fraction = 0.5;
  std::size_t i = 0;
  int right[kProblems] = {};
  for (auto _ : state) {
    std::mt19937_64 rng(i);
    const TwoViewProblem& p = set[i % kProblems];
    const TwoViewResult result = solve_two_view(wide_pinhole(), p.matches, options, &rng);
    right[i % kProblems] =
        result.status == TwoViewStatus::ok && correct(result.second_from_first, p.second_from_first) ? 1 : 0;
    ++i;
  }
  double sum = 0;
  for (const int r : right) sum += r;
  state.counters["correct_percent"] = 100.0 * sum / static_cast<double>(std::min<std::size_t>(i, kProblems));
}

void two_view_opencv(benchmark::State& state, int method) {
  const auto set = problems(static_cast<int>(state.range(0)), static_cast<TwoViewScene>(state.range(1)));
  cv::setNumThreads(1);
  const cv::Matx33d K(320, 0, 319.5, 0, 320, 239.5, 0, 0, 1);
  std::size_t i = 0;
  int right[kProblems] = {};
  for (auto _ : state) {
    const TwoViewProblem& p = set[i % kProblems];
    std::vector<cv::Point2d> a, b;
    for (const TwoViewMatch& m : p.matches) {
      a.emplace_back(m.first.x(), m.first.y());
      b.emplace_back(m.second.x(), m.second.y());
    }
    cv::Mat mask, R, t;
    const cv::Mat E = cv::findEssentialMat(a, b, K, method, 0.99999, 1.5, mask);
    RigidTransform found;
    if (E.rows == 3) {
      cv::recoverPose(E, a, b, K, R, t, mask);
      for (int r = 0; r < 3; ++r) {
        found.t(r) = t.at<double>(r);
        for (int c = 0; c < 3; ++c) found.R(r, c) = R.at<double>(r, c);
      }
    }
    right[i % kProblems] = correct(found, p.second_from_first) ? 1 : 0;
    ++i;
  }
  double sum = 0;
  for (const int r : right) sum += r;
  state.counters["correct_percent"] = 100.0 * sum / static_cast<double>(std::min<std::size_t>(i, kProblems));
}

void scenes(benchmark::internal::Benchmark* b) {
  b->ArgNames({"matches", "scene"})->Unit(benchmark::kMillisecond)->Iterations(2 * kProblems);
  for (const auto scene : {TwoViewScene::planar, TwoViewScene::planar_with_clutter, TwoViewScene::general})
    for (const int matches : {300, 1000}) b->Args({matches, static_cast<int>(scene)});
}
BENCHMARK(two_view_ours)->Apply(scenes);
BENCHMARK_CAPTURE(two_view_opencv, ransac, cv::RANSAC)->Apply(scenes);
BENCHMARK_CAPTURE(two_view_opencv, usac_magsac, cv::USAC_MAGSAC)->Apply(scenes);

}  // namespace

BENCHMARK_MAIN();
