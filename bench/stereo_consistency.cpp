// Is the covariance that stereo odometry reports the size of its errors? Runs of synthetic:building, each another
// stretch of another building, against truth: the normalised estimation error squared (NEES) of the motion between two
// neighbouring keyframes, as odometry has it and as the window's constraint has it, and its mean beside the 95 percent
// bounds of a chi-squared variable of 6 degrees of freedom a run.
//
//   bench_stereo_consistency [RUNS [SEED]]
#include <Eigen/Cholesky>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "mapper/stereo_window.h"
#include "render/synthetic_stereo_source.h"
#include "solver/chi_square.h"
#include "tracker/stereo_odometry.h"

using namespace parallax;

namespace {

constexpr int kMostFrames = 40;
constexpr int kWindowPoses = 6;

struct Errors {
  std::vector<double> nees, translation_m, rotation_deg;
  Vector6d mean = Vector6d::Zero();

  void add(const RigidTransform& estimate, const RigidTransform& truth, const Matrix6d& covariance) {
    const Vector6d error = (estimate * truth.inverse()).log();
    nees.push_back(error.dot(covariance.ldlt().solve(error)));
    translation_m.push_back(error.head<3>().norm());
    rotation_deg.push_back(error.tail<3>().norm() * 180 / M_PI);
    mean += error;
  }
};

double mean_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return values.empty() ? 0 : sum / static_cast<double>(values.size());
}

void print(const char* name, const Errors& errors) {
  const auto n = static_cast<double>(errors.nees.size());
  if (n == 0) return;
  const double mean = mean_of(errors.nees);
  const ChiSquareBounds bounds = chi_square_bounds_95(6 * n);
  int beyond = 0;
  for (const double v : errors.nees) beyond += v > 12.592;  // 95 % of a chi-squared variable of 6
  std::printf("%-22s %6.0f %9.2f   %5.2f to %5.2f %10.1f %10.3f %10.4f  %s\n", name, n, mean, bounds.low / n,
              bounds.high / n, 100 * beyond / n, 1e3 * mean_of(errors.translation_m), mean_of(errors.rotation_deg),
              mean >= bounds.low / n && mean <= bounds.high / n ? "consistent"
              : mean < bounds.low / n                           ? "too careful"
                                                                : "too sure");
}

}  // namespace

int main(int argc, char** argv) {
  const int runs = argc > 1 ? std::atoi(argv[1]) : 100;
  const int seed = argc > 2 ? std::atoi(argv[2]) : 1;
  Errors odometry, constraints;
  for (int run = 0; run < runs; ++run) {
    const int building = seed + run / 10, walk = run % 5;
    const auto source = open_synthetic_stereo_source("synthetic:building?seed=" + std::to_string(building) +
                                                     "&walk=" + std::to_string(walk));
    const StereoCalibration rig = *source->calibration();
    StereoCamera camera;
    camera.width = rig.left.width();
    camera.height = rig.left.height();
    camera.focal_px = rig.left.focal_px();
    camera.centre_px = rig.left.centre_px();
    camera.baseline_m = rig.baseline_m();
    StereoOdometry tracker(camera, {});
    StereoWindow window(camera, {});
    const int first = 60 + (run * 7919) % (source->frame_count() - 60 - kMostFrames * kWindowPoses);
    std::vector<int> frames;
    for (int k = 0; k < kMostFrames * kWindowPoses && static_cast<int>(frames.size()) < kWindowPoses; ++k) {
      const StereoFrame pair = source->frame(first + k);
      const StereoFrameResult result = tracker.process(k, pair.left.time, pair.left.grey, pair.right.grey);
      if (!result.keyframe) continue;
      frames.push_back(first + k);
      // One motion a run, and one constraint: neighbours are not independent.
      if (result.keyframe->index == kWindowPoses / 2 && !result.keyframe->after_failure) {
        const RigidTransform truth =
            source->world_from_camera(frames[frames.size() - 2]).inverse() * source->world_from_camera(frames.back());
        odometry.add(result.keyframe->previous_from_this, truth, result.keyframe->covariance);
      }
      tracker.take(window.add(*result.keyframe));
    }
    window.finish();
    for (const StereoConstraint& c : window.constraints()) {
      if (c.after_failure || c.from != kWindowPoses / 2 - 1) continue;
      const auto from = static_cast<std::size_t>(c.from), to = static_cast<std::size_t>(c.to);
      constraints.add(c.from_from_to,
                      source->world_from_camera(frames[from]).inverse() * source->world_from_camera(frames[to]),
                      c.covariance);
    }
  }
  std::printf("%-22s %6s %9s   %14s %10s %10s %10s\n", "motion", "count", "mean NEES", "95 % bounds", "beyond %",
              "error mm", "error deg");
  print("odometry", odometry);
  print("constraint of window", constraints);
  return 0;
}
