// How far a calibration's pixels may be from the truth, over the image.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/camera_calibration.h"

namespace parallax {

// Standard deviations on a grid over the whole image, corners of the image included.
struct UncertaintyMap {
  int columns = 0, rows = 0;
  std::vector<double> sigma_px;  // row by row; the larger axis of the ellipse
  double max_px = 0, mean_px = 0;
  double at(int column, int row) const { return sigma_px[static_cast<std::size_t>(row * columns + column)]; }
};

// First-order: the covariance of the parameters through the projection of each pixel's ray, less what a rotation of the
// camera would take up, since no user of a calibration can tell the two apart (a principal point that is off is mostly
// a camera that is turned). At each place the larger of the two covariances of CameraCalibration. Pixels without a ray
// take the value of the nearest that has one.
UncertaintyMap projection_uncertainty(const CameraCalibration& calibration, int columns = 25, int rows = 19);

}  // namespace parallax
