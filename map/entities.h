// What a map is made of (PTAM §4): keyframes, points, measurements, the dominant plane. Values; no pointers between
// them. Frames: world is the session's own; poses are camera_from_world; pixels are level 0 unless named otherwise.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/fast.h"
#include "core/image.h"
#include "core/se3.h"
#include "core/small_blurry_image.h"
#include "core/time.h"
#include "map/identifiers.h"

namespace parallax {

// The images of a frame and what the tracker found in them; immutable once shared between threads.
struct FrameImages {
  ImagePyramid pyramid;
  std::array<CornerList, kPyramidLevels> corners;
  SmallBlurryImage small;
};

enum class MeasurementSource : std::uint8_t {
  root,      // the patch's own source: where the point was first seen
  trail,     // initial stereo pair
  tracker,   // found by the tracking thread
  epipolar,  // found by epipolar search
  refind,    // found by the mapper at the predicted position (new point in old keyframe, remaining points in a new one)
  second_chance,  // an outlier measured again (PTAM §6.4)
};

struct Measurement {
  PointId point;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // level 0
  float sigma_px = 1;                               // standard deviation, level-0 pixels
  std::int8_t level = 0;                            // pyramid level it was made at
  MeasurementSource source = MeasurementSource::tracker;
};

struct MapPoint {
  PointId id;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // world
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();    // world, unit, towards the source camera
  KeyframeId source;                                   // keyframe whose pixels are the patch
  int source_level = 0;
  Eigen::Vector2d source_pixel = Eigen::Vector2d::Zero();  // pixels of source_level
  // Rays (z = 1, source camera frame) through the source pixel and its neighbours one source-level pixel to the right
  // and below: what Eq. 7 back-projects onto the patch's plane.
  Eigen::Matrix3d source_rays = Eigen::Matrix3d::Identity();
  bool normal_estimated = false;  // from several views; else parallel to the source's viewing ray

  // What the tracker reported: how often the point was searched, and found, and how often it was an outlier of the
  // pose.
  int searched = 0, found = 0, pose_outliers = 0;

  // Keyframes that measure the point, and keyframes where it was looked for and cannot be measured, both sorted.
  std::vector<KeyframeId> observers;
  std::vector<KeyframeId> failed;
  bool refined_everywhere = false;  // data association refinement has looked at every keyframe so far
};

struct Keyframe {
  KeyframeId id;
  int frame = -1;
  Timestamp time{0};
  RigidTransform camera_from_world;
  std::shared_ptr<const FrameImages> images;
  std::vector<Measurement> measurements;   // sorted by point
  double mean_depth = 1, depth_sigma = 1;  // of its measured points, metres
  bool fixed = false;                      // the datum of the gauge: the first keyframe

  Eigen::Vector3d centre() const { return camera_from_world.inverse().t; }
  const Measurement* find(PointId point) const;
  Measurement* find(PointId point);
};

struct Plane {
  RigidTransform world_from_plane;  // z up, the plane is z = 0
  double extent_m = 0.2;            // half the side of what is drawn
};

}  // namespace parallax
