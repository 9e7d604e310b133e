// Windowed bundle adjustment of a stereo camera (McDonald et al., multi-session visual SLAM, section 3.2, Eq. 1 and 2):
// batch smoothing of the poses and points of a short window by Powell's dog-leg (Powell 1970; Rosen, Kaess and Leonard
// 2012) on the Schur complement over the points. Points are homogeneous, of unit norm, and may lie at infinity
// (solver/homogeneous_point.h). Arrays and indices in, numbers out.
//
// The cost is 1/2 sum c^2 rho(|r|^2 / (sigma_px c)^2) over the observations, r = (u_left, u_right, v) predicted less
// measured in pixels (without u_right where it was not seen) and c = window_kernel_width() times the kernel's scale,
// plus 1/2 e^T information e over the priors. It is minimised by iteratively re-weighted least squares inside the
// dog-leg.
//
// The sign of a point: p and -p are one point. A point is ahead of a camera when its disparity there, focal length
// times baseline times w / z, is above minus `beyond_infinity_px`: noise puts what is far a little beyond infinity, and
// that is left to the data. Each point is given the sign that makes z positive in most of the cameras it is ahead of,
// and keeps it while it moves. Observations behind the camera have no weight: under Tukey's kernel they cost what an
// outlier costs; under the other kernels those that start there are left out, and no step is taken that sends another
// one there.
//
// The window's frame may be anywhere: internally its origin is the mean of the cameras' centres, which is where the
// parameterisation of the points is at its best. Without a fixed pose the frame stays near where it was.
//
// Safe from any thread for different problems (scratch memory belongs to the thread and is kept, so that a call hardly
// allocates once it is warm). Indices out of range are bugs (PARALLAX_CHECK).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/interruption.h"
#include "core/se3.h"
#include "core/stereo_camera.h"
#include "solver/robust_kernel.h"

namespace parallax {

struct StereoObservation {
  int pose = 0, point = 0;                          // rows of WindowProblem's poses and points
  Eigen::Vector3d pixel = Eigen::Vector3d::Zero();  // (u_left, u_right, v), level 0; u_right NaN: not seen there
  double sigma_px = 0.5;                            // standard deviation of each of the three
};

// What is known of pose b relative to pose a. The residual e is (t, log R) of camera_b_from_camera_a * b_from_a^-1.
struct RelativePosePrior {
  int a = 0, b = 0;
  RigidTransform b_from_a;
  Matrix6d information = Matrix6d::Identity();  // of a left perturbation of b_from_a, (translation, rotation)
};

struct WindowProblem {
  StereoCamera camera;
  std::vector<RigidTransform> poses;     // (left) camera_from_window
  std::vector<std::uint8_t> pose_fixed;  // 1: not adjusted
  std::vector<Eigen::Vector4d> points;   // window frame, homogeneous, of unit norm; w may be 0 or negative
  std::vector<StereoObservation> observations;
  std::vector<RelativePosePrior> priors;
};

struct WindowOptions {
  // Tukey's: tracks that slide off their corner pass the odometry's check from frame to frame and pile up in a window;
  // Huber's lets each pull for ever. The odometry's start is good to about a pixel, and the estimated scale opens the
  // kernel where it is not.
  RobustKernel kernel = RobustKernel::tukey;
  // The kernel's scale in units of sigma_px. With estimate_sigma it is the median-based standard deviation of the
  // normalised residuals, taken anew before every iteration and never below min_sigma; else fixed_sigma holds.
  bool estimate_sigma = true;
  double min_sigma = 1.0;
  double fixed_sigma = 1.0;
  int max_iterations = 20;
  double relative_cost_tolerance = 1e-6;  // converged when an accepted step lowers the cost by less than this part
  double step_tolerance = 1e-9;           // or the largest update is below this (metres, radians)
  // Standard deviations of the residuals: the length of a step is what it would change them by if each pose and point
  // moved alone (the norm of the diagonal blocks of J^T W J). Large: Gauss-Newton until a step fails.
  double initial_trust_radius = 1e4;
  double beyond_infinity_px = 3;  // of disparity: further beyond infinity is behind the camera
};

struct WindowSummary {
  double initial_cost = 0, final_cost = 0;  // at the last kernel scale
  double sigma = 1;                         // last kernel scale
  int iterations = 0;                       // accepted and rejected steps
  int dog_leg_steps = 0;                    // of these, not the whole Gauss-Newton step
  bool converged = false;
  bool stopped = false;  // by the stop token; the problem holds the best state found so far
  // Nothing was changed: a value that is not finite, a sigma, focal length or baseline that is not positive, a point of
  // zero norm, no observation or none ahead of its camera, or no solvable system.
  bool failed = false;
};

// The kernel's width in standard deviations: 95 % efficient for Gaussian noise in three dimensions.
inline constexpr double kWindowTukeyWidth = 5.4902, kWindowHuberWidth = 1.6319;
inline double window_kernel_width(RobustKernel kernel) {
  return kernel == RobustKernel::tukey ? kWindowTukeyWidth : kernel == RobustKernel::huber ? kWindowHuberWidth : 1.0;
}

// Adjusts poses and points in place; points keep unit norm, and the sign said above. `outlier`, when given, gets a 1
// for each observation that ends behind its camera or, under a robust kernel, beyond Tukey's width times the scale.
// Points and poses without observations (or priors) stay as they are. Stops within a millisecond or so of `stop`.
WindowSummary smooth_window(WindowProblem* problem, const WindowOptions& options, const Interruption& stop = {},
                            std::vector<std::uint8_t>* outlier = nullptr);

// Covariances of pose b relative to pose a: of d in exp(d) b_from_a, translation first, for pairs (a, b). From the
// inverse of the information of the reduced camera system (points marginalised out) at the problem's state, with the
// first fixed pose (without one, the first pose) as gauge and every other pose free. Observations that smooth_window()
// calls outliers are left out, the others count in full; the noise is sigma_px times the scale of the options. Points
// that one camera alone sees, and then without a right measurement, say nothing. False, and nothing is written: a
// system that is not definite, a pose that nothing is known of, or what smooth_window() calls failed.
bool window_covariance(const WindowProblem& problem, const WindowOptions& options,
                       const std::vector<std::pair<int, int>>& pairs, std::vector<Matrix6d>* covariances);

}  // namespace parallax
