#include "mapper/surface_volume.h"

#include <algorithm>
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
  sum_.assign(n, 0);
  votes_.assign(n, 0);
}

void SurfaceVolume::vote(int row, const SurfaceCamera& camera, const RigidTransform& camera_from_plane,
                         const cv::Mat1f& depth) {
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
      if (votes_[i] >= kMostVotes) continue;
      sum_[i] = static_cast<std::int16_t>(sum_[i] + static_cast<int>(std::clamp(before / full, -1.0, 1.0) * kFull));
      ++votes_[i];
    }
  }
}

void SurfaceVolume::read(int row, int least_votes, float* height_m, float* underside_m, std::uint8_t* known) const {
  for (int column = 0; column < extent_.columns; ++column) {
    const std::size_t base = index(column, row);
    height_m[column] = 0;
    underside_m[column] = 0;
    known[column] = 0;
    double over = 1, over_at = extent_.levels;  // the value of the lowest empty box met so far, coming from above
    for (int level = extent_.levels - 1; level >= 0; --level) {
      const std::size_t i = base + static_cast<std::size_t>(level);
      if (votes_[i] < least_votes) continue;
      known[column] = 1;
      const double value = static_cast<double>(sum_[i]) / (kFull * votes_[i]);
      if (value >= 0) {
        over = value;
        over_at = level;
        continue;
      }
      const double share = over_at - level < 1.5 ? value / (value - over) : 0.5;
      height_m[column] = std::max(0.0f, static_cast<float>(level_height(level) + share * extent_.cell_m));
      underside_m[column] = static_cast<float>(underside(base, level, least_votes));
      break;
    }
  }
}

// Below something at this level: where enough boxes in a row were looked through; 0 when there is no such place.
double SurfaceVolume::underside(std::size_t base, int level, int least_votes) const {
  int open = 0;
  for (int below = level - 1; below >= kBelow; --below) {
    const std::size_t i = base + static_cast<std::size_t>(below);
    const bool empty = votes_[i] >= least_votes && sum_[i] > kOpen * kFull * votes_[i];
    open = empty ? open + 1 : 0;
    if (open < kOpenLevels) continue;
    // What nobody saw between the gap and the first sign of a surface over it belongs to the gap.
    int over = below + kOpenLevels;
    while (over < level && !(votes_[base + static_cast<std::size_t>(over)] >= least_votes &&
                             sum_[base + static_cast<std::size_t>(over)] < 0))
      ++over;
    return level_height(over) - 0.5 * extent_.cell_m;
  }
  return 0;
}

void clean_heights(double least_height_m, int least_cells, SceneSurface* surface) {
  if (surface->empty()) return;
  cv::Mat1f heights(surface->rows, surface->columns, surface->height_m.data());
  cv::Mat1f middle;
  cv::medianBlur(heights, middle, 3);
  middle.copyTo(heights);
  // Holes of a cell or two in things that stand there.
  cv::Mat1f closed;
  cv::morphologyEx(heights, closed, cv::MORPH_CLOSE, cv::Mat1b::ones(3, 3));
  closed.copyTo(heights);
  cv::Mat1b stands;
  cv::compare(heights, least_height_m, stands, cv::CMP_GE);
  cv::Mat1i label, box;
  cv::Mat1d centre;
  const int n = cv::connectedComponentsWithStats(stands, label, box, centre, 4);
  for (int y = 0; y < heights.rows; ++y) {
    for (int x = 0; x < heights.cols; ++x) {
      const int island = label(y, x);
      if (island == 0 || (island < n && box(island, cv::CC_STAT_AREA) < least_cells)) heights(y, x) = 0;
      if (!surface->underside_m.empty()) {
        float& underside = surface->underside_m[surface->index(x, y)];
        if (underside > 0.8f * heights(y, x)) underside = 0;
      }
    }
  }
}

}  // namespace parallax
