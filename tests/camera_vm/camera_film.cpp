// Writes the film that the simulated USB camera shows, and what belongs to it:
//   camera_film FOLDER
// film.grey: raw 8-bit frames of the synthetic desk, 320x240. calibration.yaml: its lens. truth.txt: the true pose of
// every frame, camera to world, as lines "FRAME tx ty tz qx qy qz qw"; the camera tells at which time it showed a
// frame.
#include <cstdio>
#include <fstream>
#include <memory>
#include <string>

#include "camera/calibration_file.h"
#include "camera/frame_source.h"
#include "render/synthetic_source.h"

namespace parallax::camera_vm {
namespace {

// The desk is made for 30 frames a second; an emulated machine follows fewer.
constexpr int kEvery = 2;

int run(const std::string& folder) {
  const auto source = open_synthetic_source("synthetic:desk?size=320x240&frames=150");
  const auto poses = source->ground_truth();
  std::ofstream film(folder + "/film.grey", std::ios::binary), truth(folder + "/truth.txt");
  int shown = 0;
  for (int i = 0; const auto frame = source->next(); ++i) {
    if (i % kEvery != 0) continue;
    for (int y = 0; y < frame->grey.rows; ++y) {
      film.write(reinterpret_cast<const char*>(frame->grey.ptr(y)), frame->grey.cols);
    }
    const auto& pose = poses.at(static_cast<std::size_t>(i)).world_from_camera;
    const Eigen::Quaterniond q(pose.R);
    char line[256];
    std::snprintf(line, sizeof line, "%d %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", shown++, pose.t.x(), pose.t.y(),
                  pose.t.z(), q.x(), q.y(), q.z(), q.w());
    truth << line;
  }
  film.close();
  truth.close();
  write_calibration(*source->calibration(), folder + "/calibration.yaml");
  return film && truth ? 0 : 1;
}

}  // namespace
}  // namespace parallax::camera_vm

int main(int count, char** values) {
  if (count != 2) {
    std::fprintf(stderr, "usage: camera_film FOLDER\n");
    return 2;
  }
  return parallax::camera_vm::run(values[1]);
}
