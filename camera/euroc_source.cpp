// The EuRoC (ASL) layout: mav0/cam0 and cam1 with data.csv (ns, image), data/ and sensor.yaml, and the ground truth of
// the body in state_groundtruth_estimate0. The folder given is the one that holds mav0, or mav0 itself.
#include <cmath>
#include <filesystem>

#include "camera/dataset_text.h"
#include "camera/image_sequence.h"
#include "core/error.h"
#include "core/file_io.h"
#include "core/trajectory.h"

namespace parallax {
namespace fs = std::filesystem;

namespace {

// The folder that holds cam0: `folder` itself or its mav0; empty when neither does.
fs::path mav_folder(const fs::path& folder) {
  std::error_code error;
  for (const fs::path& mav : {folder / "mav0", folder}) {
    if (fs::exists(mav / "cam0" / "data.csv", error)) return mav;
  }
  return {};
}

// The ground truth of camera 0: the body's poses with T_BS applied.
void read_truth(const fs::path& mav, ImageSequence* sequence) {
  std::error_code error;
  if (!fs::exists(mav / "state_groundtruth_estimate0" / "data.csv", error)) return;
  try {
    // The folder's reading applies camera 0's T_BS.
    for (const auto& pose : read_trajectory(mav.string())) {
      sequence->ground_truth.push_back({pose.time, pose.world_from_camera});
    }
  } catch (const InputError& problem) {
    sequence->warnings.push_back({-1, std::string(problem.what()) + "; the ground truth is not used"});
  }
}

}  // namespace

bool is_euroc_folder(const std::string& folder) { return !mav_folder(folder).empty(); }

ImageSequence open_euroc_sequence(const std::string& folder, int camera, const SourceOptions& options) {
  const fs::path mav = mav_folder(folder);
  const fs::path camera_folder = mav / ("cam" + std::to_string(camera));
  ImageSequence sequence;
  sequence.description = "EuRoC folder " + folder;
  const std::string list_name = (camera_folder / "data.csv").string();
  const ImageList list = parse_euroc_image_list(read_text_file(list_name), list_name);
  for (const auto& text : list.warnings) sequence.warnings.push_back({-1, text});
  for (const auto& image : list.images) {
    if (stays_inside((camera_folder / "data").string(), image.name)) {
      sequence.images.push_back({image.index, image.time, (camera_folder / "data" / image.name).string()});
    } else {
      sequence.warnings.push_back({image.index, list_name + ":" + std::to_string(image.line) + ": found '" +
                                                    image.name + "', expected an image inside " +
                                                    (camera_folder / "data").string() + "; it is skipped"});
    }
  }
  sequence.positions = list.positions;
  if (sequence.images.empty()) {
    throw InputError(list_name + ": found only images outside the data folder, expected images inside it");
  }
  probe_sequence(&sequence);
  double rate = options.fallback_fps;
  std::error_code error;
  const std::string sensor_name = (camera_folder / "sensor.yaml").string();
  if (fs::exists(sensor_name, error)) {
    const EurocSensor sensor = parse_euroc_sensor(read_text_file(sensor_name), sensor_name);
    sequence.calibration = sensor.camera;
    check_calibration_size(sensor.camera, sensor_name, sequence);
    sequence.body_from_camera = sensor.body_from_camera;
    if (sensor.rate_hz) rate = *sensor.rate_hz;
  }
  sequence.frames_per_second = median_rate(sequence.images, rate);
  if (camera == 0) read_truth(mav, &sequence);
  return sequence;
}

}  // namespace parallax
