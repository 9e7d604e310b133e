// Recovery without a prior: what one lost frame costs on maps of 1000 to 20,000 points. One core, milliseconds, the
// least of some runs.
//
//   bench_relocalisation [points...]
//
// Columns: describing all points (once), matching a frame's corners on each instruction set (describing the corners
// included), and the scan alone by one popcount after the other. Points are salient corners of synthetic:desk frames;
// the map is filled up by repeating them.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <random>

#include "core/cpu_dispatch.h"
#include "core/descriptor_search.h"
#include "render/synthetic_source.h"
#include "solver/absolute_pose.h"
#include "tracker/point_matcher.h"

using namespace parallax;

namespace {

// Processor time of this thread: other work on the machine does not count.
double now_ms() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

template <class F>
double least_ms(int runs, const F& f) {
  double least = 1e30;
  for (int i = 0; i < runs; ++i) {
    const double start = now_ms();
    f();
    least = std::min(least, now_ms() - start);
  }
  return least;
}

std::shared_ptr<const FrameImages> features_of(const GreyImage& grey) {
  auto images = std::make_shared<FrameImages>();
  build_pyramid(grey, &images->pyramid);
  for (int l = 0; l < kPyramidLevels; ++l) fast_corners(images->pyramid.level[l], 10, &images->corners[l]);
  return images;
}

// Only what the matcher reads.
TrackingSnapshot make_map(SyntheticSource* source, int points) {
  TrackingSnapshot map;
  for (int k = 0; map.size() < points; ++k) {
    SnapshotKeyframe kf;
    kf.id.index = k;
    kf.images = features_of(source->frame(3 * k % source->frame_count()).grey);
    map.keyframes.push_back(kf);
    for (int level = 0; level < kPyramidLevels; ++level) {
      const auto corners = maximal_corners(kf.images->pyramid.level[level], kf.images->corners[level]);
      const std::size_t step = std::max<std::size_t>(1, corners.size() / 120);
      for (std::size_t i = 0; i < corners.size() && map.size() < points; i += step) {
        map.id.push_back({0, map.size()});
        map.position.emplace_back(corners[i].x, corners[i].y, 100 * k + level);
        map.source.push_back(k);
        map.source_level.push_back(static_cast<std::uint8_t>(level));
        map.source_pixel.emplace_back(corners[i].x, corners[i].y);
      }
    }
  }
  return map;
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<int> sizes;
  for (int i = 1; i < argc; ++i) sizes.push_back(std::atoi(argv[i]));
  if (sizes.empty()) sizes = {1000, 5000, 10000, 20000};
  const auto source = open_synthetic_source("synthetic:desk");
  const auto frame = features_of(source->frame(77).grey);
  std::printf("%8s %10s", "points", "describe");
  const SimdLevel highest = supported_simd_level();
  for (int l = 0; l <= static_cast<int>(highest); ++l)
    if (l != static_cast<int>(SimdLevel::kSse2)) std::printf(" %12s", simd_level_name(static_cast<SimdLevel>(l)));
  std::printf(" %12s %8s\n", "one by one", "matches");
  for (int points : sizes) {
    const TrackingSnapshot map = make_map(source.get(), points);
    PointMatcher matcher;
    std::printf("%8d %10.2f", points, least_ms(1, [&] { matcher.prepare(map, 1 << 20); }));
    std::size_t matches = 0;
    for (int l = 0; l <= static_cast<int>(highest); ++l) {
      if (l == static_cast<int>(SimdLevel::kSse2)) continue;
      set_simd_level(static_cast<SimdLevel>(l));
      std::printf(" %12.2f", least_ms(7, [&] { matches = matcher.match(map, *frame).size(); }));
    }
    set_simd_level(highest);
    std::mt19937_64 random(1);
    std::vector<BinaryDescriptor> descriptors(static_cast<std::size_t>(points));
    for (auto& d : descriptors)
      for (auto& w : d.bits) w = random();
    volatile int sink = 0;
    std::printf(" %12.2f %8zu\n",
                least_ms(3,
                         [&] {
                           int sum = 0;
                           for (std::size_t c = 0; c < 980; ++c) {
                             int least = 257;
                             for (const auto& d : descriptors)
                               least = std::min(least, hamming(descriptors[c % descriptors.size()], d));
                             sum += least;
                           }
                           sink = sum;
                         }),
                matches);
  }

  std::printf("\nthree-point problem: ");
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(-0.6, 0.6);
  std::array<RigidTransform, 4> poses;
  std::vector<std::array<Eigen::Vector3d, 3>> triples(1000);
  for (auto& t : triples)
    for (auto& p : t) p = Eigen::Vector3d(uniform(random), uniform(random), 1) * (1 + uniform(random));
  int found = 0;
  const double ms = least_ms(7, [&] {
    for (const auto& t : triples) found += solve_three_points(t, t, &poses);
  });
  std::printf("%.2f us (%d solutions)\n", ms, found / 7);
}
