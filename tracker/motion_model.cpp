#include "tracker/motion_model.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/check.h"
#include "core/error.h"

namespace parallax {
namespace {

constexpr double kNominalInterval_s = 1.0 / 30;  // until two frames told better
constexpr double kGapFactor = 1.6;               // a longer wait than this many intervals is a gap
constexpr double kIntervalSmoothing = 0.2;       // weight of the newest interval

void require(bool ok, const char* key, double found, const char* expected) {
  if (!ok) {
    throw InputError(std::string("motion model option ") + key + ": found " + std::to_string(found) + ", expected " +
                     expected);
  }
}

}  // namespace

void MotionModelOptions::validate() const {
  require(decay_per_frame >= 0 && decay_per_frame <= 1, "decay_per_frame", decay_per_frame, "0 to 1");
  require(smoothing > 0 && smoothing <= 1, "smoothing", smoothing, "more than 0, at most 1");
  require(max_extrapolation_frames >= 1, "max_extrapolation_frames", max_extrapolation_frames, "1 or more");
  require(min_prior_disagreement_px >= 0, "min_prior_disagreement_px", min_prior_disagreement_px, "0 or more");
  require(max_prior_rotation_rad > 0, "max_prior_rotation_rad", max_prior_rotation_rad, "more than 0");
  require(min_prior_overlap >= 0 && min_prior_overlap <= 1, "min_prior_overlap", min_prior_overlap, "0 to 1");
}

MotionModel::MotionModel(const CameraModel& camera, const MotionModelOptions& options)
    : camera_(camera), options_(options) {
  options_.validate();
}

void MotionModel::reset() {
  pose_ = RigidTransform();
  time_ = Timestamp{0};
  velocity_.setZero();
  has_pose_ = false;
}

void MotionModel::reset(const RigidTransform& camera_from_world, Timestamp time) {
  reset();
  pose_ = camera_from_world;
  time_ = time;
  has_pose_ = true;
}

// The time over which the velocity acts: the first frame's worth in full, then decaying frame by frame.
double MotionModel::effective_seconds(Timestamp time) const {
  const double elapsed = to_seconds(time - time_);
  if (!(elapsed > 0)) return 0;
  const double interval = frame_interval_s_ > 0 ? frame_interval_s_ : kNominalInterval_s;
  if (elapsed <= kGapFactor * interval) return elapsed;  // jitter of the clock is no gap
  const double frames = std::min(elapsed / interval, options_.max_extrapolation_frames);
  const double d = options_.decay_per_frame;
  return interval * (d < 1 ? (1 - std::pow(d, frames)) / (1 - d) : frames);
}

void MotionModel::note_interval(double seconds) {
  if (!(seconds > 0)) return;
  if (frame_interval_s_ <= 0 || seconds < frame_interval_s_ / kGapFactor) {
    frame_interval_s_ = seconds;
  } else if (seconds < kGapFactor * frame_interval_s_) {
    frame_interval_s_ += kIntervalSmoothing * (seconds - frame_interval_s_);
  } else {
    // a gap, or a camera that became slower: follows slowly
    frame_interval_s_ += 0.05 * (std::min(seconds, 4 * frame_interval_s_) - frame_interval_s_);
  }
}

RigidTransform MotionModel::predict(Timestamp time, const SmallBlurryImage* last,
                                    const SmallBlurryImage* current) const {
  if (!has_pose_) return pose_;
  const RigidTransform step = RigidTransform::exp(velocity_ * effective_seconds(time));
  const RigidTransform model = step * pose_;
  if (last == nullptr || current == nullptr || last->empty() || current->empty() ||
      last->image.size() != current->image.size()) {
    return model;
  }
  const SmallImageAlignment alignment = align_small_images(*last, *current);
  if (!alignment.converged || alignment.overlap < options_.min_prior_overlap) return model;

  // How far the camera's centre moves, in its own frame before the step: camera_last_from_camera_now's translation.
  Eigen::Vector3d moved = step.inverse().t;
  SmallImageAlignment turn = alignment;
  if (scene_depth_m_ > 0) {
    const Eigen::Vector2d& f = camera_.focal_px();
    turn.shift += Eigen::Vector2d(f.x() * moved.x(), f.y() * moved.y()) / scene_depth_m_;
  }
  Eigen::Matrix3d rotation = rotation_from_alignment(camera_, turn);
  const double angle = log_so3(rotation).norm();
  if (!(angle <= options_.max_prior_rotation_rad)) return model;
  // Without a depth a translation looks like a turn: the rotation explains it all, and nothing moves sideways.
  if (scene_depth_m_ <= 0) moved.head<2>().setZero();
  const double disagreement_px = log_so3(rotation * step.R.transpose()).norm() * camera_.mean_focal_px();
  if (disagreement_px < options_.min_prior_disagreement_px) return model;
  return RigidTransform(rotation, -(rotation * moved)) * pose_;
}

void MotionModel::update(const RigidTransform& camera_from_world, Timestamp time) {
  const double elapsed = to_seconds(time - time_);
  if (has_pose_ && elapsed > 0) {
    const Vector6d measured = (camera_from_world * pose_.inverse()).log() / elapsed;
    note_interval(elapsed);
    velocity_ += options_.smoothing * (measured - velocity_);
  }
  pose_ = camera_from_world;
  time_ = time;
  has_pose_ = true;
}

void MotionModel::update_untracked(const RigidTransform& predicted, Timestamp time) {
  const double elapsed = to_seconds(time - time_);
  if (has_pose_ && elapsed > 0) {
    const double interval = frame_interval_s_ > 0 ? frame_interval_s_ : kNominalInterval_s;
    velocity_ *= std::pow(options_.decay_per_frame, std::max(1.0, elapsed / interval));
  }
  pose_ = predicted;
  time_ = time;
  has_pose_ = true;
}

double MotionModel::expected_image_motion_px(double depth_m) const {
  const double interval = frame_interval_s_ > 0 ? frame_interval_s_ : kNominalInterval_s;
  const Vector6d step = velocity_ * interval;
  const double f = camera_.mean_focal_px();
  const double quarter_px = 0.25 * std::hypot(camera_.width(), camera_.height());  // a typical distance from the centre
  const double depth = std::max(depth_m, 1e-6);
  // what a point on the axis and what a point halfway to the corner moves
  const double across = f * std::hypot(step[3], step[4]) + f * std::hypot(step[0], step[1]) / depth;
  const double along = quarter_px * (std::abs(step[5]) + std::abs(step[2]) / depth);
  return across + along;
}

void MotionModel::rebase(const SimilarityTransform& new_from_old) {
  pose_ = new_from_old.rebase(pose_);
  // Increments live in the camera frame: only the unit of length changes.
  velocity_.head<3>() *= new_from_old.s;
  scene_depth_m_ *= new_from_old.s;
}

}  // namespace parallax
