// The TUM RGB-D layout: rgb.txt (time, image), groundtruth.txt and calibration.yaml where they are there.
#include <filesystem>

#include "camera/calibration_file.h"
#include "camera/dataset_text.h"
#include "camera/image_sequence.h"
#include "core/error.h"
#include "core/file_io.h"
#include "core/trajectory.h"

namespace parallax {
namespace fs = std::filesystem;

bool is_tum_folder(const std::string& folder) {
  std::error_code error;
  return fs::exists(fs::path(folder) / "rgb.txt", error);
}

ImageSequence open_tum_sequence(const std::string& folder, const SourceOptions& options) {
  ImageSequence sequence;
  sequence.description = "TUM folder " + folder;
  const std::string list_name = (fs::path(folder) / "rgb.txt").string();
  const ImageList list = parse_tum_image_list(read_text_file(list_name), list_name);
  for (const auto& text : list.warnings) sequence.warnings.push_back({-1, text});
  for (const auto& image : list.images) {
    if (stays_inside(folder, image.name)) {
      sequence.images.push_back({image.index, image.time, (fs::path(folder) / image.name).string()});
    } else {
      sequence.warnings.push_back({image.index, list_name + ":" + std::to_string(image.line) + ": found '" +
                                                    image.name + "', expected an image inside " + folder +
                                                    "; it is skipped"});
    }
  }
  sequence.positions = list.positions;
  sequence.frames_per_second = median_rate(sequence.images, options.fallback_fps);
  if (sequence.images.empty()) {
    throw InputError(list_name + ": found only images outside the folder, expected images inside " + folder);
  }
  probe_sequence(&sequence);
  std::error_code error;
  for (const char* name : {"calibration.yaml", "calibration.yml"}) {
    const std::string path = (fs::path(folder) / name).string();
    if (!fs::exists(path, error)) continue;
    sequence.calibration = read_calibration(path, 0, sequence.probe.size.width, sequence.probe.size.height);
    check_calibration_size(*sequence.calibration, path, sequence);
    break;
  }
  const std::string truth = (fs::path(folder) / "groundtruth.txt").string();
  if (fs::exists(truth, error)) {
    try {
      for (const auto& pose : read_trajectory(truth)) {
        sequence.ground_truth.push_back({pose.time, pose.world_from_camera});
      }
    } catch (const InputError& problem) {
      sequence.warnings.push_back({-1, std::string(problem.what()) + "; the ground truth is not used"});
    }
  }
  return sequence;
}

}  // namespace parallax
