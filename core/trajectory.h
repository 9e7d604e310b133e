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
// state_groundtruth_estimate0/data.csv or poses.txt is given). Throws InputError naming file and line. Sorted by time;
// of equal times the first stays. Of a folder in EuRoC layout these are the poses of camera 0 (its T_BS applied), of
// one in KITTI layout the times are those of times.txt, where it is there. A file is read as it stands.
Trajectory read_trajectory(const std::string& path, TrajectoryFormat* found = nullptr);
Trajectory parse_trajectory(const std::string& text, const std::string& name, TrajectoryFormat* found = nullptr);

// Written beside and renamed; throws RunError. TUM: 9 decimals for time and values. KITTI: 9 decimals, no times.
// EuRoC: 9 decimals, a header line, position and quaternion only.
void write_trajectory_tum(const Trajectory& trajectory, const std::string& path);
void write_trajectory_kitti(const Trajectory& trajectory, const std::string& path);
void write_trajectory_euroc(const Trajectory& trajectory, const std::string& path);
void write_trajectory(const Trajectory& trajectory, TrajectoryFormat format, const std::string& path);

// T_BS of a EuRoC sensor.yaml: body_from_sensor. Throws InputError when it is missing or no rigid transform.
RigidTransform parse_euroc_body_from_sensor(const std::string& text, const std::string& name);

}  // namespace parallax
