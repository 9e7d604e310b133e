// Depths of many keyframes become one grid of heights: each is a vote, in small boxes of space over the plane, for
// being before or behind a surface (a truncated signed distance, Curless and Levoy 1996), so that what one keyframe
// takes for something and others look through is carved away. Frames: the plane's, z up, metres. Not thread-safe.
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "core/se3.h"
#include "map/scene_surface.h"
#include "mapper/surface_stereo.h"

namespace parallax {

// Where the votes are counted. Memory: six bytes a box.
struct SurfaceExtent {
  int columns = 0, rows = 0, levels = 0;
  double cell_m = 0;  // side of a box
  Eigen::Vector2d corner_m = Eigen::Vector2d::Zero();
  friend bool operator==(const SurfaceExtent&, const SurfaceExtent&) = default;
};

class SurfaceVolume {
 public:
  // Empty, for this place.
  void reset(const SurfaceExtent& extent);
  const SurfaceExtent& extent() const { return extent_; }

  // One row of the grid is voted on by one keyframe's depth along z (0: not known), and where that is sure (not 0).
  void vote(int row, const SurfaceCamera& camera, const RigidTransform& camera_from_plane, const cv::Mat1f& depth,
            const cv::Mat1b& sure);

  // One row of the result, before cleaning: heights over the plane, what is filled under them (as in SceneSurface), and
  // whether anything was seen there. Boxes that fewer than `least_votes` keyframes saw say nothing.
  void read(int row, int least_votes, float* height_m, std::uint64_t* filled, std::uint8_t* known) const;

  static constexpr int kBelow = 3;                 // levels under the plane
  static constexpr int kMostLevels = 64 + kBelow;  // what SceneSurface has room for

 private:
  std::size_t index(int column, int row) const {
    return (static_cast<std::size_t>(row) * static_cast<std::size_t>(extent_.columns) +
            static_cast<std::size_t>(column)) *
           static_cast<std::size_t>(extent_.levels);
  }
  double level_height(int level) const { return (level - kBelow + 0.5) * extent_.cell_m; }

  SurfaceExtent extent_;
  // Row, column, level; of pixels that matched at one depth only, and of those that are only as their neighbours.
  std::vector<std::int16_t> sure_sum_, guessed_sum_;  // of votes between -1 (behind) and 1 (before)
  std::vector<std::uint8_t> sure_votes_, guessed_votes_;
};

// Takes off what cannot be: single cells unlike their neighbours, low noise under `least_height_m`, islands of fewer
// than `least_cells`; fills small holes in things.
void clean_surface(double least_height_m, int least_cells, SceneSurface* surface);

}  // namespace parallax
