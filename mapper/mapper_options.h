// Options of the mapping thread. Each states default, unit, meaning and source; validate() throws InputError.
#pragma once

#include <cstdint>
#include <memory>

#include "mapper/dominant_plane.h"
#include "mapper/two_view.h"
#include "place/vocabulary.h"

namespace parallax {

struct MapperOptions {
  // Initialisation (PTAM §6.1).
  double initial_baseline_m = 0.1;  // "the camera translated 10 cm between the stereo pair"
  // For frames chosen automatically: the median parallax in degrees, and over the noise of the matches (how many
  // standard deviations a typical point's depth is above nothing).
  double auto_min_parallax_deg = 0.2;
  double auto_min_parallax_sigmas = 12;
  int initial_min_points = 60;
  double initial_max_sigma_px = 1.5;          // robust scale after the first adjustment
  TwoViewOptions two_view{.sigma_px = 0.35};  // refined trails are good to a fraction of a pixel
  PlaneOptions plane;

  // New points (PTAM §6.2).
  double min_shi_tomasi[4] = {35, 30, 25, 20};  // grey levels squared, a level
  int wanted_points = 150;                      // a keyframe that has fewer, measured and new, takes weaker corners too
  double min_spacing_px = 5;  // between a candidate and an existing measurement, pixels of the candidate's level
  int max_new_points[4] = {350, 180, 90, 40};  // a keyframe and level, for 640x480
  double epipolar_band_px = 1.5;               // distance from the epipolar line, pixels of the level
  double epipolar_uniqueness = 0.7;  // best score must be below this part of the second best elsewhere on the line
  double min_triangulation_deg = 0.4;
  double max_triangulation_error_px = 1.5;  // pixels of the level

  // Measuring known points at their predicted place.
  double refind_radius_px = 4;           // pixels of the level
  double second_chance_radius_px = 1.5;  // pixels of the level (PTAM §6.4: "far tighter")
  // What is not found as it was is looked for in another light too (measure_point): between maps made at different
  // times. Within one session it finds little but weak matches.
  bool other_light = false;

  // Adjustment (PTAM §6.3).
  int local_keyframes = 5;  // the newest and the four nearest
  int local_iterations = 15, global_iterations = 15;
  double min_sigma = 0.2;  // lower bound of the robust scale, in units of a measurement's sigma
  int threads = 1;         // of a solve

  bool estimate_normals = true;  // online patch normals (PTAM §8.2 asks for them)
  bool remeasure = true;         // points whose normal changed are measured again

  // Points that are wrong.
  int bad_after_outliers = 20;  // outliers of the tracked pose, when they are also the larger part
  int bad_after_searches = 60;  // searched so often and found in less than min_found_part
  double min_found_part = 0.08;
  // Keyframes that are wrong, or not needed.
  double keyframe_outlier_part = 0.5;  // of its measurements in one adjustment: the keyframe goes
  int min_keyframe_measurements = 15;
  int cull_above_keyframes = 40;  // redundant ones are culled only above this number
  double redundant_part = 0.9;    // of its points measured by three or more others at the same or a finer level
  int max_keyframes = 150;        // towards this number less redundant ones are culled, above it any (0: no bound)

  // Loops are looked for by these words; null: no loops, whatever is asked for.
  bool close_loops = true;
  std::shared_ptr<const Vocabulary> vocabulary;

  std::uint64_t seed = 1;

  void validate() const;
};

}  // namespace parallax
