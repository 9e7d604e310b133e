// The inner loops of the windowed bundle adjustment, compiled once for each instruction set and chosen at run time
// (core/cpu_dispatch.h). Plain arrays in, plain arrays out; nothing here allocates, waits or throws. Internal to
// solver/.
//
// Blocks of a pose are six rows (columns) padded to eight: column 6 carries the right-hand side along, 7 is zero. What
// couples a pose that is adjusted and a point is an edge: three rows of eight. Edges are sorted by point and then by
// pose; observations likewise.
#pragma once

#include <cstdint>

#include "solver/solver_kernels.h"

namespace parallax::solver {

inline constexpr int kWindowPoseStride = 12;    // rotation by rows, translation
inline constexpr int kWindowPointStride = 12;   // inverse Cholesky factor (lower, by rows: 6), factor^-1 gradient (3)
inline constexpr int kWindowEdgeStride = 24;    // factor^-1 W^T, three rows
inline constexpr int kWindowBlockStride = 48;   // six rows
inline constexpr double kWindowNearest = 1e-6;  // smallest z of a point of unit norm that is ahead of a camera

struct WindowObservation {
  double u_left = 0, u_right = 0, v = 0;
  double inverse_sigma = 0;  // 0: takes no part
  double stereo = 0;         // 1: u_right counts, else 0
  std::int32_t pose = 0;     // row of the poses
  std::int32_t edge = -1;    // row of the edges; -1: the pose is not adjusted
};

struct WindowJob {
  double fx = 1, fy = 1, cx = 0, cy = 0, baseline = 0;
  KernelParameters kernel;
  const double* poses = nullptr;   // kWindowPoseStride a pose
  const double* points = nullptr;  // 4 a point, signed so that z is positive ahead of the cameras
  const WindowObservation* observations = nullptr;
  const std::int32_t* observation_begin = nullptr;  // of a point, one more at the end
  const std::int32_t* edge_begin = nullptr;         // likewise
  const std::int32_t* edge_slot = nullptr;          // of an edge: its pose's row among those adjusted
  int points_count = 0;
  // Out; pose_blocks and reduced are added to.
  double* squared = nullptr;      // of an observation: squared normalised residual, infinite behind, -1: takes no part
  double* edges = nullptr;        // kWindowEdgeStride an edge
  double* point_data = nullptr;   // kWindowPointStride a point
  double* pose_blocks = nullptr;  // J^T W J and, in column 6, J^T W r
  double* reduced = nullptr;  // blocks of the lower triangle, row * (row + 1) / 2 + column: minus what is eliminated
};

struct WindowKernels {
  // Fills `squared`.
  void (*evaluate)(const WindowJob& job);
  // Linearises with the kernel's weights and eliminates the points.
  void (*linearise)(const WindowJob& job);
  // white[3 p]: minus (factor^-1 gradient + sum over the point's edges of edge times the pose's step), eight a pose.
  void (*substitute)(const WindowJob& job, const double* steps, double* white);
};

// At the level in use.
const WindowKernels& window_kernels();

}  // namespace parallax::solver
