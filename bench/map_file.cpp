// Saving and loading a large map: 150 keyframes of 640x480 pixels with 10,000 points, each seen by 20 of them, and how
// long the map's lock is held for the copy that is saved. The images are rendered.
#include "map/map_file.h"

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <random>

#include "camera/frame_source.h"
#include "map/shared_map.h"
#include "map/source_patch.h"
#include "render/synthetic_source.h"
#include "tracker/frame_features.h"

namespace parallax {
namespace {

constexpr int kKeyframes = 150, kPoints = 10'000, kObservers = 20;

double seconds_of(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

MapDocument large_map(FrameSource* source) {
  MapDocument out;
  const CameraModel camera = *source->calibration();
  FrameFeatures features(camera.width(), camera.height(), TrackerOptions{});
  std::vector<KeyframeId> keyframes;
  for (int i = 0; i < kKeyframes; ++i) {
    const auto frame = source->next();
    if (!frame) break;
    Keyframe kf;
    kf.frame = frame->index;
    kf.time = frame->time;
    kf.camera_from_world = RigidTransform(Eigen::Matrix3d::Identity(), Eigen::Vector3d(-0.001 * i, 0, 0));
    kf.images = features.compute(frame->grey);
    features.give_away(kf.images);
    keyframes.push_back(out.map.keyframes.insert(std::move(kf)));
  }
  std::mt19937_64 rng(1);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int k = 0; k < kPoints; ++k) {
    MapPoint p;
    p.position = Eigen::Vector3d(0.3 * unit(rng), 0.2 * unit(rng), 1 + 0.05 * unit(rng));
    p.normal = -Eigen::Vector3d::UnitZ();
    const std::size_t first = rng() % (keyframes.size() - kObservers);
    Eigen::Vector2d pixel;
    camera.project(out.map.keyframes.at(keyframes[first]).camera_from_world * p.position, &pixel);
    if (!set_source(&p, keyframes[first], 0, pixel, camera)) continue;
    const PointId id = out.map.points.insert(p);
    for (std::size_t i = first; i < first + kObservers; ++i) {
      camera.project(out.map.keyframes.at(keyframes[i]).camera_from_world * p.position, &pixel);
      out.map.add_measurement(keyframes[i], {id, pixel, 1.0F, 0, MeasurementSource::tracker});
    }
  }
  out.calibration = "bench";
  return out;
}

void run(const std::string& source_name) {
  const std::unique_ptr<FrameSource> source = open_synthetic_source(source_name);
  const MapDocument document = large_map(source.get());
  const std::string path = (std::filesystem::temp_directory_path() / "parallax-bench.plxmap").string();
  std::filesystem::remove(path);
  SharedMap shared;
  shared.replace_map(document.map);
  std::printf("%d keyframes, %d points\n\n| step | seconds |\n|---|---|\n", document.map.keyframes.size(),
              document.map.points.size());
  for (int i = 0; i < 3; ++i) std::printf("| copy under the lock | %.4f |\n", seconds_of([&] { shared.copy(); }));
  {
    MapFile file(path, "bench");
    std::printf("| first save | %.3f |\n", seconds_of([&] { file.save(document); }));
    for (int i = 0; i < 3; ++i) std::printf("| later save | %.3f |\n", seconds_of([&] { file.save(document); }));
  }
  for (int i = 0; i < 3; ++i) std::printf("| load | %.3f |\n", seconds_of([&] { read_map_file(path); }));
  std::printf("| verify | %.3f |\n", seconds_of([&] { verify_map_file(path); }));
  std::printf("\n%.1f MB\n", static_cast<double>(std::filesystem::file_size(path)) * 1e-6);
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace parallax

int main(int argc, char** argv) { parallax::run(argc > 1 ? argv[1] : "synthetic:desk"); }
