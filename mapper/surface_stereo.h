// The depth of everything a keyframe sees (PTAM §8.2 wants to know what hides virtual things): a sweep of planes
// parallel to the dominant one through neighbouring keyframes (Collins 1996; Gallup et al. 2007), compared by a ternary
// census (Zabih and Woodfill 1994), made smooth by semi-global matching (Hirschmüller 2008). Labels are heights over
// the plane, so that the plane and what lies flat on it cost nothing to believe in.
//
// Not thread-safe. Works in units of a millisecond or two, so that whoever runs it can stop. The result depends on the
// inputs alone, not on where it was stopped.
#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "core/camera_model.h"
#include "core/se3.h"

namespace parallax {

// A keyframe's image without distortion, and where it was taken from. All views share one pinhole camera.
struct SurfaceView {
  cv::Mat1b image;  // 0 where the lens saw nothing
  RigidTransform camera_from_plane;
};

// A pinhole of a keyframe's field of view at `width` pixels or less, and images seen through it.
class SurfaceCamera {
 public:
  SurfaceCamera(const CameraModel& camera, int largest_width);
  double focal_px() const { return focal_; }
  const Eigen::Vector2d& centre_px() const { return centre_; }
  cv::Size size() const { return {map_x_.cols, map_x_.rows}; }
  Eigen::Vector3d ray(int x, int y) const { return {(x - centre_.x()) / focal_, (y - centre_.y()) / focal_, 1.0}; }
  // The pyramid level that see() wants the image of.
  int level() const { return level_; }
  cv::Mat1b see(const cv::Mat1b& image_of_level) const;

 private:
  int level_ = 0;
  double focal_ = 1;
  Eigen::Vector2d centre_;
  cv::Mat1f map_x_, map_y_;
};

class SurfaceStereo {
 public:
  explicit SurfaceStereo(const SurfaceCamera& camera) : camera_(camera) {}

  // Begins with a keyframe and one to four neighbours. Heights in metres over the plane, below the cameras.
  void begin(SurfaceView reference, std::vector<SurfaceView> neighbours, double lowest_m, double highest_m);
  // One unit of work; true while there is more.
  bool step();
  bool busy() const { return stage_ != Stage::idle; }
  // Depth along z, metres, once step() has returned false; 0 where it is not known.
  const cv::Mat1f& depth() const { return depth_; }
  // 255 where the images allow that depth alone; elsewhere (little texture, the rims of things) it is only as the
  // neighbouring pixels have it.
  const cv::Mat1b& sure() const { return sure_; }

 private:
  enum class Stage { idle, compare, forwards, backwards };
  using Codes = std::vector<cv::Mat1b>;

  void compare(int label, std::size_t neighbour);
  void choose(int label);
  void smooth_row(int row, int direction);
  void decide_row(int row);
  double height(double label) const;

  const SurfaceCamera& camera_;
  Stage stage_ = Stage::idle;
  SurfaceView reference_;
  std::vector<SurfaceView> neighbours_;
  double camera_height_ = 1, first_ = 0, spacing_ = 0;  // of inverse distances below the camera
  int labels_ = 0, next_ = 0;
  Codes codes_;  // of the reference
  cv::Mat1b warped_;
  std::array<cv::Mat1b, 4> said_;        // by each neighbour of one label
  std::vector<std::uint8_t> cost_;       // row, column, label
  std::vector<std::uint16_t> smoothed_;  // the same: sum over paths
  std::vector<std::uint16_t> paths_[2];  // of two rows: direction, column, label
  cv::Mat1f depth_;
  cv::Mat1b sure_;
};

}  // namespace parallax
