// Pose refinement (PTAM §5.4): ten iterations, by number of observations and lens.
#include "solver/pose_refinement.h"

#include <benchmark/benchmark.h>

#include <random>

namespace {

using namespace parallax;

void refine(benchmark::State& state, const CameraModel& camera) {
  std::mt19937 random(1);
  std::normal_distribution<double> gauss;
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<PoseObservation> observations;
  while (static_cast<int>(observations.size()) < state.range(0)) {
    PoseObservation o;
    o.point = {uniform(random), uniform(random), 1.5 + uniform(random) / 2};
    if (!camera.project(o.point, &o.pixel) || !camera.in_image(o.pixel)) continue;
    const double x = gauss(random), y = gauss(random);
    o.pixel += Eigen::Vector2d(x, y);
    if (observations.size() % 10 == 0) o.pixel.x() += 30;
    observations.push_back(o);
  }
  Vector6d error;
  error << 0.01, -0.01, 0.005, 0.004, -0.003, 0.006;
  const RigidTransform start = RigidTransform::exp(error);
  for (auto _ : state) {
    RigidTransform pose = start;
    benchmark::DoNotOptimize(refine_pose(camera, observations, {}, &pose));
  }
}

void pinhole(benchmark::State& state) {
  refine(state, CameraModel(CameraModelKind::pinhole, 640, 480, {500, 500}, {320, 240}));
}
void fov(benchmark::State& state) {
  refine(state, CameraModel(CameraModelKind::fov, 640, 480, {400, 400}, {320, 240}, {0.9}, 1));
}
BENCHMARK(pinhole)->Arg(50)->Arg(1000)->Unit(benchmark::kMicrosecond);
BENCHMARK(fov)->Arg(50)->Arg(1000)->Unit(benchmark::kMicrosecond);

}  // namespace

BENCHMARK_MAIN();
