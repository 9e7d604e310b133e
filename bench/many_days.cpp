// One desk for many days: every morning a third of the things on it have been moved, the light is another and the
// camera goes another way. Each day begins with the map file of the day before.
//
//   bench_many_days [days=100 [frames a day=300 [seed=1 [FILE=many_days.plxmap]]]]
//
// A row a day: what part of the frames was tracked and at which frame the map was recognised; error of the camera's
// path, aligned; how far what was placed on the table on day 0, at the map's origin of the plane, is from where it was
// put, by the day's own truth; and the size of the map. It ends with 1 when a day is not recognised.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "camera/calibration_file.h"
#include "map/map_file.h"
#include "map/shared_map.h"
#include "mapper/map_maintenance.h"
#include "mapper/mapper.h"
#include "render/synthetic_source.h"
#include "tracker/tracker.h"

using namespace parallax;

namespace {

struct Day {
  int tracked = 0, recognised = -1;
  double path_mm = 0, slowest_ms = 0;
  SimilarityTransform truth_from_map;
  Map map;
};

Day live_through(SyntheticSource* source, const Map* known) {
  Day out;
  const CameraModel camera = *source->calibration();
  SharedMap map;
  if (known) {
    Map before = *known;
    age_counts(&before);
    map.replace_map(std::move(before));
    map.publish();
  }
  MapperInbox inbox(32);
  Mapper mapper(camera, MapperOptions{}, &map, &inbox);
  Tracker tracker(camera, TrackerOptions{}, true, &map, &inbox);
  std::vector<TrackingResult> results;
  while (const auto frame = source->next()) {
    const auto start = SteadyClock::now();
    results.push_back(tracker.track(*frame));
    out.slowest_ms = std::max(out.slowest_ms, milliseconds_since(start));
    while (mapper.step()) {
    }
  }
  const MapCopy end = map.copy();
  std::vector<Eigen::Vector3d> from, to;
  for (const TrackingResult& r : results) {
    if (!r.camera_from_world || r.map_version != end.map_version) continue;
    if (out.recognised < 0) out.recognised = r.frame;
    ++out.tracked;
    from.push_back((end.world_from_first * r.world_from_first.inverse()).rebase(*r.camera_from_world).inverse().t);
    to.push_back(source->world_from_camera(r.frame).t);
  }
  if (from.size() >= 10) {
    const auto matrix = [](const std::vector<Eigen::Vector3d>& v) {
      return Eigen::Matrix3Xd(
          Eigen::Map<const Eigen::Matrix3Xd>(v.front().data(), 3, static_cast<Eigen::Index>(v.size())));
    };
    const Eigen::Matrix3Xd a = matrix(from), b = matrix(to);
    align_points(a, b, true, &out.truth_from_map);
    double sum = 0;
    for (Eigen::Index i = 0; i < a.cols(); ++i)
      sum += (out.truth_from_map * Eigen::Vector3d(a.col(i)) - b.col(i)).squaredNorm();
    out.path_mm = 1e3 * std::sqrt(sum / static_cast<double>(a.cols()));
  }
  out.map = end.map;
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  const int days = argc > 1 ? std::atoi(argv[1]) : 100;
  const std::string frames = argc > 2 ? argv[2] : "300", seed = argc > 3 ? argv[3] : "1";
  const std::string path = argc > 4 ? argv[4] : "many_days.plxmap";
  constexpr const char* kLight[] = {"1", "0.6", "0.85", "1.2", "0.7"};
  MapDocument document;
  Eigen::Vector3d placed = Eigen::Vector3d::Zero(), placed_in_truth = placed;
  bool all_found = true;
  std::filesystem::remove(path);  // the size of a file that was there would be shown
  std::printf(
      "| day | light | tracked | recognised at frame | path mm | what was placed, mm | keyframes | points | kB |\n"
      "|---|---|---|---|---|---|---|---|---|\n");
  for (int day = 0; day <= days; ++day) {
    const std::string name = "synthetic:desk?seed=" + seed + "&frames=" + frames + "&day=" + std::to_string(day) +
                             "&walk=" + std::to_string(day + 1) + "&light=" + kLight[day % 5];
    const auto source = open_synthetic_source(name);
    Day d = live_through(source.get(), day > 0 ? &document.map : nullptr);
    if (d.recognised < 0) {
      all_found = false;
      std::printf("| %d | %s | 0 | never | | | | | |\n", day, kLight[day % 5]);
      if (day == 0) return 1;
      continue;
    }
    if (day == 0 && d.map.plane) {
      placed = d.map.plane->world_from_plane.t;
      placed_in_truth = d.truth_from_map * placed;
    }
    document.map = std::move(d.map);
    document.calibration = format_calibration(*source->calibration());
    // Through the file, as from one day to the next.
    {
      MapFile file(path, "many days");
      file.save(document);
    }
    document = read_map_file(path);
    std::printf("| %d | %s | %.3f | %d | %.3f | %.2f | %d | %d | %.0f |\n", day, kLight[day % 5],
                d.tracked / static_cast<double>(source->frame_count()), d.recognised, d.path_mm,
                1e3 * (d.truth_from_map * placed - placed_in_truth).norm(),
                static_cast<int>(document.map.keyframes.size()), static_cast<int>(document.map.points.size()),
                static_cast<double>(std::filesystem::file_size(path)) / 1024);
    std::fflush(stdout);
  }
  return all_found ? 0 : 1;
}
