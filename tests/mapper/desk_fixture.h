// Maps of the synthetic desk with exact truth, for the mapper's tests.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "map/shared_map.h"
#include "tests/support/rendered_views.h"

namespace parallax::test {

// Eight views along the table, 4 cm apart.
inline RenderedViews& desk_views() {
  static RenderedViews views(slide(8, 0.04, -0.12));
  return views;
}

inline std::string faults(const Map& map, const CameraModel& camera) {
  std::string out;
  for (const std::string& line : check_consistency(map, camera)) out += line + "\n";
  return out;
}
inline std::string faults(const SharedMap& map, const CameraModel& camera) {
  return map.read([&](const Map& m) { return faults(m, camera); });
}

inline Map copy_of(const SharedMap& map) {
  return map.read([](const Map& m) { return m; });
}

// Puts a map into its shared place, as the mapper does with a new one.
inline void set_map(SharedMap* shared, Map map) {
  shared->replace_map(std::move(map));
  shared->publish();
}

// Root mean square of what the measurements say against the map, in units of their sigma.
inline double reprojection_rms(const Map& map, const CameraModel& camera) {
  double sum = 0;
  int n = 0;
  for (const Keyframe& kf : map.keyframes) {
    for (const Measurement& m : kf.measurements) {
      Eigen::Vector2d px;
      if (!camera.project(kf.camera_from_world * map.points.at(m.point).position, &px)) px.setConstant(1e3);
      sum += (px - m.pixel).squaredNorm() / (m.sigma_px * m.sigma_px);
      n += 2;
    }
  }
  return std::sqrt(sum / std::max(1, n));
}

}  // namespace parallax::test
