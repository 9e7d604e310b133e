// The depth of the real things in the camera's present image, from what the map knows to stand on the plane: for
// DrawList::occlusion_depth, so that they hide what is virtual and behind them (PTAM §8.2). Outlines are pulled to the
// image's own edges (render/occlusion_edges.h).
//
// Frames: camera; depth along its z, metres. A few milliseconds of one thread. Not thread-safe.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "core/camera_model.h"
#include "core/image.h"
#include "core/se3.h"
#include "map/scene_surface.h"
#include "render/occlusion_edges.h"

namespace parallax {

struct OcclusionMaskOptions {
  int width = 320;             // of the depth image; its height follows from the camera's
  OcclusionEdgeOptions edges;  // reach in pixels of the depth image
  void validate() const;       // throws InputError
};

class OcclusionMask {
 public:
  explicit OcclusionMask(const CameraModel& camera, const OcclusionMaskOptions& options = {});

  // The depth image: 0 where nothing stands on the plane. `image` is the camera's, at any pyramid level; empty:
  // outlines stay where the map has them. Shares no memory with what it gave before.
  cv::Mat1f update(const SceneSurface& surface, const RigidTransform& camera_from_world, const GreyImage& image);

 private:
  void note(const SceneSurface& surface);
  double meet(const SceneSurface& surface, const Eigen::Vector3d& from, const Eigen::Vector3d& along) const;
  void align(const RigidTransform& plane_from_camera, const GreyImage& image, cv::Mat1f* depth) const;

  OcclusionMaskOptions options_;
  int rows_ = 0;
  std::vector<Eigen::Vector3d> rays_;  // z = 1; z = 0: none
  // The highest of every block of cells, for the surface noted.
  const float* noted_ = nullptr;
  std::uint64_t noted_version_ = 0;
  int block_columns_ = 0, block_rows_ = 0;
  std::vector<float> block_height_;
  double highest_ = 0;
};

}  // namespace parallax
