// Options of the stereo odometry (MS §3.1).
#pragma once

#include <cstdint>

#include "solver/stereo_pose.h"

namespace parallax {

struct StereoTrackerOptions {
  int features = 250;                // tracked at once, topped up every frame
  double min_distance_px = 15;       // between two of them: spreads them over the image (MS §3.1)
  double min_corner_score = 3;       // Shi-Tomasi: smaller eigenvalue of the mean gradient matrix, grey levels squared
  int few_features = 50;             // fewer tracked is told (MS §3.1: about 50 make a reliable pose)
  int min_inliers = 12;              // fewer: the motion is not known
  double min_correlation = 0.8;      // of a track's window with what it was taken from
  double max_round_trip_px = 0.7;    // tracked forward and back again
  double max_row_difference_px = 1;  // between the left and the right image
  double nearest_m = 0.35;           // what is nearer is not looked for in the right image
  double sigma_px = 0.1;             // of a measured coordinate
  // Covariance of a motion as it is told, in parts of the sandwich estimate, which is a little wide (its floor and its
  // correction for few points). Measured by bench/stereo_consistency.
  double covariance_part = 0.92;
  double keyframe_distance_m = 0.2;                       // MS §3.2: motion from one pose to the next, either...
  double keyframe_angle_rad = 0.2;                        // ...or
  double keyframe_kept = 0.4;                             // or so few of the last pose's tracks are left
  double failure_sigma_m = 1.0, failure_sigma_rad = 0.5;  // covariance across a failure (MS §5.1)
  StereoPoseOptions pose;
  std::uint64_t seed = 1;

  // Throws InputError when a value is out of range.
  void validate() const;
};

}  // namespace parallax
