// The windowed bundle adjustment beside Ceres (DENSE_SCHUR, one thread, Euclidean points): the same window, start, loss
// and stopping rule, side by side in one run; then with Tukey's kernel and its estimated scale, as it is used, with and
// without the vectors of the processor, and the covariances of the window's pairs of neighbours.
//
//   bench_window_smoothing [repetitions]
#include "solver/window_smoothing.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <functional>

#include "core/cpu_dispatch.h"
#include "core/time.h"
#include "tests/solver/ceres_window.h"
#include "tests/solver/synthetic_window.h"

using namespace parallax;

namespace {

struct Run {
  const char* name;
  std::function<WindowSummary()> solve;
  double best_ms = 1e300;
  WindowSummary summary{};
};

// Interleaved, best of several: other work on the machine hits all of them alike.
void compare(const char* title, std::vector<Run> runs, int repetitions) {
  for (int r = 0; r < repetitions; ++r)
    for (Run& run : runs) {
      const auto start = SteadyClock::now();
      run.summary = run.solve();
      run.best_ms = std::min(run.best_ms, milliseconds_since(start));
    }
  std::printf("%s\n", title);
  for (const Run& run : runs)
    std::printf("  %-24s %8.3f ms  %3d iterations (%6.3f ms each)  cost %.10g -> %.10g  %6.1fx\n", run.name,
                run.best_ms, run.summary.iterations, run.best_ms / std::max(1, run.summary.iterations),
                run.summary.initial_cost, run.summary.final_cost, runs.front().best_ms / run.best_ms);
  std::fflush(stdout);
}

void compare_window(int poses, int points, double seen, int repetitions) {
  const auto window = testing::make_window(
      {.poses = poses, .points = points, .noise_px = 0.5, .outliers = 0.02, .mono = 0.05, .seen = seen}, 1);
  char title[160];
  std::snprintf(title, sizeof title, "%d poses, %d points, %zu observations", poses, points,
                window.start.observations.size());
  WindowOptions huber, used;
  huber.kernel = RobustKernel::huber;
  huber.estimate_sigma = false;
  const auto ours = [&](const WindowOptions& options) {
    WindowProblem problem = window.start;
    return smooth_window(&problem, options);
  };
  const SimdLevel level = simd_level();
  WindowProblem smoothed = window.start;
  smooth_window(&smoothed, used);
  std::vector<std::pair<int, int>> pairs;
  for (int i = 0; i + 1 < poses; ++i) pairs.push_back({i, i + 1});
  compare(title,
          {{"Ceres, Huber",
            [&] {
              WindowProblem problem = window.start;
              return testing::ceres_smooth_window(&problem, huber);
            }},
           {"ours, Huber", [&] { return ours(huber); }},
           {"ours, Tukey", [&] { return ours(used); }},
           {"ours, Tukey, baseline",
            [&] {
              set_simd_level(SimdLevel::kScalar);
              const WindowSummary summary = ours(used);
              set_simd_level(level);
              return summary;
            }},
           {"ours, started at the end",
            [&] {
              WindowProblem problem = smoothed;
              return smooth_window(&problem, used);
            }},
           {"covariances",
            [&] {
              std::vector<Matrix6d> covariances;
              WindowSummary summary{};
              summary.failed = !window_covariance(smoothed, used, pairs, &covariances);
              return summary;
            }}},
          repetitions);
}

}  // namespace

int main(int argc, char** argv) {
  const int repetitions = argc > 1 ? std::atoi(argv[1]) : 20;
  compare_window(15, 400, 0.85, repetitions);
  compare_window(20, 600, 0.85, repetitions);
  compare_window(15, 80, 0.85, repetitions);
}
