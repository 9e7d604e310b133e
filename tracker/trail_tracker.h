// 2D patch tracks for initialisation (PTAM §6.1): patches at salient corners of a first frame, followed from frame to
// frame and checked backwards.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "core/fast.h"
#include "core/image.h"

namespace parallax {

struct TrailOptions {
  int max_trails = 1000;           // PTAM §6.1
  double min_distance_px = 6;      // between starting corners, level 0
  double max_back_error_px = 1.0;  // forward-backward check, level 0
  double search_radius_px = 40;    // reach of the coarsest level, level-0 pixels a frame
};

struct Trail {
  Eigen::Vector2d first = Eigen::Vector2d::Zero();    // level-0 pixels in the first frame
  Eigen::Vector2d current = Eigen::Vector2d::Zero();  // in the last frame seen
  int id = 0;                                         // index at the start; survives the loss of others
};

// Not thread-safe; belongs to the tracking thread.
class TrailTracker {
 public:
  explicit TrailTracker(const TrailOptions& options = {});

  // Starts anew with the corners of this frame: maximal FAST corners of level 0 (and of level 1 where level 0 has too
  // few), best Shi-Tomasi scores first, spread over the image. The pyramid is kept by reference count.
  void start(std::shared_ptr<const ImagePyramid> pyramid, const CornerList& level0_corners);

  // Follows all trails into the next frame; those that cannot be followed, or whose backward track does not return, are
  // dropped. `predicted_rotation_shift`: expected mean image motion, level-0 pixels (from the small blurry images).
  void track(std::shared_ptr<const ImagePyramid> pyramid, const Eigen::Vector2d& predicted_shift);

  bool active() const { return first_ != nullptr; }
  void clear();
  const std::vector<Trail>& trails() const { return trails_; }
  int started() const { return started_; }

  // The trails refined at the end: each patch of the *first* frame is aligned (affine or translation, sub-pixel)
  // directly with the current frame, so that drift does not add up; those that disagree with their track by more than a
  // few pixels or look different are left out. Use this for the matches given to two-view initialisation.
  std::vector<Trail> refined() const;

 private:
  TrailOptions options_;
  std::shared_ptr<const ImagePyramid> first_, last_;
  std::vector<Trail> trails_;
  int started_ = 0;
};

}  // namespace parallax
