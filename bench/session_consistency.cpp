// Are the covariances of two sessions that have met the size of their errors? Runs of synthetic:building, each another
// building: one session on wheels down the west leg, and a hand-held one that begins there and recognises it. The
// normalised estimation error squared (NEES) of the second session's poses in the first one's frame, against truth, and
// its mean beside the 95 percent bounds of a chi-squared variable of 6 degrees of freedom a run.
//
//   bench_session_consistency [RUNS [SEED]]
#include <Eigen/Cholesky>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "app/slam_sessions.h"
#include "solver/chi_square.h"

using namespace parallax;

namespace {

constexpr int kFirstStart = 740, kFirstFrames = 220, kSecondFrames = 140;

const RigidTransform* true_pose_at(const Trajectory& truth, Timestamp time) {
  for (const TrajectoryPose& pose : truth)
    if (pose.time == time) return &pose.world_from_camera;
  return nullptr;
}

}  // namespace

int main(int argc, char** argv) {
  const int runs = argc > 1 ? std::atoi(argv[1]) : 20, seed = argc > 2 ? std::atoi(argv[2]) : 1;
  if (argc > 3 || runs < 1 || seed < 0) {
    std::fprintf(stderr, "usage: bench_session_consistency [RUNS [SEED]]\n");
    return 2;
  }
  double sum = 0, error_m = 0, told_m = 0;
  int met = 0, beyond = 0;
  for (int run = 0; run < runs; ++run) {
    const std::string building = "synthetic:building?seed=" + std::to_string(seed + run);
    std::vector<SlamSessionPlan> plans(2);
    plans[0].source = building + "&walk=1";
    plans[0].source_options.start_frame = kFirstStart;
    plans[0].source_options.max_frames = kFirstFrames;
    plans[1].source = building + "&walk=3";
    plans[1].source_options.max_frames = kSecondFrames;
    plans[0].name = "first";
    plans[1].name = "second";
    SlamSessionsOptions options;
    options.slam.pace = Pace::lockstep;
    options.link.lockstep = true;
    options.covariances = 1;
    const SlamSessionsResult result = run_slam_sessions(plans, options);
    const SlamSessionOutcome &first = result.sessions[0], &second = result.sessions[1];
    if (second.state.component != first.state.id || second.result.keyframes.empty()) {
      std::fprintf(stderr, "%d: did not meet\n", run);
      continue;
    }
    const PoseKey last{second.state.id, static_cast<int>(second.result.keyframes.size()) - 1};
    const auto covariance = result.covariances.find(last);
    const RigidTransform* origin = true_pose_at(first.truth, first.result.keyframes.front().time);
    const RigidTransform* there = true_pose_at(second.truth, second.result.keyframes.back().time);
    if (covariance == result.covariances.end() || !origin || !there) continue;
    const RigidTransform estimate = second.state.global_from_session * second.result.keyframes.back().world_from_camera;
    const Vector6d error = (origin->inverse() * *there * estimate.inverse()).log();
    const double squared = error.dot(covariance->second.ldlt().solve(error));
    ++met;
    sum += squared;
    beyond += squared > 12.592;  // 95 % of a chi-squared variable of 6
    error_m += error.head<3>().norm();
    told_m += std::sqrt(covariance->second.topLeftCorner<3, 3>().trace());
    std::fprintf(stderr, "%d: %.2f\n", run, squared);
  }
  std::printf("runs  met  mean NEES  95 %% bounds      beyond 95 %%  error mm  told mm\n");
  if (met > 0) {
    const ChiSquareBounds bounds = chi_square_bounds_95(6.0 * met);
    std::printf("%4d %4d %10.2f   %5.2f to %5.2f %10.1f %% %9.2f %8.2f\n", runs, met, sum / met, bounds.low / met,
                bounds.high / met, 100.0 * beyond / met, 1e3 * error_m / met, 1e3 * told_m / met);
  }
  return met > 0 ? 0 : 1;
}
