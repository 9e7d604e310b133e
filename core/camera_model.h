// Camera models: CamProj() of PTAM Eq. 2 and its inverse, for pinhole, radial-tangential (OpenCV 4, 5 and 8
// parameters), Kannala-Brandt (OpenCV fisheye) and FOV (PTAM Eq. 3-5, Devernay and Faugeras) lenses.
//
// Camera frame: x right, y down, z forward. Pixels: the centre of the top-left pixel is (0, 0), level 0 of the pyramid.
// A value type without virtual functions; copies are cheap; const functions are safe from any thread.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>

namespace parallax {

enum class CameraModelKind { pinhole, radtan, kannala_brandt, fov };

// The name used in our calibration files: "pinhole", "radtan", "kannala_brandt", "fov".
const char* to_string(CameraModelKind kind);

class CameraModel {
 public:
  // Distortion, by kind: pinhole none; radtan k1 k2 p1 p2 [k3 [k4 k5 k6]] in OpenCV's order; kannala_brandt k1 k2 k3
  // k4; fov omega (radians). Throws InputError when a value is not finite, a size or focal length not positive, the
  // number of distortion parameters wrong, or the model folds onto itself inside the image. What is asked for inside
  // the image: radtan, every pixel has its ray; kannala_brandt, a fold (if inside the image) lies beyond 60 degrees, so
  // that the unlit corners of a fisheye image are allowed; fov and pinhole have no fold.
  CameraModel() = default;
  CameraModel(CameraModelKind kind, int width, int height, const Eigen::Vector2d& focal_px,
              const Eigen::Vector2d& centre_px, const std::array<double, 8>& distortion = {}, int n_distortion = 0);

  CameraModelKind kind() const { return kind_; }
  int width() const { return width_; }
  int height() const { return height_; }
  const Eigen::Vector2d& focal_px() const { return focal_; }
  const Eigen::Vector2d& centre_px() const { return centre_; }
  const std::array<double, 8>& distortion() const { return distortion_; }
  int n_distortion() const { return n_distortion_; }

  // Projects a point in the camera frame. Returns false, and leaves the outputs untouched, outside the model's domain:
  // z <= 0 (for kannala_brandt: an angle from the axis of 180 degrees), or a radius beyond which the distortion is no
  // longer monotonic (with tangential distortion: provably invertible), and for radtan 10,000 z (0.006 degrees from the
  // image plane). The pixel may lie outside the image; ask in_image().
  bool project(const Eigen::Vector3d& point, Eigen::Vector2d* pixel) const;
  // The same with the 2x3 Jacobian of the pixel with respect to the point.
  bool project(const Eigen::Vector3d& point, Eigen::Vector2d* pixel,
               Eigen::Matrix<double, 2, 3>* d_pixel_d_point) const;

  // A ray (x, y, 1) through the pixel, in the camera frame; false when no such ray with z > 0 exists. Inverse of
  // project() to 1e-9 px over the image (Newton iteration, or closed form).
  bool unproject(const Eigen::Vector2d& pixel, Eigen::Vector3d* ray) const;

  // The Jacobian of the pixel with respect to a left-multiplied pose increment (translation, rotation), PTAM Eq. 6:
  // d_pixel_d_point * [I | -hat(point)], for a point in the camera frame.
  static Eigen::Matrix<double, 2, 6> pose_jacobian(const Eigen::Matrix<double, 2, 3>& d_pixel_d_point,
                                                   const Eigen::Vector3d& point);

  bool in_image(const Eigen::Vector2d& pixel, double border_px = 0) const {
    return pixel.x() >= border_px && pixel.y() >= border_px && pixel.x() <= width_ - 1 - border_px &&
           pixel.y() <= height_ - 1 - border_px;
  }

  // The largest x^2 + y^2 (z = 1) that any pixel of the image, or of a margin of image_margin_px outside it, sees: a
  // cheap cull before project(). Infinite when a pixel of a kannala_brandt image looks 90 degrees off the axis or more.
  double max_radius_squared() const { return max_radius2_; }

  // Projects n points given as a structure of arrays in the camera frame, in single precision (within 0.01 px of
  // project() inside the image); visible[i] is 1 when the point is in the domain and in the image with the border.
  // Vectorised (SSE2, AVX2 or AVX-512, chosen at run time); the outputs hold n values and do not overlap the inputs.
  // u and v of an invisible point carry no meaning. Points with a coordinate beyond 1e18 are not seen.
  void project_batch(const float* x, const float* y, const float* z, int n, float border_px, float* u, float* v,
                     unsigned char* visible) const;

  // Root-mean-square focal length, in pixels: what one radian is worth near the image centre.
  double mean_focal_px() const;

  // The same lens with another image size (all pixels scaled, half-pixel convention kept).
  CameraModel scaled(int new_width, int new_height) const;

  // See max_radius_squared().
  static constexpr double image_margin_px = 16.0;

  bool operator==(const CameraModel& other) const = default;

 private:
  void check_parameters() const;
  void find_domain();
  void check_no_fold_in_image() const;
  void find_image_radius();
  template <bool with_jacobian>
  bool project_any(const Eigen::Vector3d& point, Eigen::Vector2d* pixel, Eigen::Matrix<double, 2, 3>* jacobian) const;

  CameraModelKind kind_ = CameraModelKind::pinhole;
  int width_ = 0, height_ = 0;
  Eigen::Vector2d focal_{1, 1}, centre_{0, 0};
  std::array<double, 8> distortion_{};
  int n_distortion_ = 0;
  double max_radius2_ = 0;     // of the visible cone, z = 1
  double domain_radius2_ = 0;  // where the distortion stops being monotonic, z = 1
  double domain_angle_ = 0;    // the same as an angle from the axis: kannala_brandt only
  double fov_omega_ = 0;       // fov: omega kept away from zero, and 2 tan(omega / 2)
  double fov_factor_ = 0;
};

}  // namespace parallax
