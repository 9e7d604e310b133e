// Writes coloured points for other programs: PLY for point cloud tools, binary glTF 2.0 (.glb) for anything that shows
// models. Whole or not at all.
#pragma once

#include <string>
#include <vector>

#include "core/point_cloud.h"

namespace parallax {

// Binary little-endian: float x y z (world, metres), uchar red green blue, float sigma (metres). Throws RunError.
void write_cloud_ply(const std::vector<ColouredPoint>& points, const std::string& path);

// One POINTS primitive with POSITION and COLOR_0 (linear, as glTF wants it), unlit. glTF has y up: points are turned so
// that `up` (of the world, unit length) is that. Throws RunError when it cannot be written, or there are no points
// (glTF knows no empty mesh).
void write_cloud_glb(const std::vector<ColouredPoint>& points, const Eigen::Vector3d& up, const std::string& path);

}  // namespace parallax
