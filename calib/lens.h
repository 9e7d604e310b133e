// Lenses as vectors of parameters: what a calibration solves for. Parameters in the order fx fy cx cy, then the
// distortion in CameraModel's order. Values and pure functions, safe from any thread.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/camera_model.h"

namespace parallax {

// The models that can be fitted: radtan by its number of distortion parameters.
enum class LensModel { pinhole, radtan4, radtan5, radtan8, kannala_brandt, fov };

// "pinhole", "radtan4", "radtan5", "radtan8", "kannala_brandt", "fov".
const char* to_string(LensModel model);
// Also takes "radtan" for radtan5. Throws InputError for any other name.
LensModel lens_model(const std::string& name);
LensModel lens_model(const CameraModel& camera);

int lens_parameter_count(LensModel model);                       // 4 to 12
std::vector<std::string> lens_parameter_names(LensModel model);  // fx fy cx cy k1...

Eigen::VectorXd lens_parameters(const CameraModel& camera);
// Nothing when there is no such lens (CameraModel's constructor would throw).
std::optional<CameraModel> make_lens(LensModel model, int width, int height, const Eigen::VectorXd& parameters);

// Which parameters a fit may change, and together: full = start + map * free.
struct LensFreedom {
  bool square_pixels = false;   // fx = fy
  bool tangential = true;       // radtan: p1 and p2; else they stay 0
  bool principal_point = true;  // else it stays where it is
};
Eigen::MatrixXd lens_freedom_map(LensModel model, const LensFreedom& freedom);

using LensJacobian = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 12>;

// CameraModel::project with both Jacobians: of the pixel by the point, and by the parameters (2 x count).
bool project_with_lens(const CameraModel& camera, const Eigen::Vector3d& point, Eigen::Vector2d* pixel,
                       Eigen::Matrix<double, 2, 3>* d_pixel_d_point, LensJacobian* d_pixel_d_parameters);

}  // namespace parallax
