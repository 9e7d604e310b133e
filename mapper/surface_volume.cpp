#include "mapper/surface_volume.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace parallax {
namespace {

constexpr int kFull = 32;             // a vote of full weight
constexpr double kSureCells = 1.2;    // so far before or behind a surface a vote has its full weight
constexpr double kBehindCells = 2.0;  // what lies deeper behind it is not seen
constexpr std::uint8_t kMostVotes = 200;
constexpr double kOpen = 0.35;  // mean vote of a box that one can look through
constexpr int kOpenLevels = 4;  // so many of them are a gap under something

}  // namespace

void SurfaceVolume::reset(const SurfaceExtent& extent) {
  extent_ = extent;
  const std::size_t n = static_cast<std::size_t>(extent.columns) * static_cast<std::size_t>(extent.rows) *
                        static_cast<std::size_t>(extent.levels);
  sure_sum_.assign(n, 0);
  guessed_sum_.assign(n, 0);
  sure_votes_.assign(n, 0);
  guessed_votes_.assign(n, 0);
}

void SurfaceVolume::vote(int row, const SurfaceCamera& camera, const RigidTransform& camera_from_plane,
                         const cv::Mat1f& depth, const cv::Mat1b& sure) {
  const double cell = extent_.cell_m, f = camera.focal_px();
  const Eigen::Vector3d up = cell * camera_from_plane.R.col(2);
  const Eigen::Vector2d centre = camera.centre_px();
  const double full = kSureCells * cell, behind = -kBehindCells * cell;
  for (int column = 0; column < extent_.columns; ++column) {
    const Eigen::Vector3d place(extent_.corner_m.x() + (column + 0.5) * cell, extent_.corner_m.y() + (row + 0.5) * cell,
                                level_height(0));
    Eigen::Vector3d p = camera_from_plane * place;
    const std::size_t base = index(column, row);
    for (int level = 0; level < extent_.levels; ++level, p += up) {
      if (!(p.z() > 0.02)) continue;
      const double inverse = 1 / p.z();
      const int x = static_cast<int>(std::floor(f * p.x() * inverse + centre.x() + 0.5));
      const int y = static_cast<int>(std::floor(f * p.y() * inverse + centre.y() + 0.5));
      if (x < 0 || y < 0 || x >= depth.cols || y >= depth.rows) continue;
      const double d = depth(y, x);
      if (!(d > 0)) continue;
      // Along the line of sight.
      const double before = (d - p.z()) * std::sqrt(1 + (p.x() * p.x() + p.y() * p.y()) * inverse * inverse);
      if (before < behind) continue;
      const std::size_t i = base + static_cast<std::size_t>(level);
      const bool is_sure = sure(y, x) != 0;
      std::uint8_t& votes = is_sure ? sure_votes_[i] : guessed_votes_[i];
      std::int16_t& sum = is_sure ? sure_sum_[i] : guessed_sum_[i];
      if (votes >= kMostVotes) continue;
      sum = static_cast<std::int16_t>(sum + static_cast<int>(std::clamp(before / full, -1.0, 1.0) * kFull));
      ++votes;
    }
  }
}

void SurfaceVolume::read(int row, int least_votes, float* height_m, std::uint64_t* filled, std::uint8_t* known) const {
  for (int column = 0; column < extent_.columns; ++column) {
    const std::size_t base = index(column, row);
    height_m[column] = 0;
    filled[column] = 0;
    known[column] = 0;
    double over = 1;  // the value of the lowest empty box met so far, coming from above
    int over_at = extent_.levels;
    int top = -1, lowest_sure = -1, open = 0;  // of the thing that this is in; top < 0: in none
    double top_m = 0;
    const auto fill = [&](int bottom) {
      if (!filled[column]) height_m[column] = std::max(0.0f, static_cast<float>(top_m));
      for (int level = std::max(bottom, kBelow); level <= top; ++level)
        filled[column] |= std::uint64_t{1} << (level - kBelow);
    };
    for (int level = extent_.levels - 1; level >= 0; --level) {
      const std::size_t i = base + static_cast<std::size_t>(level);
      const bool sure = sure_votes_[i] >= least_votes;
      if (!sure && guessed_votes_[i] < least_votes) continue;
      known[column] = 1;
      const double value = sure ? static_cast<double>(sure_sum_[i]) / (kFull * sure_votes_[i])
                                : static_cast<double>(guessed_sum_[i]) / (kFull * guessed_votes_[i]);
      if (top < 0) {
        if (value >= 0) {
          over = value;
          over_at = level;
          continue;
        }
        top = level;
        lowest_sure = -1;
        open = 0;
        top_m = level_height(level) + (over_at - level < 2 ? value / (value - over) : 0.5) * extent_.cell_m;
      }
      if (sure && value < 0) lowest_sure = level;
      open = sure && value > kOpen ? open + 1 : 0;
      if (open < kOpenLevels) continue;
      // One looks through under it: it ends where it was last seen for sure; if nowhere, it is not there.
      if (lowest_sure >= 0) fill(lowest_sure);
      top = -1;
      over = value;
      over_at = level;
    }
    if (top >= 0) fill(kBelow);
  }
}

namespace {

// Of three by three words, bit by bit: those set in most of them, in any, in all. Beyond the rim nothing is set.
template <typename Combine>
void filter_bits(int columns, int rows, std::vector<std::uint64_t>* bits, const Combine& combine) {
  const std::vector<std::uint64_t> from = *bits;
  std::array<std::uint64_t, 9> near;
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      std::size_t n = 0;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const bool in = y + dy >= 0 && y + dy < rows && x + dx >= 0 && x + dx < columns;
          near[n++] = in ? from[static_cast<std::size_t>(y + dy) * static_cast<std::size_t>(columns) +
                                static_cast<std::size_t>(x + dx)]
                         : 0;
        }
      }
      (*bits)[static_cast<std::size_t>(y) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(x)] =
          combine(near);
    }
  }
}

std::uint64_t most_of(const std::array<std::uint64_t, 9>& words) {
  std::uint64_t one = 0, two = 0, four = 0, eight = 0;  // digits of the counts
  for (std::uint64_t carry : words) {
    for (std::uint64_t* digit : {&one, &two, &four, &eight}) {
      const std::uint64_t next = *digit & carry;
      *digit ^= carry;
      carry = next;
    }
  }
  return eight | (four & (one | two));  // five and more
}
std::uint64_t any_of(const std::array<std::uint64_t, 9>& words) {
  std::uint64_t out = 0;
  for (const std::uint64_t word : words) out |= word;
  return out;
}
std::uint64_t all_of(const std::array<std::uint64_t, 9>& words) {
  std::uint64_t out = ~std::uint64_t{0};
  for (const std::uint64_t word : words) out &= word;
  return out;
}

}  // namespace

void clean_surface(double least_height_m, int least_cells, SceneSurface* surface) {
  if (surface->empty()) return;
  filter_bits(surface->columns, surface->rows, &surface->filled, most_of);
  // Holes of a cell or two in things that stand there.
  filter_bits(surface->columns, surface->rows, &surface->filled, any_of);
  filter_bits(surface->columns, surface->rows, &surface->filled, all_of);
  cv::Mat1f heights(surface->rows, surface->columns, surface->height_m.data());
  cv::Mat1f middle;
  cv::medianBlur(heights, middle, 3);
  for (int y = 0; y < heights.rows; ++y) {
    for (int x = 0; x < heights.cols; ++x) {
      // Within half a box of the top of the highest that is filled.
      const std::uint64_t filled = surface->filled[surface->index(x, y)];
      const double top = surface->cell_m * std::bit_width(filled), half = 0.5 * surface->cell_m;
      heights(y, x) = filled ? static_cast<float>(std::clamp<double>(middle(y, x), top - half, top + half)) : 0.0f;
    }
  }
  cv::Mat1b stands;
  cv::compare(heights, least_height_m, stands, cv::CMP_GE);
  cv::Mat1i label, box;
  cv::Mat1d centre;
  const int n = cv::connectedComponentsWithStats(stands, label, box, centre, 4);
  for (int y = 0; y < heights.rows; ++y) {
    for (int x = 0; x < heights.cols; ++x) {
      const int island = label(y, x);
      if (island != 0 && island < n && box(island, cv::CC_STAT_AREA) >= least_cells) continue;
      heights(y, x) = 0;
      surface->filled[surface->index(x, y)] = 0;
    }
  }
}

}  // namespace parallax
