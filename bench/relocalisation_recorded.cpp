// Relocalisation on real recordings (bench/recorded_recall.h).
//
//   bench_relocalisation_recorded PROBES FOLDER:FRAMES_OF_THE_MAP[:KEY,KEY]...
//
// With KEY,KEY the map begins with these frames, else with frames chosen automatically.
#include <cstdlib>

#include "bench/recorded_recall.h"

using namespace parallax;

namespace {

void print_row(const std::string& folder, int mapped, const std::optional<recorded_recall::Recall>& recall) {
  if (!recall) {
    std::printf("| %s | no map | | | | | | | |\n", folder.c_str());
    return;
  }
  const recorded_recall::Recall& r = *recall;
  const double n = std::max(1, r.sharing);
  std::printf(
      "| %s, first %d frames (%zu keyframes, off by %.0f mm at most) | %d | %d | %.3f | %.3f | %d | %d | %.1f | %.1f "
      "|\n",
      folder.substr(folder.find_last_of('/') + 1).c_str(), mapped, r.keyframes, 1e3 * r.map_error_m, r.probes,
      r.sharing, r.close / n, r.near / n, r.others_found, r.wrong, r.ms.empty() ? 0 : r.ms[r.ms.size() / 2],
      r.ms.empty() ? 0 : r.ms[r.ms.size() * 99 / 100]);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "bench_relocalisation_recorded PROBES FOLDER:FRAMES_OF_THE_MAP[:KEY,KEY]...\n");
    return 2;
  }
  std::printf(
      "| recording | probes | sharing a third | recall 10 cm, 1 deg | recall 25 cm, 2 deg | others found, right | "
      "wrong "
      "accepts | ms a try, median | p99 |\n|---|---|---|---|---|---|---|---|---|\n");
  for (int i = 2; i < argc; ++i) {
    char folder[1000];
    int mapped = 0, first = 0, second = 0;
    const int read = std::sscanf(argv[i], "%999[^:]:%d:%d,%d", folder, &mapped, &first, &second);
    if (read != 2 && read != 4) {
      std::fprintf(stderr, "found %s, expected FOLDER:FRAMES_OF_THE_MAP[:KEY,KEY]\n", argv[i]);
      return 2;
    }
    std::optional<std::pair<int, int>> keys;
    if (read == 4) keys.emplace(first, second);
    print_row(folder, mapped, recorded_recall::measure(folder, mapped, keys, std::atoi(argv[1])));
  }
}
