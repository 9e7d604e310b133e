#include "app/session_options.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <sstream>
#include <type_traits>
#include <vector>

#include "core/error.h"

namespace parallax {
namespace {

// An option that is added must be added below too.
static_assert(sizeof(TrackerOptions) == 288 && sizeof(MapperOptions) == 328, "the options and the list below differ");

template <class Options, class Visit>
void visit_tracker(Options& t, const Visit& visit) {
  for (int level = 0; level < kPyramidLevels; ++level) visit("tracker.corner_target", t.corner_targets[level]);
  visit("tracker.coarse_points", t.coarse_points);
  visit("tracker.coarse_min", t.coarse_min);
  visit("tracker.coarse_radius_px", t.coarse_radius_px);
  visit("tracker.coarse_skip_below_px", t.coarse_skip_below_px);
  visit("tracker.fine_points", t.fine_points);
  visit("tracker.fine_radius_px", t.fine_radius_px);
  visit("tracker.fine_radius_no_coarse_px", t.fine_radius_no_coarse_px);
  visit("tracker.align_without_corner", t.align_without_corner);
  visit("tracker.template_reuse_px", t.template_reuse_px);
  visit("tracker.min_view_cosine", t.min_view_cosine);
  visit("tracker.good_fraction", t.good_fraction);
  visit("tracker.lost_fraction", t.lost_fraction);
  visit("tracker.min_inliers", t.min_inliers);
  visit("tracker.max_sigma", t.max_sigma);
  visit("tracker.lost_after_frames", t.lost_after_frames);
  visit("tracker.keyframe_interval_frames", t.keyframe_interval_frames);
  visit("tracker.young_keyframes", t.young_keyframes);
  visit("tracker.young_interval_frames", t.young_interval_frames);
  visit("tracker.leaving_part", t.leaving_part);
  visit("tracker.leaving_points", t.leaving_points);
  visit("tracker.leaving_interval_frames", t.leaving_interval_frames);
  visit("tracker.keyframe_distance_over_depth", t.keyframe_distance_over_depth);
  visit("tracker.keyframe_angle_rad", t.keyframe_angle_rad);
  visit("tracker.recovery_candidates", t.recovery_candidates);
  visit("tracker.recovery_min_inliers", t.recovery_min_inliers);
  visit("tracker.recovery_min_fraction", t.recovery_min_fraction);
  visit("tracker.auto_min_motion_px", t.auto_min_motion_px);
  visit("tracker.auto_max_frames", t.auto_max_frames);
  visit("tracker.auto_min_survivors", t.auto_min_survivors);
  visit("trails.max_trails", t.trails.max_trails);
  visit("trails.min_distance_px", t.trails.min_distance_px);
  visit("trails.max_back_error_px", t.trails.max_back_error_px);
  visit("trails.search_radius_px", t.trails.search_radius_px);
  visit("motion.decay_per_frame", t.motion.decay_per_frame);
  visit("motion.smoothing", t.motion.smoothing);
  visit("motion.max_extrapolation_frames", t.motion.max_extrapolation_frames);
  visit("motion.min_prior_disagreement_px", t.motion.min_prior_disagreement_px);
  visit("motion.max_prior_rotation_rad", t.motion.max_prior_rotation_rad);
  visit("motion.min_prior_overlap", t.motion.min_prior_overlap);
}

template <class Options, class Visit>
void visit_mapper(Options& m, const Visit& visit) {
  visit("mapper.initial_baseline_m", m.initial_baseline_m);
  visit("mapper.auto_min_parallax_deg", m.auto_min_parallax_deg);
  visit("mapper.auto_min_parallax_sigmas", m.auto_min_parallax_sigmas);
  visit("mapper.initial_min_points", m.initial_min_points);
  visit("mapper.initial_max_sigma_px", m.initial_max_sigma_px);
  visit("two_view.sigma_px", m.two_view.sigma_px);
  visit("two_view.min_inliers", m.two_view.min_inliers);
  visit("two_view.min_parallax_deg", m.two_view.min_parallax_deg);
  visit("two_view.min_inlier_fraction", m.two_view.min_inlier_fraction);
  visit("two_view.max_hypotheses", m.two_view.max_hypotheses);
  visit("plane.hypotheses", m.plane.hypotheses);
  visit("plane.threshold_over_depth", m.plane.threshold_over_depth);
  visit("plane.min_inlier_fraction", m.plane.min_inlier_fraction);
  visit("plane.close_fit", m.plane.close_fit);
  for (int level = 0; level < kPyramidLevels; ++level) visit("mapper.min_shi_tomasi", m.min_shi_tomasi[level]);
  visit("mapper.wanted_points", m.wanted_points);
  visit("mapper.min_spacing_px", m.min_spacing_px);
  for (int level = 0; level < kPyramidLevels; ++level) visit("mapper.max_new_points", m.max_new_points[level]);
  visit("mapper.epipolar_band_px", m.epipolar_band_px);
  visit("mapper.epipolar_uniqueness", m.epipolar_uniqueness);
  visit("mapper.min_triangulation_deg", m.min_triangulation_deg);
  visit("mapper.max_triangulation_error_px", m.max_triangulation_error_px);
  visit("mapper.refind_radius_px", m.refind_radius_px);
  visit("mapper.second_chance_radius_px", m.second_chance_radius_px);
  visit("mapper.local_keyframes", m.local_keyframes);
  visit("mapper.local_iterations", m.local_iterations);
  visit("mapper.global_iterations", m.global_iterations);
  visit("mapper.min_sigma", m.min_sigma);
  visit("mapper.threads", m.threads);
  visit("mapper.estimate_normals", m.estimate_normals);
  visit("mapper.remeasure", m.remeasure);
  visit("mapper.bad_after_outliers", m.bad_after_outliers);
  visit("mapper.bad_after_searches", m.bad_after_searches);
  visit("mapper.min_found_part", m.min_found_part);
  visit("mapper.keyframe_outlier_part", m.keyframe_outlier_part);
  visit("mapper.min_keyframe_measurements", m.min_keyframe_measurements);
  visit("mapper.cull_above_keyframes", m.cull_above_keyframes);
  visit("mapper.max_keyframes", m.max_keyframes);
  visit("mapper.redundant_part", m.redundant_part);
  visit("mapper.close_loops", m.close_loops);
  visit("mapper.seed", m.seed);
}

template <class T>
std::string text_of(T value) {
  if constexpr (std::is_floating_point_v<T>) {
    char text[64];
    std::snprintf(text, sizeof text, "%a", value);
    return text;
  } else {
    return std::to_string(value);
  }
}

// False when the text is not wholly a value of the type.
template <class T>
bool parse_value(const std::string& text, T* value) {
  if (text.empty()) return false;
  char* end = nullptr;
  if constexpr (std::is_floating_point_v<T>) {
    *value = std::strtod(text.c_str(), &end);
    if (!std::isfinite(*value)) return false;
  } else if constexpr (std::is_same_v<T, bool>) {
    if (text != "0" && text != "1") return false;
    *value = text == "1";
    return true;
  } else if constexpr (std::is_unsigned_v<T>) {
    if (text[0] == '-') return false;
    *value = std::strtoull(text.c_str(), &end, 10);
  } else {
    const long long number = std::strtoll(text.c_str(), &end, 10);
    if (number < 0 || number > std::numeric_limits<T>::max()) return false;
    *value = static_cast<T>(number);
  }
  return end == text.c_str() + text.size();
}

}  // namespace

std::string exact_text(const RunOptions& options) {
  std::string out;
  const auto visit = [&](const char* name, const auto& value) {
    out += std::string(name) + " " + text_of(value) + "\n";
  };
  visit("automatic", options.automatic_initialisation());
  visit_tracker(options.tracker, visit);
  visit_mapper(options.mapper, visit);
  return out;
}

RunOptions parse_exact_options(const std::string& text, const std::string& name) {
  RunOptions out;
  std::istringstream lines(text);
  int number = 0;
  const auto fail = [&](const std::string& found, const std::string& expected) {
    throw InputError(name + ": options, line " + std::to_string(number) + ": found " + found + ", expected " +
                     expected);
  };
  const auto visit = [&](const char* key, auto& value) {
    std::string line;
    ++number;
    if (!std::getline(lines, line)) fail("the end", key);
    const auto space = line.find(' ');
    if (line.substr(0, space) != key) fail("'" + line.substr(0, 60) + "'", key);
    if (space == std::string::npos || !parse_value(line.substr(space + 1), &value))
      fail("'" + line.substr(0, 60) + "'", std::string(key) + " and a number");
  };
  bool automatic = true;
  visit("automatic", automatic);
  visit_tracker(out.tracker, visit);
  visit_mapper(out.mapper, visit);
  std::string rest;
  ++number;
  if (std::getline(lines, rest)) fail("'" + rest.substr(0, 60) + "'", "the end");
  out.manual_initialisation = !automatic;
  try {
    out.tracker.validate();
    out.mapper.validate();
  } catch (const InputError& e) {
    throw InputError(name + ": options: " + e.what());
  }
  return out;
}

}  // namespace parallax
