// A desk of which the tracker is given the true map: three keyframes along the table, and views to track.
#pragma once

#include <memory>
#include <vector>

#include "map/tracking_snapshot.h"
#include "tests/support/rendered_views.h"

namespace parallax::test {

struct DeskMap {
  // 0 to 2: keyframes. 3: between them. 4: turned and nearer. 5: the far corner of the room, never mapped.
  enum View { first, second, third, between, nearer, elsewhere };
  RenderedViews views;
  Map map;
  std::shared_ptr<const TrackingSnapshot> snapshot;

  DeskMap() : views(poses()), map(true_map(&views, {first, second, third}, 120)), snapshot(make_snapshot(map)) {}

  static std::vector<RigidTransform> poses() {
    const RigidTransform nearer =
        above_desk(0.0, 0.12, 0.6) * RigidTransform(exp_so3({0, 0, 0.15}), Eigen::Vector3d::Zero());
    RigidTransform elsewhere = above_desk(0.02);
    elsewhere.t.x() += 20;  // where the scene has its second corner
    return {above_desk(-0.06), above_desk(0.02), above_desk(0.10), above_desk(0.055), nearer, elsewhere};
  }
};

inline DeskMap& desk_map() {
  static DeskMap d;
  return d;
}

}  // namespace parallax::test
