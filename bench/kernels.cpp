// The image kernels at every instruction set, beside OpenCV's where it has one. The image is the first of the desk
// recording when the data are there, else noise.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#if __has_include(<opencv2/features2d.hpp>) && defined(PARALLAX_BENCH_OPENCV_FAST)
#include <opencv2/features2d.hpp>
#endif

#include "core/cpu_dispatch.h"
#include "core/fast.h"
#include "core/image.h"
#include "core/patch.h"

#ifndef PARALLAX_DATA_DIR
#define PARALLAX_DATA_DIR ""
#endif

namespace {

using namespace parallax;

GreyImage load_image() {
  const std::filesystem::path folder = std::filesystem::path(PARALLAX_DATA_DIR) / "desk" / "rgb";
  std::filesystem::path first;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    if (first.empty() || entry.path() < first) first = entry.path();
  }
  GreyImage image;
  if (!first.empty()) image = cv::imread(first.string(), cv::IMREAD_GRAYSCALE);
  if (image.empty()) {
    image.create(480, 640);
    cv::randu(image, 0, 255);
    cv::GaussianBlur(image, image, cv::Size(0, 0), 1.0);
  }
  return image;
}

const ImagePyramid& pyramid() {
  static const ImagePyramid p = [] {
    ImagePyramid built;
    build_pyramid(load_image(), &built);
    return built;
  }();
  return p;
}

const CornerList& corners() {
  static const CornerList list = [] {
    CornerList found;
    fast_corners(pyramid().level[0], 10, &found);
    return found;
  }();
  return list;
}

// Places where a patch search may start: corners well inside the image.
const std::vector<Eigen::Vector2d>& places() {
  static const std::vector<Eigen::Vector2d> chosen = [] {
    std::vector<Eigen::Vector2d> all;
    for (const Corner& c : corners().corners) {
      if (c.x > 20 && c.y > 20 && c.x < pyramid().width() - 20 && c.y < pyramid().height() - 20)
        all.emplace_back(c.x, c.y);
    }
    if (all.empty()) all.emplace_back(pyramid().width() / 2, pyramid().height() / 2);
    std::shuffle(all.begin(), all.end(), std::mt19937(1));
    all.resize(std::min<std::size_t>(all.size(), 1000));
    return all;
  }();
  return chosen;
}

// Chooses the instruction set of the argument; false when this machine lacks it.
bool use_level(benchmark::State& state) {
  const auto wanted = static_cast<SimdLevel>(state.range(0));
  state.SetLabel(simd_level_name(wanted));
  if (set_simd_level(wanted) == wanted) return true;
  state.SkipWithError("not on this machine");
  return false;
}

void BM_Pyramid(benchmark::State& state) {
  if (!use_level(state)) return;
  ImagePyramid built;
  for (auto _ : state) {
    build_pyramid(pyramid().level[0], &built);
    benchmark::DoNotOptimize(built.level[3].data);
  }
}

void BM_PyramidOpenCvResize(benchmark::State& state) {
  ImagePyramid built;
  built.level[0] = pyramid().level[0];
  for (auto _ : state) {
    for (std::size_t l = 1; l < kPyramidLevels; ++l) {
      const GreyImage& from = built.level[l - 1];
      cv::resize(from, built.level[l], cv::Size(from.cols / 2, from.rows / 2), 0, 0, cv::INTER_AREA);
    }
    benchmark::DoNotOptimize(built.level[3].data);
  }
}

void BM_FastFourLevels(benchmark::State& state) {
  if (!use_level(state)) return;
  CornerList list;
  std::size_t found = 0;
  for (auto _ : state) {
    found = 0;
    for (const GreyImage& image : pyramid().level) {
      fast_corners(image, 10, &list);
      found += list.corners.size();
    }
  }
  state.counters["corners"] = static_cast<double>(found);
}

#ifdef PARALLAX_BENCH_OPENCV_FAST
void BM_FastFourLevelsOpenCv9of16(benchmark::State& state) {
  std::vector<cv::KeyPoint> found;
  for (auto _ : state) {
    for (const GreyImage& image : pyramid().level) cv::FAST(image, found, 10, false);
  }
}
BENCHMARK(BM_FastFourLevelsOpenCv9of16)->Unit(benchmark::kMicrosecond);
#endif

void BM_MaximalCorners(benchmark::State& state) {
  if (!use_level(state)) return;
  for (auto _ : state) benchmark::DoNotOptimize(maximal_corners(pyramid().level[0], corners()).size());
  state.counters["corners"] = static_cast<double>(corners().corners.size());
}

void BM_ShiTomasi(benchmark::State& state) {
  if (!use_level(state)) return;
  std::size_t k = 0;
  for (auto _ : state) {
    const Eigen::Vector2d& p = places()[k++ % places().size()];
    benchmark::DoNotOptimize(shi_tomasi_score(pyramid().level[0], static_cast<int>(p.x()), static_cast<int>(p.y())));
  }
}

void warp_with(benchmark::State& state, const Eigen::Matrix2d& warp) {
  if (!use_level(state)) return;
  PatchTemplate t;
  std::size_t k = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(warp_patch(pyramid().level[0], places()[k++ % places().size()], warp, &t));
    benchmark::ClobberMemory();
  }
}
const Eigen::Matrix2d kAffine = (Eigen::Matrix2d() << 1.1, 0.2, -0.15, 0.9).finished();

void BM_WarpPatch(benchmark::State& state) { warp_with(state, kAffine); }
void BM_WarpPatchShift(benchmark::State& state) { warp_with(state, Eigen::Matrix2d::Identity()); }

void BM_WarpAlignmentTemplate(benchmark::State& state) {
  if (!use_level(state)) return;
  AlignmentTemplate t;
  std::size_t k = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(warp_alignment_template(pyramid().level[0], places()[k++ % places().size()], kAffine, &t));
    benchmark::ClobberMemory();
  }
}

void BM_Zmssd(benchmark::State& state) {
  if (!use_level(state)) return;
  PatchTemplate t;
  copy_patch(pyramid().level[0], 100, 100, &t);
  std::size_t k = 0;
  for (auto _ : state) {
    const Eigen::Vector2d& p = places()[k++ % places().size()];
    benchmark::DoNotOptimize(zmssd(t, pyramid().level[0], static_cast<int>(p.x()), static_cast<int>(p.y())));
  }
}

// The tracker's inner loop; the second argument is the radius in pixels.
void BM_BestZmssd(benchmark::State& state) {
  if (!use_level(state)) return;
  std::vector<PatchTemplate> templates(places().size());
  for (std::size_t k = 0; k < templates.size(); ++k) {
    copy_patch(pyramid().level[0], static_cast<int>(places()[k].x()), static_cast<int>(places()[k].y()), &templates[k]);
  }
  std::size_t k = 0;
  int x = 0, y = 0;
  for (auto _ : state) {
    const std::size_t i = k++ % templates.size();
    benchmark::DoNotOptimize(best_zmssd(templates[i], pyramid().level[0], corners(), places()[i].x() + 1.5,
                                        places()[i].y() - 1.25, static_cast<double>(state.range(1)), 20000, &x, &y));
  }
  // How many corners a search evaluates on average.
  double inside = 0;
  for (const Eigen::Vector2d& p : places()) {
    for (const Corner& c : corners().corners) {
      inside += std::hypot(c.x - p.x() - 1.5, c.y - p.y() + 1.25) <= static_cast<double>(state.range(1));
    }
  }
  state.counters["corners"] = inside / static_cast<double>(places().size());
}

void BM_AlignPatch(benchmark::State& state) {
  if (!use_level(state)) return;
  std::vector<AlignmentTemplate> templates(places().size());
  for (std::size_t k = 0; k < templates.size(); ++k) {
    warp_alignment_template(pyramid().level[0], places()[k], Eigen::Matrix2d::Identity(), &templates[k]);
  }
  std::size_t k = 0;
  std::int64_t iterations = 0;
  for (auto _ : state) {
    const std::size_t i = k++ % templates.size();
    const Eigen::Vector2d start = places()[i] + Eigen::Vector2d(0.6, -0.4);
    iterations += align_patch(templates[i], pyramid().level[0], start).iterations;
  }
  state.counters["steps"] = static_cast<double>(iterations) / static_cast<double>(state.iterations());
}

BENCHMARK(BM_Pyramid)->DenseRange(0, 3)->Unit(benchmark::kMicrosecond);
BENCHMARK(BM_PyramidOpenCvResize)->Unit(benchmark::kMicrosecond);
BENCHMARK(BM_FastFourLevels)->DenseRange(0, 3)->Unit(benchmark::kMicrosecond);
BENCHMARK(BM_MaximalCorners)->DenseRange(0, 1)->Unit(benchmark::kMicrosecond);
BENCHMARK(BM_ShiTomasi)->DenseRange(0, 1);
BENCHMARK(BM_WarpPatch)->DenseRange(0, 3);
BENCHMARK(BM_WarpPatchShift)->DenseRange(0, 3);
BENCHMARK(BM_WarpAlignmentTemplate)->DenseRange(0, 3);
BENCHMARK(BM_Zmssd)->DenseRange(0, 3);
BENCHMARK(BM_BestZmssd)->ArgsProduct({{0, 1, 2, 3}, {10, 30}});
BENCHMARK(BM_AlignPatch)->DenseRange(0, 3);

}  // namespace

BENCHMARK_MAIN();
