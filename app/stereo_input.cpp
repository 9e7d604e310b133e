#include "app/stereo_input.h"

#include <utility>

#include "app/source.h"
#include "camera/calibration_file.h"
#include "core/error.h"

namespace parallax {

StereoInput open_stereo_input(const std::string& source, const std::string& calibration_path,
                              const SourceOptions& options) {
  StereoInput input;
  input.source = open_stereo(source, options);
  if (!calibration_path.empty()) {
    input.calibration = read_stereo_calibration(calibration_path);
  } else if (auto carried = input.source->calibration()) {
    input.calibration = std::move(*carried);
  } else {
    throw InputError(source + ": carries no calibration of both cameras; expected --calibration FILE");
  }
  return input;
}

}  // namespace parallax
