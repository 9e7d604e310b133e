// Calibrates a stereo rig from pairs of views of one target taken at one moment: both lenses and where the right camera
// is, in one adjustment.
//
// Frames: the rig is the left camera; `right_from_left` takes a point from the left camera's frame to the right's.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/camera_calibration.h"
#include "camera/stereo_source.h"

namespace parallax {

struct StereoView {
  int frame = 0;
  std::string name;
  std::vector<TargetCorner> left, right;  // either may be empty; pairs tie the cameras
};

struct StereoData {
  CalibrationTarget target;
  int width = 0, height = 0;  // of both cameras' images
  std::vector<StereoView> views;
};

struct StereoResult {
  bool ok = false;
  std::string reason;  // one sentence when not
  StereoCalibration calibration;
  CameraCalibration left, right;  // each alone: where the joint adjustment began
  // Of the joint adjustment: parameters of the left lens, then of the right one, with their standard deviations (as in
  // CameraCalibration: the larger of the two estimates).
  Eigen::VectorXd left_sigma, right_sigma;
  // Of right_from_left: a left increment, metres (first three) and radians.
  Vector6d rig_sigma = Vector6d::Zero();
  double rms_px = 0, noise_px = 0;
  // Root mean squared distance of corners from the epipolar line of their partner, pixels, over the right images.
  double epipolar_px = 0;
  int pairs = 0, corners = 0, outliers = 0;
};

// Both lenses are of options.model. Never throws for what the views are.
StereoResult calibrate_stereo(const StereoData& data, const CalibrationOptions& options);

}  // namespace parallax
