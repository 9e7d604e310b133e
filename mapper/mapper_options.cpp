#include "mapper/mapper_options.h"

#include <string>

#include "core/error.h"

namespace parallax {
namespace {

void require(bool ok, const char* key, double found, const char* expected) {
  if (ok) return;
  throw InputError("mapper option " + std::string(key) + ": found " + std::to_string(found) + ", expected " + expected);
}

}  // namespace

void MapperOptions::validate() const {
  require(initial_baseline_m > 0, "initial_baseline_m", initial_baseline_m, "a positive length in metres");
  require(auto_min_parallax_deg > 0, "auto_min_parallax_deg", auto_min_parallax_deg, "a positive angle in degrees");
  require(initial_min_points >= 10, "initial_min_points", initial_min_points, "at least 10");
  require(min_spacing_px > 0, "min_spacing_px", min_spacing_px, "a positive distance in pixels");
  require(epipolar_uniqueness > 0 && epipolar_uniqueness <= 1, "epipolar_uniqueness", epipolar_uniqueness, "0 to 1");
  require(min_triangulation_deg > 0, "min_triangulation_deg", min_triangulation_deg, "a positive angle in degrees");
  require(local_keyframes >= 2, "local_keyframes", local_keyframes, "at least 2");
  require(local_iterations > 0, "local_iterations", local_iterations, "at least 1");
  require(global_iterations > 0, "global_iterations", global_iterations, "at least 1");
  require(threads >= 1 && threads <= 64, "threads", threads, "1 to 64");
  require(cull_above_keyframes >= 3, "cull_above_keyframes", cull_above_keyframes, "at least 3");
  require(max_keyframes == 0 || max_keyframes > cull_above_keyframes, "max_keyframes", max_keyframes,
          "0, or more than cull_above_keyframes");
  require(redundant_part > 0 && redundant_part <= 1, "redundant_part", redundant_part, "0 to 1");
}

}  // namespace parallax
