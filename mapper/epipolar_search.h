// Epipolar search (PTAM §6.2): gives a salient point of a new keyframe its depth from a second view. Corners of the
// second view near the epipolar line, within the range of likely depths, are compared by zero-mean SSD; the best is
// aligned to sub-pixel accuracy and triangulated.
#pragma once

#include <optional>
#include <vector>

#include "core/camera_model.h"
#include "map/entities.h"
#include "mapper/mapper_options.h"
#include "mapper/salient_points.h"

namespace parallax {

// A keyframe as the search needs it: copied out of the map, so that nothing is held while it runs.
struct SearchView {
  KeyframeId id;
  RigidTransform camera_from_world;
  std::shared_ptr<const FrameImages> images;
  double mean_depth = 1, depth_sigma = 1;
  double min_depth = 0.1, max_depth = 10;  // the range of its measured points' depths, with a margin
};

struct NewPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // world
  int level = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // in the new keyframe, pixels of `level`
  Measurement other;                                // in the second view (without point id)
};

// Holds what is computed once a view pair. Not thread-safe.
class EpipolarSearch {
 public:
  EpipolarSearch(const CameraModel& camera, const MapperOptions& options, const SearchView& view,
                 const SearchView& second);

  std::optional<NewPoint> find(const SalientPoint& candidate) const;

 private:
  struct CornerRays {
    std::vector<float> x, y;  // on z = 1 of the second camera; NaN where there is no ray
  };

  CameraModel camera_;
  MapperOptions options_;
  SearchView view_, second_;
  RigidTransform second_from_view_;
  std::array<CornerRays, kPyramidLevels> rays_;
};

}  // namespace parallax
