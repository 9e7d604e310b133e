// Pictures of a calibration's residuals and uncertainty.
#pragma once

#include <string>

#include "app/calibrate_report.h"

namespace parallax {

// Writes residuals.svg (where residuals point, with circles of one to three standard deviations), residual_map.svg
// (where in the image they are, enlarged), uncertainty.svg (projection uncertainty over the image) and the same as .png
// into the folder, which is made when it is not there. Throws RunError.
void plot_calibration(const CalibrateReport& report, const std::string& folder);

}  // namespace parallax
