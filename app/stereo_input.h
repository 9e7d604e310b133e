// Opens what `parallax slam` reads: a stereo recording with its calibration.
#pragma once

#include <memory>
#include <string>

#include "camera/stereo_source.h"

namespace parallax {

struct StereoInput {
  std::unique_ptr<StereoSource> source;
  StereoCalibration calibration;
};

// `calibration_path` empty: the calibration that the source carries. Throws InputError, one line, when there is none.
StereoInput open_stereo_input(const std::string& source, const std::string& calibration_path,
                              const SourceOptions& options);

}  // namespace parallax
