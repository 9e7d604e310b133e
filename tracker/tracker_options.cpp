#include "tracker/tracker_options.h"

#include <cmath>
#include <string>

#include "core/error.h"

namespace parallax {
namespace {

void require(bool ok, const char* key, double found, const char* expected) {
  if (ok) return;
  throw InputError("tracker option " + std::string(key) + ": found " + std::to_string(found) + ", expected " +
                   expected);
}

}  // namespace

void TrackerOptions::validate() const {
  for (int target : corner_targets) require(target > 0, "corner_targets", target, "a positive number of corners");
  require(coarse_points > 0 && coarse_points <= fine_points, "coarse_points", coarse_points, "1 to fine_points");
  require(coarse_min >= 4, "coarse_min", coarse_min, "at least 4");
  require(coarse_radius_px > 0, "coarse_radius_px", coarse_radius_px, "a positive radius in pixels");
  require(fine_points >= 20, "fine_points", fine_points, "at least 20");
  require(fine_radius_px > 0, "fine_radius_px", fine_radius_px, "a positive radius in pixels");
  require(fine_radius_no_coarse_px > 0, "fine_radius_no_coarse_px", fine_radius_no_coarse_px, "a positive radius");
  require(min_view_cosine > 0 && min_view_cosine < 1, "min_view_cosine", min_view_cosine, "between 0 and 1");
  require(lost_fraction > 0 && lost_fraction < good_fraction, "lost_fraction", lost_fraction, "0 to good_fraction");
  require(good_fraction < 1, "good_fraction", good_fraction, "below 1");
  require(min_inliers >= 6, "min_inliers", min_inliers, "at least 6");
  require(lost_after_frames >= 1, "lost_after_frames", lost_after_frames, "at least 1");
  require(keyframe_interval_frames >= 1, "keyframe_interval_frames", keyframe_interval_frames, "at least 1");
  require(keyframe_distance_over_depth > 0, "keyframe_distance_over_depth", keyframe_distance_over_depth, "above 0");
}

}  // namespace parallax
