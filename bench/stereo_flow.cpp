// Which KLT the stereo odometry should use (MS section 3.1): ours, forward and back and then refined by the 15x15
// windows, beside OpenCV's pyramidal one forward and back. Corners of synthetic:building are followed from a frame to
// the next and to the fourth after it, each from where it was; the truth comes from the depth and the poses.
//
//   bench_stereo_flow [PAIRS [SEED]]
//
// Tracked: part of the corners that are seen in both frames. Wrong: of those tracked, more than a pixel from the truth.
// Errors in pixels. Time a corner is on one thread, of the tracking both ways; pyramids (and smoothed images) are built
// beforehand and told apart, as both frames share them with their neighbours.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#ifdef PARALLAX_BENCH_OPENCV_FLOW
#include <opencv2/video/tracking.hpp>
#endif

#include "render/synthetic_stereo_source.h"
#include "tracker/affine_alignment.h"
#include "tracker/stereo_corners.h"
#include "tracker/stereo_flow.h"

using namespace parallax;

namespace {

using Clock = std::chrono::steady_clock;

double microseconds_since(Clock::time_point begin) {
  return std::chrono::duration<double, std::micro>(Clock::now() - begin).count();
}

// Corners that both frames see, and where they went.
struct Pair {
  GreyImage last, next;
  std::vector<Eigen::Vector2d> from, truth;
};

Pair make_pair_of(SyntheticStereoSource* source, int first, int second) {
  const CameraModel lens = source->calibration()->left;
  Pair pair{source->frame(first).left.grey, source->frame(second).left.grey, {}, {}};
  const cv::Mat1f depth = source->depth(first), there = source->depth(second);
  const RigidTransform second_from_first =
      source->world_from_camera(second).inverse() * source->world_from_camera(first);
  for (const Eigen::Vector2d& corner : find_stereo_corners(pair.last, {}, {})) {
    const float z = depth(static_cast<int>(corner.y()), static_cast<int>(corner.x()));
    Eigen::Vector3d ray;
    Eigen::Vector2d truth;
    if (!(z > 0) || !lens.unproject(corner, &ray)) continue;
    const Eigen::Vector3d point = second_from_first * Eigen::Vector3d(ray * (z / ray.z()));
    if (!(point.z() > 0.1) || !lens.project(point, &truth)) continue;
    if (!(truth.minCoeff() > 12 && truth.x() < there.cols - 13 && truth.y() < there.rows - 13)) continue;
    const float seen = there(static_cast<int>(std::lround(truth.y())), static_cast<int>(std::lround(truth.x())));
    if (std::abs(seen - point.z()) > 0.03 * point.z()) continue;  // hidden there
    pair.from.push_back(corner);
    pair.truth.push_back(truth);
  }
  return pair;
}

struct Tally {
  std::vector<double> errors;
  int asked = 0, wrong = 0, pairs = 0;
  double tracking_us = 0, preparing_us = 0;

  void add(const Eigen::Vector2d& found, const Eigen::Vector2d& truth) {
    errors.push_back((found - truth).norm());
    wrong += static_cast<int>(errors.back() > 1);
  }
  void print(const char* name) {
    if (errors.empty()) return;
    std::sort(errors.begin(), errors.end());
    const auto n = static_cast<double>(errors.size());
    std::printf("  %-34s %8.1f %8.2f %9.3f %9.3f %9.1f %9.2f\n", name, 100 * n / asked, 100 * wrong / n,
                errors[errors.size() / 2], errors[errors.size() * 9 / 10], tracking_us / asked,
                preparing_us / pairs / 1e3);
  }
};

// `refined`: on to the odometry's windows.
void ours(const Pair& pair, bool refined, Tally* tally) {
  auto begin = Clock::now();
  ImagePyramid last, next;
  build_pyramid(pair.last, &last);
  build_pyramid(pair.next, &next);
  cv::Mat1f last_smooth, next_smooth;
  if (refined) {
    last_smooth = smooth_for_alignment(pair.last);
    next_smooth = smooth_for_alignment(pair.next);
  }
  tally->preparing_us += microseconds_since(begin) / 2;
  // A window is taken once, when its track begins.
  std::vector<AffineTemplate> windows(refined ? pair.from.size() : 0);
  std::vector<std::uint8_t> usable(windows.size());
  for (std::size_t i = 0; i < windows.size(); ++i) usable[i] = windows[i].prepare(last_smooth, pair.from[i]);
  std::vector<std::optional<Eigen::Vector2d>> found(pair.from.size());
  begin = Clock::now();
  for (std::size_t i = 0; i < pair.from.size(); ++i) {
    found[i] = track_forward_backward(last, next, pair.from[i], pair.from[i], {});
    if (!refined || !found[i]) continue;
    const auto aligned = usable[i] ? windows[i].align(next_smooth, *found[i], Eigen::Matrix2d::Identity(), true, 10)
                                   : AffineTemplate::Result();
    if (!aligned.converged || aligned.correlation < 0.8 || (aligned.position - *found[i]).norm() > 4)
      found[i].reset();
    else
      found[i] = aligned.position;
  }
  tally->tracking_us += microseconds_since(begin);
  for (std::size_t i = 0; i < found.size(); ++i)
    if (found[i]) tally->add(*found[i], pair.truth[i]);
}

#ifdef PARALLAX_BENCH_OPENCV_FLOW
void opencv(const Pair& pair, int window, Tally* tally) {
  const cv::Size size(window, window);
  auto begin = Clock::now();
  std::vector<cv::Mat> last, next;
  cv::buildOpticalFlowPyramid(pair.last, last, size, 3);
  cv::buildOpticalFlowPyramid(pair.next, next, size, 3);
  tally->preparing_us += microseconds_since(begin) / 2;
  std::vector<cv::Point2f> from, there, back;
  for (const Eigen::Vector2d& p : pair.from) from.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
  std::vector<std::uint8_t> found, returned;
  std::vector<float> unused;
  begin = Clock::now();
  cv::calcOpticalFlowPyrLK(last, next, from, there, found, unused, size, 3);
  back = from;
  cv::calcOpticalFlowPyrLK(next, last, there, back, returned, unused, size, 1, cv::TermCriteria(3, 30, 0.01),
                           cv::OPTFLOW_USE_INITIAL_FLOW);
  tally->tracking_us += microseconds_since(begin);
  for (std::size_t i = 0; i < from.size(); ++i)
    if (found[i] && returned[i] && cv::norm(back[i] - from[i]) <= FlowOptions().max_round_trip_px)
      tally->add({there[i].x, there[i].y}, pair.truth[i]);
}
#endif

}  // namespace

int main(int argc, char** argv) {
  const int pairs = argc > 1 ? std::atoi(argv[1]) : 40;
  const std::string seed = argc > 2 ? argv[2] : "1";
  cv::setNumThreads(1);
  const auto source = open_synthetic_stereo_source("synthetic:building?seed=" + seed);
  struct Method {
    const char* name;
    std::function<void(const Pair&, Tally*)> run;
  };
  std::vector<Method> methods = {
      {"ours, 8x8 forward and back", [](const Pair& p, Tally* t) { ours(p, false, t); }},
      {"ours, and refined in 15x15 windows", [](const Pair& p, Tally* t) { ours(p, true, t); }}};
#ifdef PARALLAX_BENCH_OPENCV_FLOW
  methods.push_back({"OpenCV, 9x9 forward and back", [](const Pair& p, Tally* t) { opencv(p, 9, t); }});
  methods.push_back({"OpenCV, 15x15 forward and back", [](const Pair& p, Tally* t) { opencv(p, 15, t); }});
  methods.push_back({"OpenCV, 21x21 forward and back", [](const Pair& p, Tally* t) { opencv(p, 21, t); }});
#else
  std::printf("OpenCV's video module is absent: ours alone\n");
#endif
  for (const int step : {1, 4}) {
    std::vector<Tally> tallies(methods.size());
    int corners = 0;
    double motion_px = 0;
    for (int k = 0; k < pairs; ++k) {
      const int first = 60 + (k * 7919) % (source->frame_count() - 100);
      const Pair pair = make_pair_of(source.get(), first, first + step);
      corners += static_cast<int>(pair.from.size());
      for (std::size_t i = 0; i < pair.from.size(); ++i) motion_px += (pair.truth[i] - pair.from[i]).norm();
      for (std::size_t m = 0; m < methods.size(); ++m) {
        tallies[m].asked += static_cast<int>(pair.from.size());
        ++tallies[m].pairs;
        methods[m].run(pair, &tallies[m]);
      }
    }
    std::printf("%d frame%s on: %d pairs, %d corners, mean motion %.1f px\n", step, step > 1 ? "s" : "", pairs, corners,
                motion_px / std::max(1, corners));
    std::printf("  %-34s %8s %8s %9s %9s %9s %9s\n", "", "tracked%", "wrong%", "median px", "90 % px", "us each",
                "image ms");
    for (std::size_t m = 0; m < methods.size(); ++m) tallies[m].print(methods[m].name);
  }
  return 0;
}
