// Sessions in 3D, as a list of things to draw. Pure functions on values.
//
// Frame of the drawing: upright (z up), metres; sessions that have not met stand side by side along x.
#pragma once

#include <map>

#include "app/orbit_camera.h"
#include "app/session_view_feed.h"
#include "render/draw_list.h"

namespace parallax {

struct SessionViewSettings {
  bool elevation = false;  // height grows with session time, one session above the other (MS Fig. 10e)
  bool ellipses = true, points = true, links = true;
};

// From the global frames to the drawing.
class SessionStage {
 public:
  SessionStage(const SessionViewSnapshot& snapshot, bool elevation);
  // Of session `id`, `seconds` of session time into it.
  Eigen::Vector3d at(const Eigen::Vector3d& global, int id, double seconds) const;
  const Eigen::Matrix3d& upright() const { return upright_; }
  Eigen::Vector3d low() const { return low_; }
  Eigen::Vector3d high() const { return high_; }
  int components() const { return components_; }

 private:
  struct Place {
    double shift_x = 0, base_seconds = 0;
  };
  Eigen::Matrix3d upright_;
  std::map<int, Place> places_;
  double lift_per_second_ = 0;
  bool elevation_;
  int components_ = 0;
  Eigen::Vector3d low_ = Eigen::Vector3d::Zero(), high_ = Eigen::Vector3d::Ones();
};

DrawList session_view_list(const SessionViewSnapshot& snapshot, const SessionViewSettings& settings,
                           const OrbitCamera& camera, int width, int height);

// All of it in sight; the direction is kept.
OrbitCamera fit_to_sessions(const SessionStage& stage, OrbitCamera camera);

}  // namespace parallax
