// Targets to print, as vector PDF with a ruler that shows whether the printer kept the scale.
#pragma once

#include <string>

#include "calib/target.h"

namespace parallax {

enum class Paper { a4, letter };
// "a4" or "letter"; throws InputError otherwise.
Paper paper(const std::string& name);

// The size of a square (metres, whole millimetres) with which the target fills the sheet best.
double fitting_square_m(const CalibrationTarget& target, Paper paper);

// One sheet, landscape or upright as fits, the target in the middle, and a line below it: what it is, its measures, and
// a ruler of 100 mm. Throws InputError when the target is larger than the sheet, RunError when it cannot be written.
void write_target_pdf(const CalibrationTarget& target, Paper paper, const std::string& path);

}  // namespace parallax
