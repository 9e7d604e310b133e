#include "mapper/mapper_options.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <utility>

#include "core/error.h"

namespace parallax {
namespace {

TEST(MapperOptions, DefaultsAreValid) { EXPECT_NO_THROW(MapperOptions().validate()); }

TEST(MapperOptions, AValueOutOfRangeIsNamed) {
  const std::pair<const char*, std::function<void(MapperOptions*)>> breaks[] = {
      {"initial_baseline_m", [](MapperOptions* o) { o->initial_baseline_m = 0; }},
      {"auto_min_parallax_deg", [](MapperOptions* o) { o->auto_min_parallax_deg = -1; }},
      {"initial_min_points", [](MapperOptions* o) { o->initial_min_points = 3; }},
      {"min_spacing_px", [](MapperOptions* o) { o->min_spacing_px = 0; }},
      {"epipolar_uniqueness", [](MapperOptions* o) { o->epipolar_uniqueness = 1.5; }},
      {"min_triangulation_deg", [](MapperOptions* o) { o->min_triangulation_deg = 0; }},
      {"local_keyframes", [](MapperOptions* o) { o->local_keyframes = 1; }},
      {"local_iterations", [](MapperOptions* o) { o->local_iterations = 0; }},
      {"global_iterations", [](MapperOptions* o) { o->global_iterations = 0; }},
      {"threads", [](MapperOptions* o) { o->threads = 0; }},
      {"cull_above_keyframes", [](MapperOptions* o) { o->cull_above_keyframes = 2; }},
      {"redundant_part", [](MapperOptions* o) { o->redundant_part = 0; }},
  };
  for (const auto& [name, make] : breaks) {
    MapperOptions o;
    make(&o);
    try {
      o.validate();
      ADD_FAILURE() << name << " was accepted";
    } catch (const InputError& e) {
      const std::string text = e.what();
      EXPECT_NE(text.find(name), std::string::npos) << text;
      EXPECT_NE(text.find("expected"), std::string::npos) << text;
      EXPECT_EQ(text.find('\n'), std::string::npos);
    }
  }
}

}  // namespace
}  // namespace parallax
