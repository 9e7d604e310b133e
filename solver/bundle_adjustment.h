// Bundle adjustment (PTAM §6.3, Eq. 10 and 11): Levenberg-Marquardt with the Schur complement over points, exploiting
// the sparsity of both sides. Arrays and indices in, numbers out.
//
// The cost is 1/2 sum c^2 rho(|r|^2 / (sigma_px c)^2) with c the kernel's width times its scale: Tukey's, Huber's or
// none, minimised by iteratively re-weighted least squares inside Levenberg-Marquardt. Observations behind the camera
// or outside the lens's domain have no weight: under Tukey they cost what an outlier costs; under the other kernels
// those that start there are left out, and no step is taken that sends another one there.
//
// Gauge: with one fixed pose a mono problem's scale is free, with none its whole frame; the damping keeps the system
// definite, and the state stays near where it started along those directions. Points that only fixed poses see are
// adjusted too. With `threads` above one the loops are shared out; for one number of threads, results depend on the
// input alone.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/camera_model.h"
#include "core/interruption.h"
#include "core/se3.h"
#include "solver/robust_kernel.h"

namespace parallax {

struct BundleObservation {
  int pose = 0;                                     // index into BundleProblem::poses
  int point = 0;                                    // index into BundleProblem::points
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // level 0
  double sigma_px = 1.0;                            // standard deviation of the measurement, level-0 pixels
};

struct BundleProblem {
  CameraModel camera;
  std::vector<RigidTransform> poses;     // camera_from_world
  std::vector<std::uint8_t> pose_fixed;  // 1: not adjusted
  std::vector<Eigen::Vector3d> points;   // world
  std::vector<BundleObservation> observations;
};

struct BundleOptions {
  RobustKernel kernel = RobustKernel::tukey;
  // Kernel scale in units of sigma_px: the standard deviation of normalised residuals. With estimate_sigma it is
  // re-estimated from the median before every iteration (PTAM §6.3) and never below min_sigma; else fixed_sigma holds.
  bool estimate_sigma = true;
  double min_sigma = 0.2;
  double fixed_sigma = 1.0;
  int max_iterations = 20;
  double relative_cost_tolerance = 1e-6;  // converged when an accepted step lowers the cost by less than this part
  double step_tolerance = 1e-9;           // or the largest update is below this (metres, radians)
  double initial_lambda = 1e-4;
  int threads = 1;
};

struct BundleSummary {
  double initial_cost = 0, final_cost = 0;  // 1/2 sum rho, at the last kernel scale
  double sigma = 1;                         // last kernel scale
  int iterations = 0;                       // accepted and rejected steps
  bool converged = false;
  bool stopped = false;  // by the stop token; the problem holds the best state found so far
  bool failed = false;   // numerically, or a value that is not finite: nothing was changed
};

// Adjusts poses and points in place. `outlier`, when given, gets a 1 for each observation in the zero-weight region of
// the kernel at the end (or behind the camera). Stops within a millisecond or so of `stop` being requested. Thread-safe
// for different problems. Each point should have two observations or more; poses without observations stay as they are.
BundleSummary adjust_bundle(BundleProblem* problem, const BundleOptions& options, const Interruption& stop = {},
                            std::vector<std::uint8_t>* outlier = nullptr);

}  // namespace parallax
