// Options of the tracking thread. Each states default, unit, meaning and source; validate() throws InputError.
#pragma once

#include "tracker/motion_model.h"
#include "tracker/trail_tracker.h"

namespace parallax {

struct TrackerOptions {
  // Corners: targets a level for the adaptive thresholds, for a 640x480 frame (scaled with the image's area).
  int corner_targets[4] = {4000, 1600, 600, 200};

  // Coarse stage (PTAM §5.5): at most so many points of the highest levels, within this radius.
  int coarse_points = 50;
  int coarse_min = 15;           // fewer found: the coarse pose is not used
  double coarse_radius_px = 30;  // level 0
  // Skipped when the motion model expects less image motion than this (PTAM §6.5).
  double coarse_skip_below_px = 2.0;

  // Fine stage: at most so many points in all, within this radius (PTAM §5.5).
  int fine_points = 1000;
  double fine_radius_px = 8;  // level 0; the radius at a level is this over its scale, plus one pixel
  double fine_radius_no_coarse_px = 12;
  // A point that no corner matches is aligned directly from its predicted position.
  bool align_without_corner = true;

  // A warped template is kept while the warp changes by less than this (pixels over the half patch).
  double template_reuse_px = 0.15;
  // A patch is searched only when its plane is seen at a larger cosine than this.
  double min_view_cosine = 0.2;

  // Quality (PTAM §5.6): fractions of attempted points found.
  double good_fraction = 0.3;
  double lost_fraction = 0.13;
  int min_inliers = 20;       // fewer: lost
  double max_sigma = 3.0;     // robust scale of normalised residuals above which a pose is not believed
  int lost_after_frames = 3;  // "more than a few frames"

  // Keyframes (PTAM §6.2).
  int keyframe_interval_frames = 20;
  // A map of fewer keyframes than young_keyframes gets them sooner: its first baseline is short.
  int young_keyframes = 5;
  int young_interval_frames = 5;
  // A view that leaves the mapped part gets them sooner and closer: when fewer points are found than this part of what
  // the last keyframe's neighbourhood gave, or than this number.
  double leaving_part = 0.6;
  int leaving_points = 100;
  int leaving_interval_frames = 4;
  double keyframe_distance_over_depth = 0.10;  // to the nearest keyframe, in mean depths
  double keyframe_angle_rad = 0.35;            // or turned by this much, when it also sees little of the map

  // Recovery (PTAM §5.6).
  int recovery_candidates = 2;  // keyframes tried a frame
  int recovery_min_inliers = 30;
  double recovery_min_fraction = 0.35;

  // Initialisation without key presses.
  double auto_min_motion_px = 0.8;   // median trail length before it is tried
  int auto_max_frames = 120;         // older first frames are replaced
  double auto_min_survivors = 0.35;  // of the trails started

  TrailOptions trails;
  MotionModelOptions motion;

  void validate() const;
};

}  // namespace parallax
