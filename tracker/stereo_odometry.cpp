#include "tracker/stereo_odometry.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/check.h"
#include "tracker/stereo_corners.h"
#include "tracker/stereo_flow.h"

namespace parallax {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr int kIterations = 10;             // of a window's alignment
constexpr double kCapture_px = 4;           // a window settles this near to where it was looked for, else elsewhere
constexpr double kUnknownDepth_m = 4;       // 1 / sigma of the inverse depth of what the right camera does not see
constexpr double kOldestShape = 1.7;        // a window that looks so much larger or smaller is taken anew
constexpr double kSteepest = 0.02;          // change of inverse depth a pixel, in parts of it
constexpr std::size_t kKeyframesKept = 40;  // whose place the tracker still knows when the window answers

Eigen::Vector4d moved(const RigidTransform& b_from_a, const Eigen::Vector4d& point) {
  Eigen::Vector4d out;
  out << b_from_a.R * point.head<3>() + b_from_a.t * point.w(), point.w();
  return out;
}

// (u_left, u_right, v) of a homogeneous point; false behind the camera.
bool project(const StereoCamera& camera, const RigidTransform& pose, const Eigen::Vector4d& point,
             Eigen::Vector3d* pixel) {
  const Eigen::Vector4d x = moved(pose, point);
  if (!(x.z() > 1e-6)) return false;
  const double u = camera.focal_px.x() * x.x() / x.z() + camera.centre_px.x();
  *pixel = {u, u - camera.focal_px.x() * camera.baseline_m * x.w() / x.z(),
            camera.focal_px.y() * x.y() / x.z() + camera.centre_px.y()};
  return true;
}

void normalise(Eigen::Vector4d* point, double* sigma_w) {
  const double norm = point->norm();
  *point /= norm;
  *sigma_w /= norm;
}

}  // namespace

const char* to_string(StereoState state) {
  switch (state) {
    case StereoState::started:
      return "started";
    case StereoState::tracked:
      return "tracked";
    case StereoState::few_features:
      return "few features";
    case StereoState::failed:
      return "failed";
  }
  return "?";
}

StereoOdometry::StereoOdometry(const StereoCamera& camera, const StereoTrackerOptions& options, const GreyImage& mask)
    : camera_(camera),
      lens_(CameraModelKind::pinhole, camera.width, camera.height, camera.focal_px, camera.centre_px),
      options_(options),
      mask_(mask),
      rng_(options.seed) {
  options_.validate();
}

RowSearch StereoOdometry::row_search() const {
  RowSearch search;
  search.max_disparity_px = std::min(camera_.disparity_px(options_.nearest_m), 0.4 * camera_.width);
  search.max_row_difference_px = options_.max_row_difference_px;
  search.min_correlation = options_.min_correlation;
  search.max_round_trip_px = options_.max_round_trip_px;
  return search;
}

// Of a plane: the depth at a pixel d of the window, seen from here, is in proportion to 1 + h . d.
Eigen::Vector2d StereoOdometry::perspective_of(const Track& track, const RigidTransform& camera_from_reference) const {
  const RigidTransform here_from_window = camera_from_reference * track.reference_from_window;
  const Eigen::Vector3d axis = here_from_window.R.row(2);
  const double depth = axis.dot(camera_.ray(track.window_px)) + here_from_window.t.z() * track.inverse_depth;
  if (!(depth > 0.1)) return Eigen::Vector2d::Zero();
  return (axis.head<2>().cwiseQuotient(camera_.focal_px) + here_from_window.t.z() * track.slope) / depth;
}

// A window taken here: the shape of the right image against the left one tells how the surface lies.
void StereoOdometry::take_window(Track* track, const RigidTransform& reference_from_camera) const {
  track->reference_from_window = reference_from_camera;
  track->window_px = track->left;
  track->inverse_depth = 0;
  track->slope.setZero();
  if (!std::isfinite(track->right_x)) return;
  const double fb = camera_.focal_px.x() * camera_.baseline_m;
  track->inverse_depth = (track->left.x() - track->right_x) / fb;
  const Eigen::Matrix2d right_from_left = track->right_linear * track->linear.inverse();
  track->slope = Eigen::Vector2d(1 - right_from_left(0, 0), -right_from_left(0, 1)) / fb;
  // No surface that is seen from both cameras is steeper.
  const double steepest = kSteepest * track->inverse_depth;
  if (track->slope.norm() > steepest) track->slope *= steepest / track->slope.norm();
}

bool StereoOdometry::refine_window(Track* track, const Eigen::Vector2d& guess, const RigidTransform& pose) const {
  const AffineTemplate::Result found =
      track->window->align(now_->left_smooth, guess, track->linear, true, kIterations, perspective_of(*track, pose));
  if (!found.converged || found.correlation < options_.min_correlation ||
      (found.position - guess).norm() > kCapture_px || !camera_.in_image(found.position, 4))
    return false;
  const Eigen::Vector2d shape = Eigen::JacobiSVD<Eigen::Matrix2d>(found.linear).singularValues();
  if (!(shape[0] < 3 && shape[1] > 0.3)) return false;
  track->right_linear = track->right_linear * track->linear.inverse() * found.linear;
  track->linear = found.linear;
  track->left = found.position;
  return true;
}

void StereoOdometry::find_right(Track* track, double guess_x, const RigidTransform& pose) const {
  track->right_x = kNaN;
  const auto match = align_right(*track->window, now_->right_smooth, guess_x, track->left.y(), track->right_linear,
                                 row_search(), perspective_of(*track, pose));
  if (!match || std::abs(match->x - guess_x) > kCapture_px) return;
  track->right_x = match->x;
  track->right_linear = match->linear;
}

// Marks what is found as seen.
void StereoOdometry::track_features(const RigidTransform& predicted) {
  FlowOptions flow;
  flow.max_round_trip_px = options_.max_round_trip_px;
  for (Track& track : tracks_) {
    Eigen::Vector3d expected;
    if (track.seen || !project(camera_, predicted, track.point, &expected)) continue;
    const auto found = track_forward_backward(last_->left, now_->left, track.left, {expected.x(), expected.z()}, flow);
    if (!found || !refine_window(&track, *found, predicted)) continue;
    track.seen = true;
    find_right(&track, track.left.x() - (expected.x() - expected.y()), predicted);
  }
}

StereoPoseObservation StereoOdometry::observe(const Track& track) const {
  return {track.point, track.sigma_w, {track.left.x(), track.right_x, track.left.y()}, options_.sigma_px};
}

// From what was seen; what does not agree is not seen any more. Then what the flow has missed is looked for where the
// pose says it must be.
StereoPoseSummary StereoOdometry::estimate(const RigidTransform& predicted, RigidTransform* pose) {
  std::vector<StereoPoseObservation> observations;
  std::vector<Track*> of;
  for (Track& track : tracks_) {
    if (!track.seen) continue;
    observations.push_back(observe(track));
    of.push_back(&track);
  }
  const std::array<RigidTransform, 2> guesses = {predicted, camera_from_reference_};
  std::vector<std::uint8_t> inlier;
  RigidTransform found = predicted;
  StereoPoseSummary summary = find_stereo_pose(camera_, observations, guesses, options_.pose, &rng_, &found, &inlier);
  if (!summary.ok || summary.inliers < options_.min_inliers) {
    summary.ok = false;
    return summary;
  }
  const int hypotheses = summary.hypotheses;
  const auto keep_inliers = [&] {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < of.size(); ++i) {
      of[i]->seen = inlier[i] != 0;
      if (!inlier[i]) continue;
      observations[kept] = observations[i];
      of[kept++] = of[i];
    }
    observations.resize(kept);
    of.resize(kept);
  };
  keep_inliers();
  summary = refine_stereo_pose(camera_, observations, options_.pose, &found, &inlier);
  if (summary.ok) {
    keep_inliers();
    bool more = false;
    for (Track& track : tracks_) {
      Eigen::Vector3d expected;
      if (track.seen || !project(camera_, found, track.point, &expected) ||
          !camera_.in_image({expected.x(), expected.z()}, 6) ||
          !refine_window(&track, {expected.x(), expected.z()}, found))
        continue;
      find_right(&track, track.left.x() - (expected.x() - expected.y()), found);
      track.seen = more = true;
      observations.push_back(observe(track));
      of.push_back(&track);
    }
    if (more) {
      summary = refine_stereo_pose(camera_, observations, options_.pose, &found, &inlier);
      if (summary.ok) keep_inliers();
    }
  }
  summary.hypotheses = hypotheses;
  summary.ok = summary.ok && summary.inliers >= options_.min_inliers;
  if (summary.ok) *pose = found;
  return summary;
}

bool StereoOdometry::begin_track(const Eigen::Vector2d& corner, Track* track) const {
  auto window = std::make_shared<AffineTemplate>();
  if (!window->prepare(now_->left_smooth, corner)) return false;
  track->left = corner;
  track->window = window;
  track->right_x = kNaN;
  const RowSearch search = row_search();
  if (const auto row = search_row(now_->left.level[0], now_->right, corner, search)) {
    if (const auto match =
            align_right(*window, now_->right_smooth, *row, corner.y(), Eigen::Matrix2d::Identity(), search)) {
      // The way back must end where it began.
      AffineTemplate seen;
      if (seen.prepare(now_->right_smooth, {match->x, corner.y()})) {
        const auto back = seen.align(now_->left_smooth, corner, match->linear.inverse(), true, kIterations);
        if (back.converged && (back.position - corner).norm() < search.max_round_trip_px) {
          track->right_x = match->x;
          track->right_linear = match->linear;
        }
      }
    }
  }
  const double fb = camera_.focal_px.x() * camera_.baseline_m;
  const double disparity = std::isfinite(track->right_x) ? corner.x() - track->right_x : 0;
  track->point << camera_.ray(corner), std::max(0.0, disparity) / fb;
  track->sigma_w = std::isfinite(track->right_x) ? std::numbers::sqrt2 * options_.sigma_px / fb : 1 / kUnknownDepth_m;
  const RigidTransform reference_from_camera = camera_from_reference_.inverse();
  track->point = moved(reference_from_camera, track->point);
  normalise(&track->point, &track->sigma_w);
  take_window(track, reference_from_camera);
  track->seen = true;
  return true;
}

void StereoOdometry::add_features() {
  CornerSearch search;
  search.wanted = options_.features;
  search.min_distance_px = options_.min_distance_px;
  search.min_score = options_.min_corner_score;
  search.mask = mask_;
  std::vector<Eigen::Vector2d> taken;
  for (const Track& track : tracks_) taken.push_back(track.left);
  for (const Eigen::Vector2d& corner : find_stereo_corners(now_->left.level[0], taken, search)) {
    Track track;
    if (!begin_track(corner, &track)) continue;
    track.id = next_track_++;
    tracks_.push_back(std::move(track));
  }
}

void StereoOdometry::renew_windows() {
  for (Track& track : tracks_) {
    const Eigen::Vector2d shape = Eigen::JacobiSVD<Eigen::Matrix2d>(track.linear).singularValues();
    if (shape[0] < kOldestShape && shape[1] > 1 / kOldestShape) continue;
    auto window = std::make_shared<AffineTemplate>();
    if (!window->prepare(now_->left_smooth, track.left)) continue;
    track.window = window;
    take_window(&track, RigidTransform());
    track.right_linear = track.right_linear * track.linear.inverse();
    track.linear.setIdentity();
  }
}

void StereoOdometry::make_keyframe(bool after_failure, StereoFrameResult* result) {
  StereoKeyframe keyframe;
  const RigidTransform this_from_previous = camera_from_reference_;
  keyframe.index = ++keyframe_;
  keyframe.frame = frame_;
  keyframe.time = time_;
  keyframe.after_failure = after_failure;
  if (keyframe.index > 0) {
    keyframe.previous_from_this = this_from_previous.inverse();
    const Matrix6d adjoint = keyframe.previous_from_this.adjoint();
    keyframe.covariance = adjoint * motion_covariance() * adjoint.transpose();
  }
  for (RigidTransform& reference_from_earlier : reference_from_)
    reference_from_earlier = this_from_previous * reference_from_earlier;
  reference_from_.emplace_back();
  if (reference_from_.size() > kKeyframesKept) {
    reference_from_.erase(reference_from_.begin());
    ++oldest_keyframe_;
  }
  for (Track& track : tracks_) {
    track.point = moved(this_from_previous, track.point);
    track.reference_from_window = this_from_previous * track.reference_from_window;
    normalise(&track.point, &track.sigma_w);
    if (track.first_keyframe < 0) track.first_keyframe = keyframe_;
    keyframe.measurements.push_back({track.id, {track.left.x(), track.right_x, track.left.y()}, track.point});
  }
  renew_windows();
  keyframe.left = now_->left.level[0];
  keyframe.right = now_->right;
  keyframe_tracks_ = static_cast<int>(tracks_.size());
  camera_from_reference_ = RigidTransform();
  reference_covariance_ = after_failure ? Matrix6d::Zero() : covariance_;
  covariance_.setZero();
  result->reference = keyframe_;
  result->keyframe = std::move(keyframe);
}

StereoFrameResult StereoOdometry::process(int frame, Timestamp time, const GreyImage& left, const GreyImage& right) {
  PARALLAX_CHECK(left.cols == camera_.width && left.rows == camera_.height && right.size() == left.size(),
                 "a stereo pair of another size than its camera's");
  const auto begin = SteadyClock::now();
  const double interval_s = to_seconds(time - time_);
  frame_ = frame;
  time_ = time;
  last_ = std::move(now_);
  now_ = std::make_unique<Images>();
  build_pyramid(left, &now_->left);
  now_->right = right;
  now_->left_smooth = smooth_for_alignment(left);
  now_->right_smooth = smooth_for_alignment(right);
  now_->small = make_small_blurry_image(now_->left);

  StereoFrameResult result;
  result.frame = frame;
  result.time = time;
  StereoPoseSummary summary;
  RigidTransform pose;
  if (last_ && !tracks_.empty()) {
    // The motion goes on as it was, over the time that has passed.
    const double part = frame_interval_s_ > 0 ? std::clamp(interval_s / frame_interval_s_, 0.0, 4.0) : 1;
    const RigidTransform moved_on = RigidTransform::exp(part * velocity_.log());
    RigidTransform predicted = moved_on * camera_from_reference_;
    for (Track& track : tracks_) track.seen = false, ++track.age;
    track_features(predicted);
    result.timing.feature_tracking_ms = milliseconds_since(begin);
    const auto odometry = SteadyClock::now();
    summary = estimate(predicted, &pose);
    if (!summary.ok) {
      // Another turn than expected: the images as a whole tell how far.
      const SmallImageAlignment turn = align_small_images(last_->small, now_->small);
      if (turn.converged && turn.overlap > 0.4) {
        predicted =
            RigidTransform(rotation_from_alignment(lens_, turn), Eigen::Vector3d::Zero()) * camera_from_reference_;
        for (Track& track : tracks_) track.seen = false;
        track_features(predicted);
        summary = estimate(predicted, &pose);
      }
    }
    result.timing.odometry_ms = milliseconds_since(odometry);
  }
  result.hypotheses = summary.hypotheses;
  if (interval_s > 0) frame_interval_s_ = interval_s;
  const bool first = keyframe_ < 0;
  if (summary.ok) {
    velocity_ = pose * camera_from_reference_.inverse();
    camera_from_reference_ = pose;
    covariance_ = options_.covariance_part * summary.covariance;
    std::erase_if(tracks_, [](const Track& track) { return !track.seen; });
    result.inliers = summary.inliers;
    result.tracks = static_cast<int>(tracks_.size());
    result.state = result.inliers < options_.few_features ? StereoState::few_features : StereoState::tracked;
    int kept = 0;
    for (const Track& track : tracks_) {
      kept += static_cast<int>(track.first_keyframe >= 0);
      result.right_matches += static_cast<int>(std::isfinite(track.right_x));
    }
    const auto topping_up = SteadyClock::now();
    add_features();
    result.timing.feature_tracking_ms += milliseconds_since(topping_up);
    const bool far = camera_from_reference_.inverse().t.norm() >= options_.keyframe_distance_m ||
                     camera_from_reference_.angle() >= options_.keyframe_angle_rad;
    if (far || kept < options_.keyframe_kept * keyframe_tracks_) make_keyframe(false, &result);
  } else {
    // Begins anew where it was last known to be (MS §5.1).
    tracks_.clear();
    velocity_ = RigidTransform();
    add_features();
    int matched = 0;
    for (const Track& track : tracks_) matched += static_cast<int>(std::isfinite(track.right_x));
    result.tracks = static_cast<int>(tracks_.size());
    result.right_matches = matched;
    if (matched < options_.min_inliers) {
      result.reason = result.tracks < options_.min_inliers
                          ? "too little texture: " + std::to_string(result.tracks) + " corners"
                          : "only " + std::to_string(matched) + " of " + std::to_string(result.tracks) +
                                " corners found in the right image";
      tracks_.clear();
    } else {
      if (!first) {
        result.reason = "too few features agree on a motion";
        const double m2 = options_.failure_sigma_m * options_.failure_sigma_m;
        const double r2 = options_.failure_sigma_rad * options_.failure_sigma_rad;
        covariance_ = (Vector6d() << m2, m2, m2, r2, r2, r2).finished().asDiagonal();
      }
      make_keyframe(!first, &result);
      result.state = StereoState::started;
    }
  }
  result.reference = std::max(0, keyframe_);
  result.reference_from_camera = camera_from_reference_.inverse();
  result.covariance = motion_covariance();
  return result;
}

Matrix6d StereoOdometry::motion_covariance() const {
  if (covariance_.isZero(0)) return covariance_;
  const Matrix6d adjoint = camera_from_reference_.adjoint();
  return covariance_ + adjoint * reference_covariance_ * adjoint.transpose();
}

void StereoOdometry::take(const StereoWindowUpdate& update) {
  if (update.keyframe < oldest_keyframe_ || update.keyframe > keyframe_) return;
  const RigidTransform& reference_from_it =
      reference_from_[static_cast<std::size_t>(update.keyframe - oldest_keyframe_)];
  const double fb = camera_.focal_px.x() * camera_.baseline_m;
  std::size_t next = 0;
  std::erase_if(tracks_, [&](Track& track) {
    while (next < update.points.size() && update.points[next].track < track.id) ++next;
    if (next == update.points.size() || update.points[next].track != track.id) return false;
    const StereoWindowUpdate::Point& point = update.points[next];
    if (point.outlier) return true;
    track.point = moved(reference_from_it, point.point);
    // As if its disparity had been measured from every pose; unit norm of (ray, inverse depth).
    const double per_ray = point.point.head<3>().norm();
    track.sigma_w = std::numbers::sqrt2 * options_.sigma_px / fb * per_ray / std::sqrt(std::max(1, point.poses));
    normalise(&track.point, &track.sigma_w);
    return false;
  });
}

std::vector<StereoTrackView> StereoOdometry::tracks() const {
  std::vector<StereoTrackView> views;
  for (const Track& track : tracks_) views.push_back({track.left, track.right_x, track.age});
  return views;
}

}  // namespace parallax
