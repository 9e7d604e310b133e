// The renderer off-screen, as a headless run uses it: milliseconds for a frame of 640x480 with the camera's image, read
// back, for scenes of 100 to 100,000 triangles, with and without several samples a pixel, and for what a tracked frame
// shows (a grid and a thousand points).
#include <benchmark/benchmark.h>

#include <cmath>

#include "render/gl_context.h"
#include "render/mesh_shapes.h"
#include "render/scene_renderer.h"

using namespace parallax;

namespace {

constexpr int kWidth = 640, kHeight = 480;

DrawList scene() {
  DrawList list;
  list.camera = CameraModel(CameraModelKind::fov, kWidth, kHeight, {375, 376}, {322.3, 237.1}, {0.9}, 1);
  list.background = cv::Mat3b(kHeight, kWidth, cv::Vec3b(120, 130, 140));
  const Eigen::Matrix3d down = Eigen::AngleAxisd(M_PI * 0.75, Eigen::Vector3d::UnitX()).toRotationMatrix();
  list.camera_from_world = RigidTransform(down, {0, 0, 0.5});
  list.shadow_plane = RigidTransform();
  return list;
}

void run(benchmark::State& state, const DrawList& list, int samples) {
  OffscreenContext context(kWidth, kHeight);
  SceneRenderer renderer({samples});
  renderer.draw(list, {0, 0, kWidth, kHeight});  // compiles the shaders
  for (auto _ : state) {
    renderer.draw(list, {0, 0, kWidth, kHeight});
    benchmark::DoNotOptimize(read_framebuffer(kWidth, kHeight));
  }
}

void triangles(benchmark::State& state) {
  DrawList list = scene();
  const int wanted = static_cast<int>(state.range(0)), things = wanted < 1000 ? 1 : 10;
  const int segments = static_cast<int>(std::lround(std::sqrt(wanted / static_cast<double>(things))));
  const auto ball = sphere_mesh(0.04f, segments);
  for (int i = 0; i < things; ++i) {
    MeshInstance instance;
    instance.mesh = ball;
    instance.world_from_model.translation() =
        Eigen::Vector3f(0.09f * static_cast<float>(i % 5 - 2), 0.1f * static_cast<float>(i / 5), 0.04f);
    list.meshes.push_back(instance);
  }
  state.counters["triangles"] = static_cast<double>(things) * static_cast<double>(ball->indices.size() / 3);
  run(state, list, static_cast<int>(state.range(1)));
}

void tracked_frame(benchmark::State& state) {
  DrawList list = scene();
  list.grids.emplace_back().colour = {0.2f, 1, 0.3f, 0.8f};
  for (int i = 0; i < 1000; ++i)
    list.screen_points.push_back(
        {{static_cast<float>(i * 37 % kWidth), static_cast<float>(i * 91 % kHeight)}, {1, 0.4f, 0.2f, 1}, 5, false});
  run(state, list, 4);
}

}  // namespace

BENCHMARK(triangles)
    ->ArgsProduct({{100, 5'000, 100'000}, {1, 4}})
    ->ArgNames({"wanted", "samples"})
    ->Unit(benchmark::kMillisecond);
BENCHMARK(tracked_frame)->Unit(benchmark::kMillisecond);
BENCHMARK_MAIN();
