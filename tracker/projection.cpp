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
  Candidate candidate;
  for (int row = 0; row < n; ++row) {
    if (in_view_[row] && project_one(map, row, camera_from_world, &candidate)) out->push_back(candidate);
  }
}

void choose_spread(const std::vector<Candidate>& candidates, const TrackingSnapshot& map, int width, int height,
                   int max_count, std::vector<int>* chosen) {
  const int n = static_cast<int>(candidates.size());
  chosen->clear();
  if (n <= max_count) {
    for (int i = 0; i < n; ++i) chosen->push_back(i);
    return;
  }
  constexpr int kColumns = 12, kRows = 9;
  std::array<int, kColumns * kRows> count{};
  struct Entry {
    std::uint32_t order;
    int index;
    int cell;
  };
  thread_local std::vector<Entry> entries;
  entries.resize(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    const Candidate& c = candidates[i];
    const int cx = std::clamp(static_cast<int>(c.pixel.x() * kColumns / width), 0, kColumns - 1);
    const int cy = std::clamp(static_cast<int>(c.pixel.y() * kRows / height), 0, kRows - 1);
    // Well-measured points first (in coarse classes), then a fixed scrambled order.
    const std::uint32_t unknown = map.quality[c.row] >= 3 ? 0u : 1u;
    entries[i] = {(unknown << 31) | (scramble(static_cast<std::uint32_t>(map.id[c.row].index)) >> 1), i, cy * kColumns + cx};
  }
  std::sort(entries.begin(), entries.end(), [](const Entry& l, const Entry& r) { return l.order < r.order; });
  // Rank within the cell; the lowest ranks over all cells are taken.
  std::vector<int> of_rank;
  thread_local std::vector<int> rank;
  rank.resize(static_cast<std::size_t>(n));
  for (int k = 0; k < n; ++k) {
    rank[k] = count[entries[k].cell]++;
    if (rank[k] >= static_cast<int>(of_rank.size())) of_rank.resize(static_cast<std::size_t>(rank[k]) + 1, 0);
    ++of_rank[rank[k]];
  }
  int limit = 0, taken = 0;
  while (limit < static_cast<int>(of_rank.size()) && taken + of_rank[limit] <= max_count) taken += of_rank[limit++];
  int left = max_count - taken;
  for (int k = 0; k < n; ++k) {
    if (rank[k] < limit || (rank[k] == limit && left-- > 0)) chosen->push_back(entries[k].index);
  }
  std::sort(chosen->begin(), chosen->end());
}

}  // namespace parallax
