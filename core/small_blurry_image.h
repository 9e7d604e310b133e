// Small blurry images: a frame at about 40 pixels width, strongly blurred, zero mean. Aligning two of them directly
// gives the camera's rotation between the frames; comparing them finds the keyframe that looks most alike
// (relocalisation, PTAM §5.6, and the rotation prior of the motion model).
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "core/camera_model.h"
#include "core/image.h"

namespace parallax {

// Immutable once made; copies share pixels.
struct SmallBlurryImage {
  cv::Mat1f image;   // zero mean, grey levels
  cv::Mat1f dx, dy;  // central differences of `image`
  double scale = 1;  // level-0 pixels per small pixel
  bool empty() const { return image.empty(); }
};

SmallBlurryImage make_small_blurry_image(const ImagePyramid& pyramid, double blur_sigma_small_px = 1.5);

// Mean squared difference over the common area (grey levels squared), no alignment. The images must be of one size.
double small_image_difference(const SmallBlurryImage& a, const SmallBlurryImage& b);

// A rigid 2D motion about the image centre: a point p of `from` appears in `to` at R(angle) (p - c) + c + shift.
struct SmallImageAlignment {
  double angle = 0;                                 // radians
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();  // level-0 pixels
  double mean_squared_difference = 0;               // after alignment, mean brightness removed
  double overlap = 0;                               // part of the image compared
  bool converged = false;
};

// Efficient second-order minimisation over rotation, shift and mean brightness, coarse to fine where it helps.
SmallImageAlignment align_small_images(const SmallBlurryImage& from, const SmallBlurryImage& to,
                                       int max_iterations = 10);

// The camera rotation that best explains the alignment for a distant scene: to_from_from such that
// ray_to = R * ray_from; least squares over a grid of image points through the camera model.
Eigen::Matrix3d rotation_from_alignment(const CameraModel& camera, const SmallImageAlignment& alignment);

}  // namespace parallax
