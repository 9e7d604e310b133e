// Decaying velocity model (PTAM §5.1) with the rotation prior of the small blurry images.
#pragma once

#include "core/camera_model.h"
#include "core/se3.h"
#include "core/small_blurry_image.h"
#include "core/time.h"

namespace parallax {

struct MotionModelOptions {
  double decay_per_frame = 0.9;         // velocity kept from frame to frame (alpha-beta like), PTAM §5.1
  double smoothing = 0.5;               // weight of the newest measured velocity
  double max_extrapolation_frames = 8;  // a gap is bridged at most so far, frames
  double min_prior_disagreement_px =
      3;  // the small images overrule the model beyond this, level-0 px at the image centre
  double max_prior_rotation_rad = 0.6;  // more than this between two frames is a failed alignment
  double min_prior_overlap = 0.5;       // of the small images

  // Throws InputError when a value is out of its range.
  void validate() const;
};

// Works in left increments of camera_from_world. Not thread-safe; belongs to the tracking thread.
class MotionModel {
 public:
  explicit MotionModel(const CameraModel& camera, const MotionModelOptions& options = {});

  void reset();
  void reset(const RigidTransform& camera_from_world, Timestamp time);

  // The pose expected at `time`: velocity over the elapsed time (gaps of missing frames included). When both small
  // images are given, their alignment is sound and it says something else than the model (a fast turn), the rotation
  // comes from them and the camera's translation from the model. The image shift that this translation explains is
  // taken out of the alignment first when set_scene_depth() was told how far the scene is; otherwise the rotation has
  // to explain the whole shift, and the translation across the line of sight is left out.
  RigidTransform predict(Timestamp time, const SmallBlurryImage* last, const SmallBlurryImage* current) const;

  // A tracked pose updates the velocity; an untracked frame only lets it decay (the camera slows and stops).
  void update(const RigidTransform& camera_from_world, Timestamp time);
  void update_untracked(const RigidTransform& predicted, Timestamp time);

  // Typical distance of what the camera sees (metres; 0: unknown). Used by predict() with small images only.
  void set_scene_depth(double depth_m) { scene_depth_m_ = depth_m > 0 ? depth_m : 0; }

  const RigidTransform& pose() const { return pose_; }
  // Velocity in left increments of camera_from_world: metres and radians per second.
  const Vector6d& velocity() const { return velocity_; }
  // Expected image motion to the next frame, level-0 pixels, for a scene at `depth_m`: rotation and translation.
  double expected_image_motion_px(double depth_m) const;
  // The camera is believed nearly stationary (PTAM §6.5): expected image motion below `limit_px`.
  bool is_nearly_still(double depth_m, double limit_px = 1.0) const {
    return expected_image_motion_px(depth_m) < limit_px;
  }

  // The world moved (PTAM map re-scaled or re-aligned): pose and velocity follow without a jump.
  void rebase(const SimilarityTransform& new_from_old);

 private:
  CameraModel camera_;
  MotionModelOptions options_;
  RigidTransform pose_;  // camera_from_world at time_
  Timestamp time_{0};
  Vector6d velocity_ = Vector6d::Zero();  // left increment per second
  double frame_interval_s_ = 0;           // between frames without a gap; 0 until two poses came
  double scene_depth_m_ = 0;
  bool has_pose_ = false;

  double effective_seconds(Timestamp time) const;
  void note_interval(double seconds);
};

}  // namespace parallax
