#include "app/run_settings.h"

#include "app/named_settings.h"

namespace parallax {
namespace {

SettingTargets targets_of(RunOptions* options) {
  TrackerOptions& t = options->tracker;
  MapperOptions& m = options->mapper;
  return {
      {"tracker.coarse_points", &t.coarse_points},
      {"tracker.coarse_min", &t.coarse_min},
      {"tracker.coarse_radius_px", &t.coarse_radius_px},
      {"tracker.coarse_skip_below_px", &t.coarse_skip_below_px},
      {"tracker.fine_points", &t.fine_points},
      {"tracker.fine_radius_px", &t.fine_radius_px},
      {"tracker.fine_radius_no_coarse_px", &t.fine_radius_no_coarse_px},
      {"tracker.align_without_corner", &t.align_without_corner},
      {"tracker.template_reuse_px", &t.template_reuse_px},
      {"tracker.good_fraction", &t.good_fraction},
      {"tracker.lost_fraction", &t.lost_fraction},
      {"tracker.min_inliers", &t.min_inliers},
      {"tracker.max_sigma", &t.max_sigma},
      {"tracker.keyframe_interval_frames", &t.keyframe_interval_frames},
      {"tracker.young_interval_frames", &t.young_interval_frames},
      {"tracker.young_keyframes", &t.young_keyframes},
      {"tracker.keyframe_distance_over_depth", &t.keyframe_distance_over_depth},
      {"tracker.keyframe_angle_rad", &t.keyframe_angle_rad},
      {"tracker.corner_target_0", &t.corner_targets[0]},
      {"tracker.corner_target_1", &t.corner_targets[1]},
      {"tracker.auto_min_motion_px", &t.auto_min_motion_px},
      {"mapper.initial_baseline_m", &m.initial_baseline_m},
      {"mapper.auto_min_parallax_deg", &m.auto_min_parallax_deg},
      {"mapper.auto_min_parallax_sigmas", &m.auto_min_parallax_sigmas},
      {"mapper.min_shi_tomasi_0", &m.min_shi_tomasi[0]},
      {"mapper.min_shi_tomasi_1", &m.min_shi_tomasi[1]},
      {"mapper.min_shi_tomasi_2", &m.min_shi_tomasi[2]},
      {"mapper.min_shi_tomasi_3", &m.min_shi_tomasi[3]},
      {"mapper.max_new_points_0", &m.max_new_points[0]},
      {"mapper.max_new_points_1", &m.max_new_points[1]},
      {"mapper.max_new_points_2", &m.max_new_points[2]},
      {"mapper.max_new_points_3", &m.max_new_points[3]},
      {"mapper.estimate_normals", &m.estimate_normals},
      {"mapper.remeasure", &m.remeasure},
      {"mapper.wanted_points", &m.wanted_points},
      {"mapper.min_spacing_px", &m.min_spacing_px},
      {"mapper.epipolar_band_px", &m.epipolar_band_px},
      {"mapper.epipolar_uniqueness", &m.epipolar_uniqueness},
      {"mapper.min_triangulation_deg", &m.min_triangulation_deg},
      {"mapper.refind_radius_px", &m.refind_radius_px},
      {"mapper.min_sigma", &m.min_sigma},
      {"mapper.local_keyframes", &m.local_keyframes},
      {"mapper.cull_above_keyframes", &m.cull_above_keyframes},
      {"mapper.max_keyframes", &m.max_keyframes},
      {"mapper.redundant_part", &m.redundant_part},
      {"mapper.close_loops", &m.close_loops},
      {"maps.merge", &options->merge_maps},
  };
}

}  // namespace

void apply_settings(const std::vector<std::string>& settings, RunOptions* options) {
  apply_named_settings(settings, targets_of(options));
  options->tracker.validate();
  options->mapper.validate();
}

}  // namespace parallax
