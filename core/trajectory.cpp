#include "core/trajectory.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <ostream>
#include <string_view>

#include "core/error.h"
#include "core/file_io.h"
#include "core/parse_text.h"

namespace parallax {
namespace {

namespace fs = std::filesystem;

constexpr const char* kExpected =
    "expected 8 values (TUM: t tx ty tz qx qy qz qw), 12 (KITTI: a 3x4 matrix) or a comma-separated EuRoC line";

// Rounding to a few decimals is forgiven, another column taken for a quaternion is not.
constexpr double kQuaternionLengthTolerance = 0.1;
constexpr double kRotationTolerance = 0.01;
// A matrix off by more than the seventh decimal is made orthonormal; a better one stays as it was written.
constexpr double kRotationRounding = 1e-5;

struct LineError {
  std::string what;
};

RigidTransform rigid_from_quaternion(const double* xyz, double w, double x, double y, double z) {
  const Eigen::Quaterniond q(w, x, y, z);
  const double length = q.norm();
  if (!(std::abs(length - 1) <= kQuaternionLengthTolerance)) {
    throw LineError{"found a quaternion of length " + std::to_string(length) + ", expected 1"};
  }
  return {q, Eigen::Vector3d(xyz[0], xyz[1], xyz[2])};
}

// Twelve numbers, row-major 3x4.
RigidTransform rigid_from_matrix(const double* m) {
  RigidTransform T;
  T.R << m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10];
  T.t << m[3], m[7], m[11];
  const double off = (T.R.transpose() * T.R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(off <= kRotationTolerance) || T.R.determinant() < 0) {
    throw LineError{"found a matrix that is no rotation, expected a rigid transform"};
  }
  if (off > kRotationRounding) T.orthonormalise();
  return T;
}

template <std::size_t N>
void parse_values(const std::vector<std::string_view>& fields, std::size_t first, double (&values)[N]) {
  for (std::size_t i = 0; i < N; ++i) {
    if (!parse_number(fields[first + i], &values[i])) {
      throw LineError{"found " + in_quotes(fields[first + i]) + " in column " + std::to_string(first + i + 1) +
                      ", expected a finite number"};
    }
  }
}

TrajectoryPose parse_tum(const std::vector<std::string_view>& fields) {
  TrajectoryPose pose;
  if (!parse_seconds(fields[0], &pose.time)) {
    throw LineError{"found " + in_quotes(fields[0]) + " in column 1, expected a time in seconds"};
  }
  double v[7];
  parse_values(fields, 1, v);
  pose.world_from_camera = rigid_from_quaternion(v, v[6], v[3], v[4], v[5]);
  return pose;
}

TrajectoryPose parse_euroc(const std::vector<std::string_view>& fields) {
  TrajectoryPose pose;
  std::int64_t nanoseconds = 0;
  if (!parse_number(fields[0], &nanoseconds)) {
    throw LineError{"found " + in_quotes(fields[0]) + " in column 1, expected a time in whole nanoseconds"};
  }
  pose.time = Timestamp(nanoseconds);
  double v[7];
  parse_values(fields, 1, v);
  pose.world_from_camera = rigid_from_quaternion(v, v[3], v[4], v[5], v[6]);
  return pose;
}

TrajectoryPose parse_kitti(const std::vector<std::string_view>& fields, std::size_t index) {
  TrajectoryPose pose;
  pose.time = Timestamp(std::chrono::seconds(index));
  double v[12];
  parse_values(fields, 0, v);
  pose.world_from_camera = rigid_from_matrix(v);
  return pose;
}

void sort_by_time(Trajectory* trajectory) {
  const auto earlier = [](const TrajectoryPose& a, const TrajectoryPose& b) { return a.time < b.time; };
  if (!std::is_sorted(trajectory->begin(), trajectory->end(), earlier)) {
    std::stable_sort(trajectory->begin(), trajectory->end(), earlier);
  }
  const auto same = [](const TrajectoryPose& a, const TrajectoryPose& b) { return a.time == b.time; };
  trajectory->erase(std::unique(trajectory->begin(), trajectory->end(), same), trajectory->end());
}

void apply_times(const std::string& times_path, Trajectory* trajectory) {
  const std::string text = read_text_file(times_path);
  LineReader lines(text);
  std::string_view line;
  std::size_t i = 0;
  while (i < trajectory->size() && lines.next(&line)) {
    if (line.empty() || line.front() == '#') continue;
    if (!parse_seconds(line, &(*trajectory)[i].time)) {
      throw InputError(times_path + ":" + std::to_string(lines.number()) + ": found " + in_quotes(line) +
                       ", expected a time in seconds");
    }
    ++i;
  }
  if (i < trajectory->size()) {
    throw InputError(times_path + ": found " + std::to_string(i) + " times, expected one for each of the " +
                     std::to_string(trajectory->size()) + " poses");
  }
  sort_by_time(trajectory);
}

Trajectory read_folder(const fs::path& folder, TrajectoryFormat* found) {
  std::error_code error;
  const auto is_file = [&](const fs::path& path) { return fs::is_regular_file(path, error); };
  for (const char* name : {"groundtruth.txt", "groundTruth.txt"}) {
    if (is_file(folder / name)) return read_trajectory((folder / name).string(), found);
  }
  for (const fs::path& mav : {folder, folder / "mav0"}) {
    const fs::path truth = mav / "state_groundtruth_estimate0";
    if (!is_file(truth / "data.csv")) continue;
    Trajectory poses = read_trajectory((truth / "data.csv").string(), found);
    const auto body_from = [&](const fs::path& sensor) {
      if (!is_file(sensor / "sensor.yaml")) return RigidTransform();
      const std::string name = (sensor / "sensor.yaml").string();
      return parse_euroc_body_from_sensor(read_text_file(name), name);
    };
    const RigidTransform truth_from_camera = body_from(truth).inverse() * body_from(mav / "cam0");
    for (auto& pose : poses) pose.world_from_camera = pose.world_from_camera * truth_from_camera;
    return poses;
  }
  if (is_file(folder / "poses.txt")) {
    Trajectory poses = read_trajectory((folder / "poses.txt").string(), found);
    if (is_file(folder / "times.txt")) apply_times((folder / "times.txt").string(), &poses);
    return poses;
  }
  throw InputError(folder.string() +
                   ": found no trajectory in this folder, expected groundtruth.txt (TUM), "
                   "state_groundtruth_estimate0/data.csv (EuRoC) or poses.txt (KITTI)");
}

}  // namespace

Trajectory read_trajectory(const std::string& path, TrajectoryFormat* found) {
  std::error_code error;
  if (fs::is_directory(path, error)) return read_folder(path, found);
  return parse_trajectory(read_text_file(path), path, found);
}

Trajectory parse_trajectory(const std::string& text, const std::string& name, TrajectoryFormat* found) {
  Trajectory trajectory;
  trajectory.reserve(std::min<std::size_t>(text.size() / 60, 1'000'000));
  bool known = false;
  TrajectoryFormat format = TrajectoryFormat::tum;
  std::vector<std::string_view> fields;
  LineReader lines(text);
  std::string_view line;
  while (lines.next(&line)) {
    if (line.empty() || line.front() == '#') continue;
    try {
      const bool commas = line.find(',') != std::string_view::npos;
      if (commas) {
        split_commas(line, &fields);
      } else {
        split_blanks(line, &fields);
      }
      if (!known) {
        if (commas && fields.size() >= 8) {
          format = TrajectoryFormat::euroc;
        } else if (!commas && (fields.size() == 8 || fields.size() == 12)) {
          format = fields.size() == 8 ? TrajectoryFormat::tum : TrajectoryFormat::kitti;
        } else {
          throw LineError{"found " + std::to_string(fields.size()) + (fields.size() == 1 ? " value, " : " values, ") +
                          kExpected};
        }
        known = true;
      }
      const std::size_t needed = format == TrajectoryFormat::kitti ? 12 : 8;
      const bool fits = format == TrajectoryFormat::euroc ? fields.size() >= needed : fields.size() == needed;
      if (!fits || commas != (format == TrajectoryFormat::euroc)) {
        throw LineError{"found " + std::to_string(fields.size()) + " values, expected " + std::to_string(needed) +
                        " as in the lines before"};
      }
      trajectory.push_back(format == TrajectoryFormat::tum     ? parse_tum(fields)
                           : format == TrajectoryFormat::kitti ? parse_kitti(fields, trajectory.size())
                                                               : parse_euroc(fields));
    } catch (const LineError& error) {
      throw InputError(name + ":" + std::to_string(lines.number()) + ": " + error.what);
    }
  }
  if (trajectory.empty()) throw InputError(name + ": found no pose, " + kExpected);
  sort_by_time(&trajectory);
  if (found != nullptr) *found = format;
  return trajectory;
}

void write_trajectory_tum(const Trajectory& trajectory, const std::string& path) {
  write_file_atomically(path, [&](std::ostream& out) {
    char buffer[2560] /* seven of the longest doubles */;
    for (const auto& pose : trajectory) {
      const auto& t = pose.world_from_camera.t;
      const Eigen::Quaterniond q = pose.world_from_camera.quaternion();
      std::snprintf(buffer, sizeof buffer, " %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", t.x(), t.y(), t.z(), q.x(), q.y(),
                    q.z(), q.w());
      out << format_seconds(pose.time) << buffer;
    }
  });
}

void write_trajectory_kitti(const Trajectory& trajectory, const std::string& path) {
  write_file_atomically(path, [&](std::ostream& out) {
    char buffer[64];
    for (const auto& pose : trajectory) {
      for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 4; ++column) {
          const auto& T = pose.world_from_camera;
          std::snprintf(buffer, sizeof buffer, "%.9e", column < 3 ? T.R(row, column) : T.t(row));
          out << (row + column > 0 ? " " : "") << buffer;
        }
      }
      out << '\n';
    }
  });
}

void write_trajectory_euroc(const Trajectory& trajectory, const std::string& path) {
  write_file_atomically(path, [&](std::ostream& out) {
    out << "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []\n";
    char buffer[2560] /* seven of the longest doubles */;
    for (const auto& pose : trajectory) {
      const auto& t = pose.world_from_camera.t;
      const Eigen::Quaterniond q = pose.world_from_camera.quaternion();
      std::snprintf(buffer, sizeof buffer, "%lld,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f\n",
                    static_cast<long long>(pose.time.count()), t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z());
      out << buffer;
    }
  });
}

void write_trajectory(const Trajectory& trajectory, TrajectoryFormat format, const std::string& path) {
  switch (format) {
    case TrajectoryFormat::tum:
      return write_trajectory_tum(trajectory, path);
    case TrajectoryFormat::kitti:
      return write_trajectory_kitti(trajectory, path);
    case TrajectoryFormat::euroc:
      return write_trajectory_euroc(trajectory, path);
  }
}

RigidTransform parse_euroc_body_from_sensor(const std::string& text, const std::string& name) {
  const auto fail = [&](const std::string& what) {
    return InputError(name + ": key T_BS: " + what + ", expected 16 numbers of a rigid transform");
  };
  const std::size_t key = text.starts_with("T_BS") ? 0 : text.find("\nT_BS");
  if (key == std::string::npos) throw fail("not found");
  const std::size_t open = text.find('[', key), close = text.find(']', key);
  if (open == std::string::npos || close == std::string::npos || close < open) throw fail("found no list");
  std::string list = text.substr(open + 1, close - open - 1);
  std::replace(list.begin(), list.end(), '\n', ' ');
  std::vector<std::string_view> fields;
  split_commas(list, &fields);
  if (fields.size() != 16) throw fail("found " + std::to_string(fields.size()) + " values");
  double m[16];
  try {
    parse_values(fields, 0, m);
    const bool affine = m[12] == 0 && m[13] == 0 && m[14] == 0 && m[15] == 1;
    if (!affine) throw LineError{"found a last row that is not 0 0 0 1"};
    return rigid_from_matrix(m);
  } catch (const LineError& error) {
    throw fail(error.what);
  }
}

}  // namespace parallax
