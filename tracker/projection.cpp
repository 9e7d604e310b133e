#include "tracker/projection.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "map/source_patch.h"

namespace parallax {
namespace {

// A patch whose search template would leave the image cannot be found: half a patch at its level.
constexpr double kHalfPatch = 4.0;

#if defined(__x86_64__) && !defined(__SANITIZE_THREAD__) && defined(__GNUC__) && !defined(__clang__)
#define PARALLAX_CLONES __attribute__((target_clones("default", "avx2", "avx512f")))
#else
#define PARALLAX_CLONES
#endif

struct CullArguments {
  float R[9], t[3], c[3];
  float max_radius2, min_cosine2;
};

// 1 where the point is in front, inside the visible cone, and its patch is seen from the front.
PARALLAX_CLONES void cull(const float* x, const float* y, const float* z, const float* nx, const float* ny,
                          const float* nz, int n, CullArguments a, std::uint8_t* in_view) {
  for (int i = 0; i < n; ++i) {
    const float cx = a.R[0] * x[i] + a.R[1] * y[i] + a.R[2] * z[i] + a.t[0];
    const float cy = a.R[3] * x[i] + a.R[4] * y[i] + a.R[5] * z[i] + a.t[1];
    const float cz = a.R[6] * x[i] + a.R[7] * y[i] + a.R[8] * z[i] + a.t[2];
    const float vx = a.c[0] - x[i], vy = a.c[1] - y[i], vz = a.c[2] - z[i];
    const float facing = nx[i] * vx + ny[i] * vy + nz[i] * vz;
    const float distance2 = vx * vx + vy * vy + vz * vz;
    const bool in_cone = cz > 0.0f && cx * cx + cy * cy <= a.max_radius2 * cz * cz;
    const bool faces = facing > 0.0f && facing * facing >= a.min_cosine2 * distance2;
    in_view[i] = static_cast<std::uint8_t>(in_cone & faces);
  }
}

std::uint32_t scramble(std::uint32_t v) {
  v ^= v >> 16;
  v *= 0x7feb352dU;
  v ^= v >> 15;
  v *= 0x846ca68bU;
  return v ^ (v >> 16);
}

// The grid that choices are spread over.
constexpr int kColumns = 12, kRows = 9, kCells = kColumns * kRows;

int cell_of(double u, double v, int width, int height) {
  const int cx = std::clamp(static_cast<int>(u * kColumns / width), 0, kColumns - 1);
  const int cy = std::clamp(static_cast<int>(v * kRows / height), 0, kRows - 1);
  return cy * kColumns + cx;
}

// Well-measured points first (in coarse classes), then a fixed scrambled order.
std::uint32_t order_of(const TrackingSnapshot& map, int row) {
  const std::uint32_t unknown = map.quality[row] >= 3 ? 0u : 1u;
  return (unknown << 31) | (scramble(static_cast<std::uint32_t>(map.id[row].index)) >> 1);
}

struct Entry {
  std::uint32_t order;
  int index;
  bool operator<(const Entry& other) const { return order != other.order ? order < other.order : index < other.index; }
};

// The indices of `max_count` of the entries, ascending: every cell gives its first in order before any gives its
// second. cell[i] belongs to entry i. Only as much is sorted as decides.
void share_out(const std::vector<Entry>& entries, const std::vector<std::uint8_t>& cell, int max_count,
               std::vector<int>* chosen) {
  chosen->clear();
  std::array<int, kCells + 1> begin{};
  for (std::uint8_t c : cell) ++begin[c + 1];
  // How many a cell may give: the largest number with which all together give no more than max_count.
  std::array<int, kCells> size{};
  for (int c = 0; c < kCells; ++c) size[c] = begin[c + 1];
  const auto given = [&](int limit) {
    int sum = 0;
    for (int n : size) sum += std::min(n, limit);
    return sum;
  };
  int limit = 0, too_many = static_cast<int>(entries.size()) + 1;
  while (too_many - limit > 1) {
    const int middle = limit + (too_many - limit) / 2;
    (given(middle) <= max_count ? limit : too_many) = middle;
  }
  for (int c = 0; c < kCells; ++c) begin[c + 1] += begin[c];
  thread_local std::vector<Entry> of_cell, next;
  of_cell.resize(entries.size());
  std::array<int, kCells> fill{};
  for (std::size_t i = 0; i < entries.size(); ++i) of_cell[begin[cell[i]] + fill[cell[i]]++] = entries[i];
  next.clear();
  for (int c = 0; c < kCells; ++c) {
    const auto first = of_cell.begin() + begin[c], last = of_cell.begin() + begin[c + 1];
    const auto end = first + std::min(size[c], limit);
    if (end != last) {
      std::nth_element(first, end, last);
      next.push_back(*end);  // the one that this cell would give next
    }
    for (auto it = first; it != end; ++it) chosen->push_back(it->index);
  }
  const auto left = std::min(next.size(), static_cast<std::size_t>(max_count) - chosen->size());
  std::sort(next.begin(), next.end());
  for (std::size_t k = 0; k < left; ++k) chosen->push_back(next[k].index);
  std::sort(chosen->begin(), chosen->end());
}

}  // namespace

bool MapProjector::project_one(const TrackingSnapshot& map, int row, const RigidTransform& camera_from_world,
                               Candidate* out) const {
  const Eigen::Vector3d p = camera_from_world * map.position[row];
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> jacobian;
  if (!camera_.project(p, &pixel, &jacobian)) return false;
  if (!camera_.in_image(pixel, kHalfPatch)) return false;
  const Eigen::Matrix2d A = warp_matrix(jacobian, camera_from_world.R, map.axes[row].cast<double>());
  const int level = target_level(A.determinant());
  if (level < 0 || !camera_.in_image(pixel, kHalfPatch * level_scale(level))) return false;
  out->row = row;
  out->level = static_cast<std::int8_t>(level);
  out->pixel = pixel;
  out->warp = A;
  return true;
}

void MapProjector::project(const TrackingSnapshot& map, const RigidTransform& camera_from_world,
                           std::vector<Candidate>* out) {
  out->clear();
  const int n = map.size();
  in_view_.resize(static_cast<std::size_t>(n));
  CullArguments a;
  const Eigen::Vector3d centre = camera_from_world.inverse().t;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) a.R[3 * r + c] = static_cast<float>(camera_from_world.R(r, c));
    a.t[r] = static_cast<float>(camera_from_world.t(r));
    a.c[r] = static_cast<float>(centre(r));
  }
  a.max_radius2 = static_cast<float>(camera_.max_radius_squared());
  a.min_cosine2 = static_cast<float>(min_view_cosine_ * min_view_cosine_);
  cull(map.x.data(), map.y.data(), map.z.data(), map.nx.data(), map.ny.data(), map.nz.data(), n, a, in_view_.data());
  rows_.clear();
  for (int row = 0; row < n; ++row)
    if (in_view_[row]) rows_.push_back(row);
  if (static_cast<int>(rows_.size()) > max_candidates_) thin_out(map, a.R, a.t);
  Candidate candidate;
  for (int row : rows_) {
    if (project_one(map, row, camera_from_world, &candidate)) out->push_back(candidate);
  }
}

// In single precision; what is near the border stays, for project_one() to decide.
void MapProjector::thin_out(const TrackingSnapshot& map, const float* R, const float* t) {
  constexpr float kNearBorder = static_cast<float>(kHalfPatch) - 0.1f;
  const std::size_t n = rows_.size();
  for (auto* v : {&x_, &y_, &z_, &u_, &v_}) v->resize(n);
  in_view_.resize(std::max(in_view_.size(), n));
  for (std::size_t i = 0; i < n; ++i) {
    const int row = rows_[i];
    const float x = map.x[row], y = map.y[row], z = map.z[row];
    x_[i] = R[0] * x + R[1] * y + R[2] * z + t[0];
    y_[i] = R[3] * x + R[4] * y + R[5] * z + t[1];
    z_[i] = R[6] * x + R[7] * y + R[8] * z + t[2];
  }
  camera_.project_batch(x_.data(), y_.data(), z_.data(), static_cast<int>(n), kNearBorder, u_.data(), v_.data(),
                        in_view_.data());
  thread_local std::vector<Entry> entries;
  entries.clear();
  cell_.clear();
  for (std::size_t i = 0; i < n; ++i) {
    if (!in_view_[i]) continue;
    entries.push_back({order_of(map, rows_[i]), rows_[i]});
    cell_.push_back(static_cast<std::uint8_t>(
        cell_of(static_cast<double>(u_[i]), static_cast<double>(v_[i]), camera_.width(), camera_.height())));
  }
  share_out(entries, cell_, max_candidates_, &rows_);
}

void choose_spread(const std::vector<Candidate>& candidates, const TrackingSnapshot& map, int width, int height,
                   int max_count, std::vector<int>* chosen) {
  const int n = static_cast<int>(candidates.size());
  chosen->clear();
  if (n <= max_count) {
    for (int i = 0; i < n; ++i) chosen->push_back(i);
    return;
  }
  if (max_count <= 0) return;
  thread_local std::vector<Entry> entries;
  thread_local std::vector<std::uint8_t> cell;
  entries.clear();
  cell.clear();
  for (int i = 0; i < n; ++i) {
    const Candidate& c = candidates[i];
    entries.push_back({order_of(map, c.row), i});
    cell.push_back(static_cast<std::uint8_t>(cell_of(c.pixel.x(), c.pixel.y(), width, height)));
  }
  share_out(entries, cell, max_count, chosen);
}

}  // namespace parallax
