// The solver's inner loops, compiled once for each instruction set and chosen at run time (core/cpu_dispatch.h). Plain
// arrays in, plain arrays out; nothing here allocates, waits or throws. Internal to solver/.
//
// Observations are processed in lanes (structure of arrays, one observation a lane); what is summed per point or per
// camera pair is processed in rows of a camera block. Widths differ between instruction sets, so sums are rounded
// differently there; on one machine results depend on the input alone.
#pragma once

#include <cstdint>

namespace parallax::solver {

// The projections the kernels know. `bal` is Snavely's camera with focal length, k1 and k2 of each camera adjusted too.
enum class Lens : int { pinhole, radtan, kannala_brandt, fov, bal };
inline constexpr int kLensCount = 5;

struct LensParameters {
  Lens lens = Lens::pinhole;
  double fx = 1, fy = 1, cx = 0, cy = 0;
  double d[8] = {};       // CameraModel's order; fov: omega, 2 tan(omega / 2)
  double domain = 1e300;  // largest valid x^2 + y^2 at z = 1; kannala_brandt: largest valid angle
};

inline constexpr int camera_dimension(Lens lens) { return lens == Lens::bal ? 9 : 6; }

// A camera in the table: rotation (row-major), translation, then focal length, k1, k2 (bal only).
inline constexpr int kCameraStride = 16;
// What is kept of a point between the two passes: inverse Cholesky factor of its damped 3x3 block (lower, by rows),
// gradient, undamped diagonal.
inline constexpr int kPointStride = 12;
// Padding of every observation array, in elements, and largest number of rows of a point chunk.
inline constexpr int kLanePadding = 16;

// Tiles of the reduced camera system: column-major, kTile x kTile, lower triangle of a symmetric matrix.
inline constexpr int kTile = 48;
inline constexpr int kTileSize = kTile * kTile;
inline constexpr int blocks_per_tile(int dimension) { return kTile / dimension; }

// Observations sorted by point; those of point p are [begin[p], begin[p + 1]). All arrays are padded by kLanePadding.
struct ObservationArrays {
  const double* u = nullptr;  // pixel
  const double* v = nullptr;
  double* inverse_sigma = nullptr;       // 0: takes no part
  const std::int32_t* camera = nullptr;  // index times kCameraStride
  const std::int32_t* point = nullptr;   // index times 3
  const std::int32_t* begin = nullptr;
};

// Robust kernel: 0 none, 1 Huber, 2 Tukey; c2 is the squared width.
struct KernelParameters {
  int kind = 0;
  double c2 = 1;
};

struct LineariseJob {
  LensParameters lens;
  KernelParameters kernel;
  const double* cameras = nullptr;
  const double* points = nullptr;  // 3 a point
  ObservationArrays free;          // of cameras that are adjusted, in order of elimination within a point
  ObservationArrays fixed;         // of cameras that are not
  double lambda = 0;
  // Reduced system.
  double* tiles = nullptr;
  const std::int64_t* tile_at = nullptr;  // [row tile * tile_count + column tile] -> offset
  int tile_count = 0;
  const std::int32_t* tile_of = nullptr;   // of a camera
  const std::int32_t* local_of = nullptr;  // its first row in the tile
  double* right = nullptr;                 // right-hand side, tile_count * kTile
  double* camera_diagonal = nullptr;       // diagonal of J^T J, laid out as `right`
  double* point_data = nullptr;
  double* scratch = nullptr;  // linearise_scratch() doubles
};

struct UpdateJob {
  LensParameters lens;
  KernelParameters kernel;
  const double* cameras = nullptr;
  const double* points = nullptr;
  const double* new_cameras = nullptr;
  double* new_points = nullptr;
  ObservationArrays free, fixed;
  double lambda = 0;
  const double* step = nullptr;  // of the cameras, kCameraStride apart (camera index order)
  const double* point_data = nullptr;
  double* free_squared = nullptr;   // squared normalised residuals at the new state; infinite outside the domain,
  double* fixed_squared = nullptr;  // -1 for observations that take no part
  double* scratch = nullptr;        // update_scratch() doubles
  double predicted = 0;             // out, summed: the points' share of twice the model's gain
  double largest = 0;               // out: largest change of a coordinate
};

// Observations of one pose, padded to whole lanes with inverse_sigma 0; Jacobian columns are `stride` apart.
struct PoseJob {
  LensParameters lens;
  int count = 0;  // a multiple of kLanePadding
  int stride = 0;
  const double *x = nullptr, *y = nullptr, *z = nullptr, *u = nullptr, *v = nullptr, *inverse_sigma = nullptr;
  double pose[12] = {};  // rotation by rows, translation
  double *ru = nullptr, *rv = nullptr, *squared = nullptr, *jacobian = nullptr;
};
inline constexpr double kUnusedSquared = 1e30;  // squared residual of an observation that takes no part
inline constexpr int kPoseSums = 31;

struct SolverKernels {
  // Residuals at the current state only (all of points [first, last)): fills job.free_squared and fixed_squared.
  void (*evaluate)(UpdateJob& job, int first, int last);
  // Pass one: linearise points [first, last), eliminate them, add to the reduced system.
  void (*linearise)(const LineariseJob& job, int first, int last);
  // Pass two: back-substitute points [first, last), and evaluate the residuals there.
  void (*update)(UpdateJob& job, int first, int last);
  // Sum of the kernel's cost over c^2 (no factor 1/2) of n values.
  double (*cost)(const double* squared, int n, KernelParameters kernel);

  void (*tile_multiply)(double* c, const double* a, const double* b);  // C -= A B^T
  bool (*tile_factor)(double* c);                                   // C = L L^T, in place (lower); false: not positive
  void (*tile_solve)(double* x, const double* l);                   // X = X L^-T
  void (*tile_apply)(double* y, const double* a, const double* x);  // y -= A x
  void (*tile_apply_transposed)(double* y, const double* a, const double* x);  // y -= A^T x

  void (*pose_project)(const PoseJob& job);
  void (*pose_advance)(const PoseJob& job, const double* mu);  // residuals follow a pose increment to first order
  // out: upper triangle of sum w J^T J by rows (21), sum w J^T r (6), sums of w, of w^2 s and of w + s dw/ds, and the
  // number of weights above 0; kPoseSums values.
  void (*pose_normal)(const PoseJob& job, KernelParameters kernel, double* out);
};

// Doubles of scratch for chunks whose points have at most `observations` observations in a list.
inline constexpr int scratch_doubles(int observations) { return (observations + 3 * kLanePadding) * 80; }
// Points are handed over in chunks of about so many observations of one list (more when one point has more).
inline constexpr int kChunkObservations = 192;

// The kernels for this lens at the level in use.
const SolverKernels& solver_kernels(Lens lens);

}  // namespace parallax::solver
