// The normal matrix of an alignment template. Internal to core/patch_*.cpp.
#pragma once

#include "core/patch.h"

namespace parallax::detail {

// Fills inverse_normal, covariance and valid from the template's gradients.
void finish_normal_matrix(AlignmentTemplate* t);

}  // namespace parallax::detail
