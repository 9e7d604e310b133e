// Projection of the whole map into a frame (PTAM §5.2, §7.1 "feature projection"): a vectorised cull of all points,
// then projection, Jacobian, warp and target level of those that may be visible.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "core/camera_model.h"
#include "map/tracking_snapshot.h"

namespace parallax {

// A point that should be visible, and how.
struct Candidate {
  std::int32_t row = 0;                             // in the snapshot
  std::int8_t level = 0;                            // pyramid level to search
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // predicted, level 0
  Eigen::Matrix2d warp = Eigen::Matrix2d::Zero();   // A of Eq. 7
};

// Not thread-safe: keeps its scratch arrays between frames. Belongs to the tracking thread.
class MapProjector {
 public:
  // Of the points in view, at most `max_candidates` become candidates: several times what is searched.
  MapProjector(const CameraModel& camera, double min_view_cosine, int max_candidates = 3000)
      : camera_(camera), min_view_cosine_(min_view_cosine), max_candidates_(max_candidates) {}

  // Fills `out` with the points of the snapshot visible from the pose, in order of row. Of more than max_candidates,
  // those are projected that choose_spread() would take by their places alone: the cost of a frame hardly grows with
  // the map.
  void project(const TrackingSnapshot& map, const RigidTransform& camera_from_world, std::vector<Candidate>* out);

  // The same for one point; false when it is not visible.
  bool project_one(const TrackingSnapshot& map, int row, const RigidTransform& camera_from_world, Candidate* out) const;

 private:
  void thin_out(const TrackingSnapshot& map, const float* R, const float* t);

  CameraModel camera_;
  double min_view_cosine_;
  int max_candidates_;
  std::vector<std::uint8_t> in_view_, cell_;
  std::vector<int> rows_;
  std::vector<float> x_, y_, z_, u_, v_;
};

// From all candidates, at most `max_count`: spread evenly over the image by a grid; within a cell the order is a fixed
// pseudo-random one of the points, so that the same points are chosen from frame to frame. `chosen` holds indices into
// `candidates`, ascending.
void choose_spread(const std::vector<Candidate>& candidates, const TrackingSnapshot& map, int width, int height,
                   int max_count, std::vector<int>* chosen);

}  // namespace parallax
