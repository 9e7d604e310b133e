// The textured map (MS Fig. 6c): the disparities of every keyframe become coloured points, one a voxel.
//
// A point belongs to the keyframe that saw it best and is kept in its camera's frame, so that a corrected pose takes
// its points along. A later keyframe that sees a point at its place makes it surer; one that sees through it takes it
// away; one that sees the voxel better (nearer, so with less variance) puts its own in. Memory is bounded: with too
// many points the voxels grow.
//
// Frames: `world` is that of the poses handed in, metres. Not thread-safe: one thread adds, moves and reads.
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <unordered_map>
#include <vector>

#include "core/image.h"
#include "core/point_cloud.h"
#include "core/se3.h"
#include "core/stereo_camera.h"
#include "mapper/dense_disparity.h"

namespace parallax {

struct TexturedMapOptions {
  double voxel_m = 0.03;              // side; grows by the factor 1.5 when there are too many points
  std::size_t most_points = 2000000;  // some 100 MB
  double disparity_sigma_px = 0.3;    // of the dense disparity
  double most_relative_sigma =
      0.03;              // of depth: what is less sure is not taken; with the line above, disparities from 10
  int step_px = 2;       // every so many columns and rows of the disparity map become points
  int least_views = 2;   // keyframes that must have seen a point for it to be handed out
  int agree_sigmas = 3;  // within which a keyframe sees the same point
  DisparityOptions disparity;

  void validate() const;  // throws InputError naming the field
};

struct TexturedKeyframe {
  int keyframe = 0;  // a number of the caller's, for move(); not used before
  RigidTransform world_from_camera;
  GreyImage left, right;
  cv::Mat3b colour;  // BGR, of the left image; empty: points are grey
};

class TexturedMap {
 public:
  explicit TexturedMap(const StereoCamera& camera, const TexturedMapOptions& options = {});

  // Some 60 ms for 512x384. CHECK on a number that is there already and on images of another size.
  void add(const TexturedKeyframe& keyframe);
  // The same with disparities that are known (0: none).
  void add(const TexturedKeyframe& keyframe, const cv::Mat1f& disparity);

  // A keyframe has a better pose: its points go along. Unknown keyframes are passed over. What comes to lie in one
  // voxel is thinned the next time points are added or read.
  void move(int keyframe, const RigidTransform& world_from_camera);

  // Those that are seen by enough keyframes, in the order of keyframes.
  std::vector<ColouredPoint> points();

  std::size_t size() const { return alive_; }
  double voxel_m() const { return voxel_m_; }  // as it is now
  int keyframes() const { return static_cast<int>(keyframes_.size()); }

 private:
  struct Point {
    Eigen::Vector3f place;  // in the keyframe's camera
    float variance;         // of the depth, square metres
    float nearest_m;        // depth at which its colour was seen
    std::array<std::uint8_t, 3> rgb;
    std::uint8_t views;  // 0: removed
    std::uint8_t through;
  };
  struct Keyframe {
    int number;
    RigidTransform world_from_camera;
    std::vector<Point> points;
  };
  struct Place {
    std::uint32_t keyframe, point;
  };
  using Voxel = std::uint64_t;

  Voxel voxel_of(const Eigen::Vector3d& world) const;
  Eigen::Vector3d world_of(Place place) const;
  Point& point_at(Place place) { return keyframes_[place.keyframe].points[place.point]; }
  void remove(Place place, Voxel voxel);
  // Whether the point is in its voxel now; else it is removed, having lost against another.
  bool claim(Place place);
  // Points of earlier keyframes, against what this one sees at their place; returns where it sees them again (255).
  cv::Mat1b compare_with(const TexturedKeyframe& keyframe, const cv::Mat1f& disparity);
  void agree(Place place, double depth, double variance, const RigidTransform& camera_from_other);
  // Points for what is not explained by those that are there.
  void insert(const TexturedKeyframe& keyframe, const cv::Mat1f& disparity, const cv::Mat1b& explained);
  void rebuild();

  StereoCamera camera_;
  TexturedMapOptions options_;
  DenseDisparity matcher_;
  double voxel_m_;
  std::vector<Keyframe> keyframes_;
  std::unordered_map<int, std::uint32_t> by_number_;
  std::unordered_map<Voxel, Place> voxels_;
  std::size_t alive_ = 0;
  bool moved_ = false;
};

}  // namespace parallax
