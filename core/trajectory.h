// Trajectories and their files: TUM (t tx ty tz qx qy qz qw), KITTI (3x4 row-major matrices, one a line) and EuRoC
// (csv, ns, position, quaternion w first). Poses are camera to world.
#pragma once

#include <string>
#include <vector>

#include "core/se3.h"
#include "core/time.h"

namespace parallax {

struct TrajectoryPose {
  Timestamp time{0};  // KITTI files carry none: the line number in seconds
  RigidTransform world_from_camera;
};
using Trajectory = std::vector<TrajectoryPose>;

enum class TrajectoryFormat { tum, kitti, euroc };

// Reads any of the three, told apart by content (or by the layout when a folder with groundtruth.txt,
// state_groundtruth_estimate0/data.csv or poses.txt is given). Throws InputError naming file and line. Sorted by time; of equal times the first stays.
Trajectory read_trajectory(const std::string& path, TrajectoryFormat* found = nullptr);
Trajectory parse_trajectory(const std::string& text, const std::string& name, TrajectoryFormat* found = nullptr);

// Written beside and renamed; throws RunError. TUM: 9 decimals for time and values.
void write_trajectory_tum(const Trajectory& trajectory, const std::string& path);

}  // namespace parallax
