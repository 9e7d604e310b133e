// The text files of data sets, as pure functions on strings (the fuzz target enters here): image lists of TUM RGB-D
// (rgb.txt) and EuRoC (data.csv), KITTI's times.txt and calib.txt, EuRoC's sensor.yaml.
//
// Every line that is neither blank nor a comment is a frame and uses up an index, whether it can be read or not. A bad
// line is skipped with a warning ("FILE:LINE: found X, expected Y"); a file without one good line is an InputError.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "camera/image_file.h"
#include "core/camera_model.h"
#include "core/se3.h"
#include "core/time.h"

namespace parallax {

struct ListedImage {
  int index = 0;      // position in the list
  int line = 0;       // in the text file, from 1
  Timestamp time{0};  // strictly increasing
  std::string name;   // as it stands in the file; empty for KITTI's times.txt
};

struct ImageList {
  std::vector<ListedImage> images;
  int positions = 0;  // indices used, bad lines included
  std::vector<std::string> warnings;
};

ImageList parse_tum_image_list(const std::string& text, const std::string& name);
ImageList parse_euroc_image_list(const std::string& text, const std::string& name);
ImageList parse_kitti_times(const std::string& text, const std::string& name);

// Drops the fewest images that leave the times strictly increasing, with a warning each.
void drop_unordered_times(const std::string& name, ImageList* list);

// Whether a name from such a file stays inside the data-set folder, judged by the text alone: a relative name that does
// not climb out with "..", or an absolute one below `folder`. Links that the user made are followed.
bool stays_inside(const std::string& folder, const std::string& name);

// Projection matrix P0..P3 of a KITTI calib.txt, rows of 3x4. Throws InputError.
using ProjectionMatrix = Eigen::Matrix<double, 3, 4>;
ProjectionMatrix parse_kitti_projection(const std::string& text, const std::string& name, int camera);
// Its rectified pinhole camera (`size` of the images), and its place beside camera 0.
CameraModel kitti_camera(const ProjectionMatrix& projection, ImageSize size, const std::string& name);
RigidTransform kitti_camera0_from_camera(const ProjectionMatrix& projection);

// A camera's sensor.yaml in EuRoC's form: pinhole with radial-tangential or equidistant distortion. Throws InputError.
struct EurocSensor {
  CameraModel camera;
  RigidTransform body_from_camera;
  std::optional<double> rate_hz;
};
EurocSensor parse_euroc_sensor(const std::string& text, const std::string& name);

// "img2" before "img10": runs of digits compare as numbers.
bool natural_less(std::string_view a, std::string_view b);

}  // namespace parallax
