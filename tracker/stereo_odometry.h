// Stereo odometry (MS §3.1): tracks Shi-Tomasi corners through the left images, finds them in the right ones, and
// estimates the motion from frame to frame; hands a keyframe to the window every 0.2 m or 0.2 rad.
//
// Not thread-safe: one thread steps it. Poses are relative to the last keyframe; see map/stereo_messages.h.
#pragma once

#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "core/small_blurry_image.h"
#include "core/time.h"
#include "map/stereo_messages.h"
#include "tracker/affine_alignment.h"
#include "tracker/stereo_matching.h"
#include "tracker/stereo_options.h"

namespace parallax {

enum class StereoState { started, tracked, few_features, failed };
const char* to_string(StereoState state);

struct StereoTiming {
  double feature_tracking_ms = 0, odometry_ms = 0;  // rows of MS Table 2
};

struct StereoFrameResult {
  int frame = 0;
  Timestamp time{0};
  StereoState state = StereoState::failed;
  std::string reason;  // why it failed, for the user
  int reference = 0;   // keyframe
  RigidTransform reference_from_camera;
  Matrix6d covariance = Matrix6d::Zero();  // of camera_from_reference, left perturbation
  int tracks = 0, inliers = 0, right_matches = 0, hypotheses = 0;
  StereoTiming timing;
  std::optional<StereoKeyframe> keyframe;  // when this frame has become one
};

// What a track looks like now, for pictures.
struct StereoTrackView {
  Eigen::Vector2d left;
  double right_x;  // NaN: not seen
  int age;         // frames
};

class StereoOdometry {
 public:
  // Options are validated; throws InputError.
  // `mask`: where the left image shows something (camera/stereo_rectification); empty: everywhere.
  StereoOdometry(const StereoCamera& camera, const StereoTrackerOptions& options, const GreyImage& mask = {});

  // The next rectified pair; images are shared and must not be written to afterwards.
  StereoFrameResult process(int frame, Timestamp time, const GreyImage& left, const GreyImage& right);

  // What the window has made of a keyframe's surroundings; it may be older than the present one.
  void take(const StereoWindowUpdate& update);

  std::vector<StereoTrackView> tracks() const;
  const StereoCamera& camera() const { return camera_; }

 private:
  struct Track {
    std::int64_t id = 0;
    Eigen::Vector2d left = Eigen::Vector2d::Zero();
    double right_x = 0;
    Eigen::Vector4d point = {0, 0, 1, 0};  // in the reference keyframe's frame
    double sigma_w = 0;                    // of point.w()
    std::shared_ptr<AffineTemplate> window;
    // Where the window was taken, and how the surface lies there: inverse depth (1 / m) at its middle, and its change a
    // pixel, as the right image's shape tells it.
    RigidTransform reference_from_window;
    double inverse_depth = 0;
    Eigen::Vector2d slope = Eigen::Vector2d::Zero(), window_px = Eigen::Vector2d::Zero();
    Eigen::Matrix2d linear = Eigen::Matrix2d::Identity(), right_linear = Eigen::Matrix2d::Identity();
    int age = 0;
    int first_keyframe = -1;  // the first that measured it
    bool seen = false;        // in this frame
  };
  struct Images {
    ImagePyramid left;
    GreyImage right;
    cv::Mat1f left_smooth, right_smooth;
    SmallBlurryImage small;
  };

  void track_features(const RigidTransform& predicted);
  Eigen::Vector2d perspective_of(const Track& track, const RigidTransform& camera_from_reference) const;
  void take_window(Track* track, const RigidTransform& reference_from_camera) const;
  bool refine_window(Track* track, const Eigen::Vector2d& guess, const RigidTransform& pose) const;
  void find_right(Track* track, double guess_x, const RigidTransform& pose) const;
  StereoPoseSummary estimate(const RigidTransform& predicted, RigidTransform* pose);
  StereoPoseObservation observe(const Track& track) const;
  void add_features();
  bool begin_track(const Eigen::Vector2d& corner, Track* track) const;
  void make_keyframe(bool after_failure, StereoFrameResult* result);
  void renew_windows();
  // Of camera_from_reference: both ends are uncertain.
  Matrix6d motion_covariance() const;
  RowSearch row_search() const;

  StereoCamera camera_;
  CameraModel lens_;  // of the left camera
  StereoTrackerOptions options_;
  GreyImage mask_;
  std::mt19937_64 rng_;
  std::unique_ptr<Images> now_, last_;
  std::vector<Track> tracks_;
  std::int64_t next_track_ = 0;
  int frame_ = -1;
  Timestamp time_{0};
  double frame_interval_s_ = 0;

  int keyframe_ = -1;                                // the reference
  int keyframe_tracks_ = 0;                          // it had
  RigidTransform camera_from_reference_, velocity_;  // now_from_last
  // Of the camera against the points: now, and of the reference when it was taken.
  Matrix6d covariance_ = Matrix6d::Zero(), reference_covariance_ = Matrix6d::Zero();
  std::vector<RigidTransform> reference_from_;  // earlier keyframes, the newest last, as odometry had them
  int oldest_keyframe_ = 0;                     // of reference_from_[0]
};

}  // namespace parallax
