// From one camera model to another: least squares over the image (both cameras look along the same axes).
#pragma once

#include <optional>

#include "calib/lens.h"
#include "core/camera_model.h"

namespace parallax {

struct LensConversion {
  CameraModel camera;
  double rms_px = 0, max_px = 0;  // distance of the two models' pixels over the image
  double covered = 0;             // share of the image's pixels whose ray both models know (1: all)
};

// Fits `model` to `source` over a grid of its pixels (Levenberg-Marquardt from several starts). Pixels that see
// beyond what the new model can show (the plane of the image, for those that need z > 0) are left out and counted.
// Nothing when there is no such lens without a fold inside the image.
std::optional<LensConversion> convert_lens(const CameraModel& source, LensModel model, const LensFreedom& freedom = {});

// How far two cameras' pixels are apart over the image, once the second has been turned (a rotation) as well as can be:
// what differs between calibrations that a pose cannot take up.
struct LensDifference {
  double rms_px = 0, max_px = 0;
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  // radians, of the second camera
};
// Over the pixels in the rectangle from `low` to `high`.
LensDifference compare_lenses(const CameraModel& a, const CameraModel& b, const Eigen::Vector2d& low,
                              const Eigen::Vector2d& high);

}  // namespace parallax
