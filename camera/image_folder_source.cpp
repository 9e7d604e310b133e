// A folder of plain images, in natural order, at a nominal rate; calibration.yaml beside them is used where it is
// there.
#include <algorithm>
#include <filesystem>

#include "camera/calibration_file.h"
#include "camera/dataset_text.h"
#include "camera/image_sequence.h"
#include "core/error.h"

namespace parallax {
namespace fs = std::filesystem;

ImageSequence open_numbered_sequence(const std::string& folder, const SourceOptions& options) {
  ImageSequence sequence;
  sequence.description = "image folder " + folder;
  std::vector<std::string> names;
  std::size_t others = 0;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name.starts_with('.')) continue;
    std::error_code ignored;
    if (has_image_name(name) && !it->is_directory(ignored)) {
      names.push_back(name);
    } else {
      ++others;
    }
  }
  if (error) throw InputError(folder + ": cannot be read: " + error.message());
  if (names.empty()) {
    throw InputError(folder + ": found " + (others == 0 ? "an empty folder" : "no images") +
                     ", expected rgb.txt (TUM RGB-D), mav0/cam0/data.csv (EuRoC), image_0 (KITTI) or numbered images");
  }
  std::sort(names.begin(), names.end(), natural_less);
  for (const auto& name : names) {
    const int index = sequence.positions++;
    sequence.images.push_back({index, from_seconds(index / options.fallback_fps), (fs::path(folder) / name).string()});
  }
  sequence.frames_per_second = options.fallback_fps;
  probe_sequence(&sequence);
  for (const char* name : {"calibration.yaml", "calibration.yml"}) {
    const std::string path = (fs::path(folder) / name).string();
    if (!fs::exists(path, error)) continue;
    sequence.calibration = read_calibration(path, 0, sequence.probe.size.width, sequence.probe.size.height);
    check_calibration_size(*sequence.calibration, path, sequence);
    break;
  }
  return sequence;
}

}  // namespace parallax
