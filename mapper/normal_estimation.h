// Patch normals estimated online (where PTAM §6.5 and §8.2 say it is weak). A point starts with a normal towards its
// source camera; once enough keyframes see it from elsewhere, other normals are tried: a plane through its neighbours
// in space, the dominant plane's, and what Gauss-Newton makes of the best of them (mapper/patch_slope). The one whose
// warped patch agrees best with what the other keyframes show is taken when it is clearly better than the present one.
#pragma once

#include <vector>

#include "core/camera_model.h"
#include "core/interruption.h"
#include "map/shared_map.h"

namespace parallax {

struct NormalEstimationOptions {
  int min_observers = 3;          // with the source
  double min_angle_deg = 5;       // between the rays of the source and of a view that is used
  int max_views = 4;              // used for a point
  double regrown = 1.5;           // looked at again when the observers have grown by this factor
  double min_improvement = 0.03;  // of the part of the views' contrast that stays unexplained
  double max_unexplained = 0.35;  // of the accepted normal: above it the patch is no plane
  double min_cosine = 0.2;        // of the normal to the ray of the source: no steeper
  double prior_sigma = 1.0;       // standard deviation of the tangent of the angle to the starting normal
  double max_sigma = 0.35;        // of the photometric slope, in units of the prior: less certain is not tried
};

// Remembers at how many observers each point was looked at last. Not thread-safe; belongs to the mapping thread.
class NormalEstimation {
 public:
  explicit NormalEstimation(const CameraModel& camera, const NormalEstimationOptions& options = {})
      : camera_(camera), options_(options) {}

  // The map was replaced.
  void clear() { tried_.clear(); }

  // Looks at the points that have enough observers and were not looked at since those grew by the factor. Sets normals
  // and normal_estimated; returns the points whose normal changed. Stops within a fraction of a millisecond when asked;
  // what is left is done the next time. Extracts and commits a source keyframe at a time. The caller publishes.
  std::vector<PointId> estimate(SharedMap* map, const Interruption& stop);

 private:
  CameraModel camera_;
  NormalEstimationOptions options_;
  std::vector<int> tried_;  // observers, by index of the point
};

// The same once, on points without an estimated normal. Returns how many normals were changed.
int estimate_normals(SharedMap* map, const CameraModel& camera, const Interruption& stop);

}  // namespace parallax
