#include "solver/schur_solver.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>

#include "core/check.h"
#include "core/se3.h"
#include "solver/block_cholesky.h"
#include "solver/bundle_layout.h"
#include "solver/work_team.h"

namespace parallax::solver {
namespace {

using std::size_t;

// Damping: Marquardt's (the diagonal of J^T J scales it), updated by the gain ratio (Nielsen 1999).
constexpr double kSmallestLambda = 1e-12, kLargestLambda = 1e16;
constexpr double kSmallestDiagonal = 1e-6;  // of J^T J, for damping
// A predicted decrease below this part of the cost is rounding.
constexpr double kRounding = 1e-14;
// Doubles zeroed between two looks at the stop token (1 MB).
constexpr size_t kZeroBlock = size_t{1} << 17;

class SchurSolver {
 public:
  SchurSolver(SchurProblem& problem, const BundleOptions& options, const Interruption& stop)
      : problem_(problem),
        options_(options),
        stop_(stop),
        kernels_(solver_kernels(problem.lens.lens)),
        dimension_(camera_dimension(problem.lens.lens)),
        team_(std::clamp(options.threads, 1, 16)) {}

  BundleSummary run(std::vector<std::uint8_t>* outlier) {
    if (outlier) outlier->assign(problem_.observations.size(), 0);
    if (!usable()) {
      summary_.failed = true;
      return summary_;
    }
    if (!prepare()) {
      summary_.stopped = true;
      return summary_;
    }
    iterate();
    write_back();
    if (outlier) mark_outliers(outlier);
    return summary_;
  }

 private:
  // What one member of the team accumulates.
  struct Share {
    std::unique_ptr<double[]> own_tiles;  // member 0 adds to the system itself
    double* tiles = nullptr;
    std::vector<double> right, diagonal, scratch;
    int first_chunk = 0, last_chunk = 0;
    double predicted = 0, largest = 0;
  };

  bool usable() const {
    const int cameras = static_cast<int>(problem_.camera_fixed.size()),
              points = static_cast<int>(problem_.points.size());
    PARALLAX_CHECK(problem_.cameras.size() == problem_.camera_fixed.size() * kCameraStride,
                   "camera and fixed-flag arrays of different size");
    bool good = true;
    for (const BundleObservation& o : problem_.observations) {
      PARALLAX_CHECK(o.pose >= 0 && o.pose < cameras && o.point >= 0 && o.point < points,
                     "an observation names a pose or point that is not there");
      good &= std::isfinite(o.pixel.x()) && std::isfinite(o.pixel.y()) && o.sigma_px > 0 && std::isfinite(o.sigma_px);
    }
    for (const double x : problem_.cameras) good &= std::isfinite(x);
    for (const Eigen::Vector3d& p : problem_.points) good &= p.allFinite();
    return good;
  }

  bool prepare() {
    const int group = blocks_per_tile(dimension_);
    if (!layout_.build(static_cast<int>(problem_.camera_fixed.size()), problem_.camera_fixed,
                       static_cast<int>(problem_.points.size()), problem_.observations, group, stop_))
      return false;
    cameras_.resize(layout_.camera_source.size() * kCameraStride);
    for (size_t i = 0; i < layout_.camera_source.size(); ++i)
      std::copy_n(problem_.cameras.begin() + layout_.camera_source[i] * kCameraStride, kCameraStride,
                  cameras_.begin() + static_cast<std::ptrdiff_t>(i) * kCameraStride);
    new_cameras_ = cameras_;
    points_.resize(3 * layout_.point_source.size());
    for (size_t i = 0; i < layout_.point_source.size(); ++i)
      for (int k = 0; k < 3; ++k)
        points_[3 * i + static_cast<size_t>(k)] = problem_.points[static_cast<size_t>(layout_.point_source[i])][k];
    new_points_ = points_;
    point_data_.resize(layout_.point_source.size() * kPointStride);
    step_.assign(static_cast<size_t>(layout_.free_cameras) * kCameraStride + kCameraStride, 0.0);
    free_squared_.resize(static_cast<size_t>(layout_.free.size() + kLanePadding));
    fixed_squared_.resize(static_cast<size_t>(layout_.fixed.size() + kLanePadding));
    new_free_squared_ = free_squared_;
    new_fixed_squared_ = fixed_squared_;
    if (stop_.requested()) return false;
    if (layout_.free_cameras > 0) system_.emplace(layout_.graph, layout_.order, dimension_, kernels_);
    divide();
    return !stop_.requested();
  }

  // Chunks to members, about equal work each: a point's is in proportion to the squared number of its cameras.
  void divide() {
    const int chunks = static_cast<int>(layout_.chunk.size()) - 1, members = team_.members();
    std::vector<double> work(1, 0.0);
    for (int c = 0; c < chunks; ++c) {
      double w = 0;
      for (int p = layout_.chunk[static_cast<size_t>(c)]; p < layout_.chunk[static_cast<size_t>(c) + 1]; ++p) {
        const auto q = static_cast<size_t>(p);
        const double k = layout_.free.begin[q + 1] - layout_.free.begin[q];
        w += k * k + 8 * k + 3.0 * (layout_.fixed.begin[q + 1] - layout_.fixed.begin[q]) + 4;
      }
      work.push_back(work.back() + w);
    }
    shares_.resize(static_cast<size_t>(members));
    const size_t rows = system_ ? static_cast<size_t>(system_->rows()) : 0;
    int next = 0;
    for (int m = 0; m < members; ++m) {
      Share& share = shares_[static_cast<size_t>(m)];
      share.first_chunk = next;
      const double target = work.back() * (m + 1) / members;
      while (next < chunks && (m + 1 == members || work[static_cast<size_t>(next) + 1] <= target)) ++next;
      share.last_chunk = next;
      share.right.resize(rows);
      share.diagonal.resize(rows);
      share.scratch.resize(static_cast<size_t>(scratch_doubles(layout_.largest_chunk)));
      if (system_) {
        if (m > 0) share.own_tiles.reset(new double[system_->size()]);
        share.tiles = m > 0 ? share.own_tiles.get() : system_->tiles();
      }
    }
  }

  KernelParameters kernel() const {
    const double c = kernel_width(options_.kernel) * summary_.sigma;
    return {options_.kernel == RobustKernel::tukey ? 2 : options_.kernel == RobustKernel::huber ? 1 : 0, c * c};
  }

  double cost(const std::vector<double>& free_squared, const std::vector<double>& fixed_squared) const {
    const KernelParameters k = kernel();
    const double sum = kernels_.cost(free_squared.data(), layout_.free.size(), k) +
                       kernels_.cost(fixed_squared.data(), layout_.fixed.size(), k);
    return 0.5 * k.c2 * sum;
  }

  UpdateJob update_job() {
    UpdateJob job;
    job.lens = problem_.lens;
    job.kernel = kernel();
    job.cameras = cameras_.data();
    job.points = points_.data();
    job.new_cameras = new_cameras_.data();
    job.new_points = new_points_.data();
    job.free = layout_.free.arrays();
    job.fixed = layout_.fixed.arrays();
    job.lambda = lambda_;
    job.step = step_.data();
    job.point_data = point_data_.data();
    job.free_squared = new_free_squared_.data();
    job.fixed_squared = new_fixed_squared_.data();
    return job;
  }

  // Runs a pass over the chunks of each member; false when stopped.
  template <class Work>
  bool for_chunks(const Work& work) {
    team_.run([&](int member) {
      const Share& share = shares_[static_cast<size_t>(member)];
      for (int c = share.first_chunk; c < share.last_chunk; ++c) {
        if (stop_.requested()) return;
        work(member, layout_.chunk[static_cast<size_t>(c)], layout_.chunk[static_cast<size_t>(c) + 1]);
      }
    });
    return !stop_.requested();
  }

  // Squared residuals at the start. What cannot be seen from there takes no part, unless the kernel bounds its cost.
  bool evaluate_start() {
    UpdateJob job = update_job();
    job.free_squared = free_squared_.data();
    job.fixed_squared = fixed_squared_.data();
    if (!for_chunks([&](int, int first, int last) { kernels_.evaluate(job, first, last); })) return false;
    if (options_.kernel == RobustKernel::tukey) return true;
    const auto leave_out = [](ObservationList* list, std::vector<double>* squared) {
      for (size_t i = 0; i < static_cast<size_t>(list->size()); ++i)
        if (std::isinf((*squared)[i])) {
          list->inverse_sigma[i] = 0;
          (*squared)[i] = -1;
        }
    };
    leave_out(&layout_.free, &free_squared_);
    leave_out(&layout_.fixed, &fixed_squared_);
    return true;
  }

  void estimate_sigma() {
    if (!options_.estimate_sigma) return;
    sample_.clear();
    const auto add = [this](const std::vector<double>& squared, int n) {
      for (size_t i = 0; i < static_cast<size_t>(n); ++i)
        if (squared[i] >= 0 && squared[i] < 1e30) sample_.push_back(static_cast<float>(squared[i]));
    };
    add(free_squared_, layout_.free.size());
    add(fixed_squared_, layout_.fixed.size());
    summary_.sigma = std::max(options_.min_sigma, robust_sigma_2d(std::span<float>(sample_)));
  }

  bool linearise() {
    LineariseJob job;
    job.lens = problem_.lens;
    job.kernel = kernel();
    job.cameras = cameras_.data();
    job.points = points_.data();
    job.free = layout_.free.arrays();
    job.fixed = layout_.fixed.arrays();
    job.lambda = lambda_;
    job.point_data = point_data_.data();
    if (system_) {
      job.tile_at = system_->tile_at();
      job.tile_count = system_->tile_count();
      job.tile_of = system_->tile_of();
      job.local_of = system_->local_of();
      team_.run([&](int member) {
        Share& share = shares_[static_cast<size_t>(member)];
        for (size_t i = 0; i < system_->size() && !stop_.requested(); i += kZeroBlock)
          std::memset(share.tiles + i, 0, std::min(kZeroBlock, system_->size() - i) * sizeof(double));
        std::fill(share.right.begin(), share.right.end(), 0.0);
        std::fill(share.diagonal.begin(), share.diagonal.end(), 0.0);
      });
    }
    const auto pass = [&](int member, int first, int last) {
      Share& share = shares_[static_cast<size_t>(member)];
      LineariseJob mine = job;
      mine.tiles = share.tiles;
      mine.right = share.right.data();
      mine.camera_diagonal = share.diagonal.data();
      mine.scratch = share.scratch.data();
      kernels_.linearise(mine, first, last);
    };
    if (!for_chunks(pass)) return false;
    return !system_ || finish_system();
  }

  // Adds the members' shares up and damps the diagonal.
  bool finish_system() {
    const int members = team_.members();
    if (members > 1) {
      team_.run([&](int member) {
        const size_t n = system_->size(), from = n * static_cast<size_t>(member) / static_cast<size_t>(members),
                     to = n * static_cast<size_t>(member + 1) / static_cast<size_t>(members);
        double* sum = system_->tiles();
        for (size_t block = from; block < to && !stop_.requested(); block += kZeroBlock)
          for (int m = 1; m < members; ++m) {
            const double* other = shares_[static_cast<size_t>(m)].tiles;
            for (size_t i = block; i < std::min(to, block + kZeroBlock); ++i) sum[i] += other[i];
          }
      });
      for (int m = 1; m < members; ++m)
        for (size_t i = 0; i < shares_[0].right.size(); ++i) {
          shares_[0].right[i] += shares_[static_cast<size_t>(m)].right[i];
          shares_[0].diagonal[i] += shares_[static_cast<size_t>(m)].diagonal[i];
        }
    }
    for (int k = 0; k < layout_.free_cameras; ++k) {
      const int tile = system_->tile_of()[k], local = system_->local_of()[k];
      double* block = system_->tiles() +
                      system_->tile_at()[static_cast<size_t>(tile) * static_cast<size_t>(system_->tile_count() + 1)];
      for (int i = 0; i < dimension_; ++i) {
        double& d = shares_[0].diagonal[static_cast<size_t>(tile * kTile + local + i)];
        d = std::max(d, kSmallestDiagonal);
        block[(local + i) * (kTile + 1)] += lambda_ * d;
      }
    }
    system_->finish_matrix();
    return !stop_.requested();
  }

  // The cameras' step and their share of what the model says the step gains (twice); false when it is not finite. With
  // the points eliminated, twice the gain is d . right + sum |L^-1 g|^2 over points, plus the damping terms.
  bool step_cameras(double* predicted, double* largest) {
    *predicted = *largest = 0;
    if (!system_) return true;
    solution_ = shares_[0].right;
    system_->solve(solution_.data());
    for (int k = 0; k < layout_.free_cameras; ++k) {
      const int row = system_->row_of(k);
      double* step = step_.data() + k * kCameraStride;
      for (int i = 0; i < dimension_; ++i) {
        const double d = solution_[static_cast<size_t>(row + i)];
        step[i] = d;
        const auto at = static_cast<size_t>(row + i);
        *predicted += d * (shares_[0].right[at] + lambda_ * shares_[0].diagonal[at] * d);
        if (i < 6) *largest = std::max(*largest, std::abs(d));
        if (!std::isfinite(d)) return false;
      }
      move_camera(cameras_.data() + k * kCameraStride, step, new_cameras_.data() + k * kCameraStride);
    }
    return true;
  }

  void move_camera(const double* from, const double* step, double* to) const {
    using RowMatrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    const RigidTransform increment = RigidTransform::exp(Eigen::Map<const Vector6d>(step));
    const RigidTransform moved =
        increment * RigidTransform(Eigen::Map<const RowMatrix>(from), Eigen::Map<const Eigen::Vector3d>(from + 9));
    Eigen::Map<RowMatrix>(to).noalias() = moved.R;
    Eigen::Map<Eigen::Vector3d>(to + 9).noalias() = moved.t;
    for (int i = 6; i < dimension_; ++i) to[6 + i] = from[6 + i] + step[i];
  }

  bool update(double* predicted, double* largest) {
    for (Share& share : shares_) share.predicted = share.largest = 0;
    const UpdateJob job = update_job();
    const bool finished = for_chunks([&](int member, int first, int last) {
      Share& share = shares_[static_cast<size_t>(member)];
      UpdateJob mine = job;
      mine.scratch = share.scratch.data();
      kernels_.update(mine, first, last);
      share.predicted += mine.predicted;
      share.largest = std::max(share.largest, mine.largest);
    });
    for (const Share& share : shares_) {
      *predicted += share.predicted;
      *largest = std::max(*largest, share.largest);
    }
    return finished;
  }

  void iterate();

  void write_back() {
    for (size_t i = 0; i < static_cast<size_t>(layout_.free_cameras); ++i)
      std::copy_n(cameras_.begin() + static_cast<std::ptrdiff_t>(i) * kCameraStride, kCameraStride,
                  problem_.cameras.begin() + layout_.camera_source[i] * kCameraStride);
    for (size_t i = 0; i < layout_.point_source.size(); ++i)
      problem_.points[static_cast<size_t>(layout_.point_source[i])] = {points_[3 * i], points_[3 * i + 1],
                                                                       points_[3 * i + 2]};
  }

  void mark_outliers(std::vector<std::uint8_t>* outlier) const {
    const double limit = options_.kernel == RobustKernel::tukey ? kernel().c2 : std::numeric_limits<double>::infinity();
    const auto mark = [&](const ObservationList& list, const std::vector<double>& squared) {
      for (size_t i = 0; i < static_cast<size_t>(list.size()); ++i)
        (*outlier)[static_cast<size_t>(list.source[i])] = squared[i] < 0 || squared[i] >= limit;
    };
    mark(layout_.free, free_squared_);
    mark(layout_.fixed, fixed_squared_);
  }

  SchurProblem& problem_;
  const BundleOptions& options_;
  const Interruption& stop_;
  const SolverKernels& kernels_;
  const int dimension_;
  WorkTeam team_;
  BundleLayout layout_;
  std::optional<BlockCholesky> system_;
  std::vector<Share> shares_;
  std::vector<double> cameras_, new_cameras_, points_, new_points_, point_data_, step_, solution_;
  std::vector<double> free_squared_, fixed_squared_, new_free_squared_, new_fixed_squared_;
  std::vector<float> sample_;
  double lambda_ = 0;
  BundleSummary summary_;
};

void SchurSolver::iterate() {
  summary_.sigma = options_.fixed_sigma;
  lambda_ = std::clamp(options_.initial_lambda, kSmallestLambda, kLargestLambda);
  if (!evaluate_start()) {
    summary_.stopped = true;
    return;
  }
  estimate_sigma();
  double before = cost(free_squared_, fixed_squared_), growth = 2;
  summary_.initial_cost = summary_.final_cost = before;
  if (!(before > 0) || layout_.point_source.empty()) {
    summary_.converged = true;
    return;
  }
  while (summary_.iterations < options_.max_iterations) {
    if (!linearise()) break;
    bool good = true;
    if (system_) {
      const auto result = system_->factor(team_, stop_);
      if (result == BlockCholesky::Result::stopped) break;
      good = result == BlockCholesky::Result::done;
    }
    double gain = 0, largest = 0, after = std::numeric_limits<double>::infinity();
    good = good && step_cameras(&gain, &largest);
    if (good) {
      if (!update(&gain, &largest)) break;
      after = cost(new_free_squared_, new_fixed_squared_);
    }
    ++summary_.iterations;
    const double predicted = 0.5 * gain;
    if (good && after <= before) {
      cameras_.swap(new_cameras_);
      points_.swap(new_points_);
      free_squared_.swap(new_free_squared_);
      fixed_squared_.swap(new_fixed_squared_);
      summary_.final_cost = after;
      const double ratio = predicted > 0 ? (before - after) / predicted : 1.0;
      const double bend = 2 * ratio - 1;
      lambda_ = std::max(kSmallestLambda, lambda_ * std::max(1.0 / 3, 1 - bend * bend * bend));
      growth = 2;
      if (before - after <= options_.relative_cost_tolerance * before || largest <= options_.step_tolerance) {
        summary_.converged = true;
        return;
      }
      estimate_sigma();
      before = cost(free_squared_, fixed_squared_);
      summary_.final_cost = before;
    } else {
      if (good && (predicted <= kRounding * before || largest <= options_.step_tolerance)) {
        summary_.converged = true;
        return;
      }
      lambda_ *= growth;
      growth *= 2;
      if (lambda_ > kLargestLambda) {
        summary_.failed = summary_.final_cost == summary_.initial_cost;
        return;
      }
    }
  }
  summary_.stopped = stop_.requested();
}

}  // namespace

LensParameters lens_parameters(const CameraModel& camera) {
  LensParameters k;
  k.fx = camera.focal_px().x();
  k.fy = camera.focal_px().y();
  k.cx = camera.centre_px().x();
  k.cy = camera.centre_px().y();
  for (size_t i = 0; i < 8; ++i) k.d[i] = camera.distortion()[i];
  switch (camera.kind()) {
    case CameraModelKind::pinhole:
      k.lens = Lens::pinhole;
      return k;
    case CameraModelKind::radtan:
      k.lens = Lens::radtan;
      break;
    case CameraModelKind::kannala_brandt:
      k.lens = Lens::kannala_brandt;
      break;
    case CameraModelKind::fov:
      k.lens = Lens::fov;
      k.d[0] = std::max(k.d[0], 1e-9);
      k.d[1] = 2 * std::tan(k.d[0] / 2);
      break;
  }
  // Where the model's domain ends, as the model itself says: by bisection, along a radius.
  const bool by_angle = k.lens == Lens::kannala_brandt;
  Eigen::Vector2d pixel;
  const auto inside = [&](double r) {
    const Eigen::Vector3d point = by_angle ? Eigen::Vector3d(std::sin(r), 0, std::cos(r)) : Eigen::Vector3d(r, 0, 1);
    return camera.project(point, &pixel);
  };
  double low = 0, high = by_angle ? 3.14159265358979 : 1e6;
  if (inside(high)) {
    low = high;
  } else {
    for (int i = 0; i < 100 && high - low > 1e-14 * high; ++i) {
      const double middle = 0.5 * (low + high);
      (inside(middle) ? low : high) = middle;
    }
  }
  k.domain = by_angle ? low : low * low;
  return k;
}

BundleSummary solve_schur(SchurProblem& problem, const BundleOptions& options, const Interruption& stop,
                          std::vector<std::uint8_t>* outlier) {
  return SchurSolver(problem, options, stop).run(outlier);
}

}  // namespace parallax::solver
