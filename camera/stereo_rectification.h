// Turns the images of any calibrated pair of cameras into those of a StereoCamera (MS §3.1): lenses taken out, rows
// aligned, one focal length and centre for both.
//
// Each camera is turned half way towards the other; then both so that x runs along the baseline, and z is as near to
// their common direction of view as that allows (Fusiello, Trucco, Verri: A compact algorithm for rectification of
// stereo pairs, Machine Vision and Applications 12, 2000). The rectified left camera stands where the left one does.
// Frames: `left` and `right` are the cameras as calibrated, `rectified` is the rig's frame of StereoCamera.
#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <string>

#include "camera/stereo_source.h"
#include "core/stereo_camera.h"
#include "core/stereo_images.h"

namespace parallax {

struct RectificationOptions {
  // The part of both rectified images, 0.5 to 1, that shows something: the focal length is the smallest that leaves no
  // more than the rest black, so that as much as possible of the world is kept. With 1 no corner is black.
  double least_seen = 0.97;
  // Of the mean focal length of the two cameras: how far the focal length may go from it for that.
  double least_focal = 0.5, most_focal = 2.0;

  void validate() const;  // throws InputError naming the field
};

// const functions are safe from any thread.
class StereoRectifier {
 public:
  // `name` is what the calibration is called in messages. Throws InputError, one line: the right camera is left of,
  // above, before... the left one; the baseline is not from 1 mm to 5 m; the cameras look more than 60 degrees apart;
  // too little of the images is left. A baseline that is wrong but plausible cannot be seen from the images of one rig:
  // it scales the world.
  explicit StereoRectifier(const StereoCalibration& calibration, const RectificationOptions& options = {},
                           const std::string& name = "stereo calibration");

  const StereoCamera& camera() const { return camera_; }
  // Rotations: a pose of the left camera is world_from_rectified * rectified_from_left().
  const RigidTransform& rectified_from_left() const { return rectified_from_camera_[0]; }
  // Of the right camera, into the frame of the right rectified one.
  const RigidTransform& rectified_from_right() const { return rectified_from_camera_[1]; }

  // The pair is rectified as it is (two equal pinholes, directions to 1e-6 rad): images are handed through.
  bool is_pass_through() const { return pass_through_; }

  // The part of the rectified images that shows something, 0 to 1: the mean of left and right.
  double seen() const { return seen_; }
  // 255 where the left rectified image shows something and so do its neighbours, else 0: corners of the black border
  // are no corners. Empty when all of it does.
  const cv::Mat1b& left_mask() const { return left_mask_; }

  // Pixels that were not seen are 0. A pass-through shares the pixels. Reuses the images of `out` when nobody else
  // holds them. Throws InputError when an image's size is not the calibration's.
  void rectify(const StereoFrame& in, StereoImages* out) const;

  // Where a pixel of a camera as calibrated lies in its rectified image (which may be outside); false behind the image
  // plane.
  bool rectified_pixel(bool right, const Eigen::Vector2d& pixel, Eigen::Vector2d* rectified) const;

 private:
  struct Maps {
    cv::Mat whole, fraction;  // fixed-point look-up of cv::remap
  };

  void turn(const RigidTransform& right_from_left, const std::string& name);
  void choose_view(const RectificationOptions& options, const std::string& name);
  double seen_at(double focal_px) const;
  bool source_pixel(int side, const Eigen::Vector2d& rectified, Eigen::Vector2d* source) const;
  Maps make_maps(int side, cv::Mat1b* mask) const;
  void look_up(int side, const cv::Mat& in, cv::Mat* out) const;

  std::string name_;
  std::array<CameraModel, 2> cameras_;  // left, right
  std::array<RigidTransform, 2> rectified_from_camera_;
  StereoCamera camera_;
  std::array<Eigen::Vector2d, 2> middle_{};  // of what each camera sees, on the rectified plane z = 1
  bool pass_through_ = false;
  double seen_ = 1;
  std::array<Maps, 2> maps_;
  cv::Mat1b left_mask_;
};

}  // namespace parallax
