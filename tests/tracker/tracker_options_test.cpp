#include "tracker/tracker_options.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <utility>

#include "core/error.h"

namespace parallax {
namespace {

TEST(TrackerOptions, DefaultsAreValid) { EXPECT_NO_THROW(TrackerOptions().validate()); }

TEST(TrackerOptions, AValueOutOfRangeIsNamed) {
  const std::pair<const char*, std::function<void(TrackerOptions*)>> breaks[] = {
      {"corner_targets", [](TrackerOptions* o) { o->corner_targets[2] = 0; }},
      {"coarse_points", [](TrackerOptions* o) { o->coarse_points = o->fine_points + 1; }},
      {"coarse_min", [](TrackerOptions* o) { o->coarse_min = 3; }},
      {"coarse_radius_px", [](TrackerOptions* o) { o->coarse_radius_px = 0; }},
      {"fine_points", [](TrackerOptions* o) { o->fine_points = o->coarse_points = 10; }},
      {"fine_radius_px", [](TrackerOptions* o) { o->fine_radius_px = -1; }},
      {"min_view_cosine", [](TrackerOptions* o) { o->min_view_cosine = 1; }},
      {"lost_fraction", [](TrackerOptions* o) { o->lost_fraction = o->good_fraction; }},
      {"good_fraction", [](TrackerOptions* o) { o->good_fraction = 1; }},
      {"min_inliers", [](TrackerOptions* o) { o->min_inliers = 5; }},
      {"lost_after_frames", [](TrackerOptions* o) { o->lost_after_frames = 0; }},
      {"keyframe_interval_frames", [](TrackerOptions* o) { o->keyframe_interval_frames = 0; }},
      {"keyframe_distance_over_depth", [](TrackerOptions* o) { o->keyframe_distance_over_depth = 0; }},
  };
  for (const auto& [name, make] : breaks) {
    TrackerOptions o;
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
