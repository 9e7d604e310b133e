#include "tracker/stereo_options.h"

#include <string>

#include "core/error.h"

namespace parallax {
namespace {

void require(bool ok, const char* key, double found, const char* expected) {
  if (ok) return;
  throw InputError("stereo option " + std::string(key) + ": found " + std::to_string(found) + ", expected " + expected);
}

}  // namespace

void StereoTrackerOptions::validate() const {
  require(features >= 20 && features <= 5000, "features", features, "20 to 5000");
  require(min_distance_px >= 3 && min_distance_px <= 200, "min_distance_px", min_distance_px, "3 to 200 pixels");
  require(min_corner_score > 0, "min_corner_score", min_corner_score, "above 0");
  require(few_features >= 0, "few_features", few_features, "0 or more");
  require(min_inliers >= 6 && min_inliers <= features, "min_inliers", min_inliers, "6 to features");
  require(min_correlation > 0 && min_correlation < 1, "min_correlation", min_correlation, "between 0 and 1");
  require(max_round_trip_px > 0, "max_round_trip_px", max_round_trip_px, "above 0");
  require(max_row_difference_px > 0, "max_row_difference_px", max_row_difference_px, "above 0");
  require(covariance_part > 0, "covariance_part", covariance_part, "above 0");
  require(nearest_m > 0, "nearest_m", nearest_m, "above 0");
  require(sigma_px > 0, "sigma_px", sigma_px, "above 0");
  require(keyframe_distance_m > 0, "keyframe_distance_m", keyframe_distance_m, "above 0");
  require(keyframe_angle_rad > 0, "keyframe_angle_rad", keyframe_angle_rad, "above 0");
  require(keyframe_kept >= 0 && keyframe_kept < 1, "keyframe_kept", keyframe_kept, "0 to below 1");
  require(failure_sigma_m > 0, "failure_sigma_m", failure_sigma_m, "above 0");
  require(failure_sigma_rad > 0, "failure_sigma_rad", failure_sigma_rad, "above 0");
}

}  // namespace parallax
