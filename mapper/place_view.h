// What a place is known by on one side of an alignment: the map points seen around a keyframe, each with the ray it was
// measured on and the descriptor of what it looks like there.
//
// Plain values; safe from any thread while nobody writes the map.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/binary_descriptor.h"
#include "core/camera_model.h"
#include "core/se3.h"
#include "map/map.h"

namespace parallax {

struct PlacePoint {
  PointId id;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // world
  int view = 0;                                        // row of PlaceView::cameras it was measured in
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();     // level 0, there
  Eigen::Vector3d ray = Eigen::Vector3d::UnitZ();      // unit, camera frame of the view
  double pixels_per_radian = 1;                        // level-0 pixels, of the lens at that place
  double sigma_px = 1;                                 // level-0 pixels
  int level = 0;
  double depth = 1;  // along the ray, metres
  BinaryDescriptor descriptor;
};

struct PlaceView {
  std::vector<RigidTransform> cameras;  // camera_from_world; the keyframe itself, then its neighbours
  std::vector<PlacePoint> points;       // each once, described where it is seen best: those of the keyframe first
};

// The keyframe with so many neighbours at most (those that measure the most of its points). Points for which
// `left_out` holds true (sorted identifiers) are none of it.
PlaceView view_of_place(const Map& map, KeyframeId keyframe, const CameraModel& camera, int neighbours, int max_points,
                        const std::vector<PointId>& left_out);

// The keyframe and its neighbours, as in view_of_place().
std::vector<KeyframeId> keyframes_around(const Map& map, KeyframeId keyframe, int neighbours);

}  // namespace parallax
