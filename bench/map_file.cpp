// Saving and loading a large map: 150 keyframes of 640x480 pixels with 10,000 points, each seen by 20 of them, and how
// long the map's lock is held for the copy that is saved. The images are rendered.
//
// Then what saving costs the tracker: a desk is mapped and tracked on at 30 frames a second, its map made as large by
// keyframes and points that are elsewhere, while another thread saves all of it over and over, and without.
#include "map/map_file.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include "camera/frame_source.h"
#include "map/shared_map.h"
#include "map/source_patch.h"
#include "mapper/mapper.h"
#include "render/synthetic_source.h"
#include "tracker/frame_features.h"
#include "tracker/tracker.h"

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

// Keyframes and points of `large`, far from all that the camera sees, until there are as many as in it.
void fill_up(const Map& large, Map* map) {
  const RigidTransform away(Eigen::Matrix3d::Identity(), {0, 0, -500});
  std::vector<KeyframeId> added;
  for (const Keyframe& kf : large.keyframes) {
    if (map->keyframes.size() >= kKeyframes) break;
    Keyframe one;
    one.frame = -1 - kf.frame;
    one.time = kf.time;
    one.camera_from_world = kf.camera_from_world * away;
    one.images = kf.images;
    added.push_back(map->keyframes.insert(std::move(one)));
  }
  for (const MapPoint& p : large.points) {
    if (map->points.size() >= kPoints) break;
    const auto source = static_cast<std::size_t>(p.source.index);
    if (source + kObservers > added.size()) continue;
    MapPoint one = p;
    one.position = away.inverse() * p.position;
    one.source = added[source];
    one.observers.clear();
    one.refined_everywhere = true;
    const PointId id = map->points.insert(one);
    for (std::size_t k = source; k < source + kObservers; ++k)
      if (const Measurement* m = large.keyframes.at({0, static_cast<std::int32_t>(k)}).find(p.id)) {
        Measurement measured = *m;
        measured.point = id;
        map->add_measurement(added[k], measured);
      }
  }
}

void track_while_saving(const std::string& source_name) {
  const std::unique_ptr<FrameSource> source = open_synthetic_source(source_name);
  const CameraModel camera = *source->calibration();
  SharedMap shared;
  MapperInbox inbox(32);
  Mapper mapper(camera, MapperOptions{}, &shared, &inbox);
  Tracker tracker(camera, TrackerOptions{}, true, &shared, &inbox);
  std::vector<Frame> frames;
  while (auto frame = source->next()) {
    tracker.track(*frame);
    while (mapper.step()) {
    }
    frames.push_back(std::move(*frame));
  }
  {
    const std::unique_ptr<FrameSource> again = open_synthetic_source(source_name);
    const Map large = large_map(again.get()).map;
    shared.write([&](Map& m) { fill_up(large, &m); });
    shared.publish();
  }
  const auto [keyframes, points] =
      shared.read([](const Map& m) { return std::pair(m.keyframes.size(), m.points.size()); });
  std::printf(
      "\nTracking at 30 frames a second on %d keyframes, %d points\n\n| | saves | frames tracked | median ms | 99 %% | "
      "worst |\n|---|---|---|---|---|---|\n",
      keyframes, points);
  const std::string path = (std::filesystem::temp_directory_path() / "parallax-bench-tracked.plxmap").string();
  Timestamp time = frames.back().time;
  int shown = 0;
  for (const bool saving : {false, true}) {
    std::atomic<int> saves = 0;
    std::jthread saver;
    if (saving)
      saver = std::jthread([&](std::stop_token stop) {
        while (!stop.stop_requested()) {
          std::filesystem::remove(path);
          MapDocument document;
          document.map = shared.copy().map;
          document.calibration = "bench";
          MapFile(path, "bench").save(document);
          ++saves;
        }
      });
    std::vector<double> ms;
    int tracked = 0;
    auto next = SteadyClock::now();
    // The mapped part to and fro, so that the camera never jumps.
    const int first = static_cast<int>(frames.size()) / 2, last = static_cast<int>(frames.size()) - 1;
    for (int i = 0; i < 900; ++i) {
      const int span = last - first, phase = shown++ % (2 * span);
      Frame frame = frames[static_cast<std::size_t>(last - (phase <= span ? phase : 2 * span - phase))];
      frame.index = static_cast<int>(frames.size()) + shown;
      frame.time = time += std::chrono::microseconds(33'333);
      std::this_thread::sleep_until(next += std::chrono::microseconds(33'333));
      const auto start = SteadyClock::now();
      tracked += tracker.track(frame).camera_from_world ? 1 : 0;
      ms.push_back(milliseconds_since(start));
      while (inbox.try_pop()) {
      }
    }
    saver = {};
    std::sort(ms.begin(), ms.end());
    std::printf("| %s | %d | %d of %zu | %.2f | %.2f | %.2f |\n", saving ? "saved all the time" : "not saved",
                saves.load(), tracked, ms.size(), ms[ms.size() / 2], ms[ms.size() * 99 / 100], ms.back());
  }
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace parallax

int main(int argc, char** argv) {
  const std::string source = argc > 1 ? argv[1] : "synthetic:desk";
  parallax::run(source);
  parallax::track_while_saving(source);
}
