#include "tracker/initialisation.h"

#include <algorithm>

#include "solver/pose_refinement.h"

namespace parallax {
namespace {

// Fewer trails than this cannot give two views worth having.
constexpr int kMinTrails = 60;
// Each refused automatic try waits until the trails have grown by this much.
constexpr double kRetryGrowth = 1.15;
constexpr double kRetryStep_px = 0.3;
// Pose from trails: a match counts as right within this many pixels.
constexpr int kMinPoseInliers = 20;

std::shared_ptr<const ImagePyramid> pyramid_of(const std::shared_ptr<const FrameImages>& images) {
  return {images, &images->pyramid};
}

}  // namespace

Initialisation::Initialisation(const CameraModel& camera, const TrackerOptions& options, bool automatic,
                               TrackerSchedule* schedule)
    : camera_(camera), options_(options), automatic_(automatic), schedule_(schedule), trails_(options.trails) {}

void Initialisation::reset() {
  trails_.clear();
  first_.reset();
  last_.reset();
  pending_.reset();
  accepted_.reset();
  refusal_.clear();
}

void Initialisation::start(const Frame& frame, const std::shared_ptr<const FrameImages>& images) {
  trails_.start(pyramid_of(images), images->corners[0]);
  first_ = images;
  last_ = images;
  first_frame_ = frame.index;
  first_time_ = frame.time;
  next_motion_px_ = options_.auto_min_motion_px;
}

void Initialisation::follow(const std::shared_ptr<const FrameImages>& images) {
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();
  const SmallImageAlignment alignment = align_small_images(last_->small, images->small);
  if (alignment.converged) shift = alignment.shift;
  trails_.track(pyramid_of(images), shift);
  last_ = images;
}

bool Initialisation::motion_is_worth_a_try(const Frame& frame) {
  std::vector<double> lengths;
  for (const Trail& t : trails_.trails()) lengths.push_back((t.current - t.first).norm());
  if (static_cast<int>(lengths.size()) < kMinTrails) return false;
  std::nth_element(lengths.begin(), lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2), lengths.end());
  const double median = lengths[lengths.size() / 2];
  if (median < next_motion_px_) return false;
  next_motion_px_ = std::max(median * kRetryGrowth, median + kRetryStep_px);
  return frame.index > first_frame_ + 1;
}

bool Initialisation::request(const Frame& frame, const std::shared_ptr<const FrameImages>& images,
                             const std::function<void(const std::shared_ptr<const FrameImages>&)>& give_away) {
  InitialisationRequest request;
  request.automatic = automatic_;
  request.first_frame = first_frame_;
  request.second_frame = frame.index;
  request.first_time = first_time_;
  request.second_time = frame.time;
  request.first = first_;
  request.second = images;
  for (const Trail& t : trails_.refined()) request.matches.push_back({t.id, t.first, t.current});
  auto reply = request.reply.get_future();
  give_away(first_);
  give_away(images);
  MapperMessage message = std::move(request);
  if (!schedule_->try_push(message)) return false;
  pending_ = std::move(reply);
  return true;
}

std::optional<RigidTransform> Initialisation::pose_from_trails(const TrackingSnapshot& map) const {
  std::unordered_map<int, PointId> point_of(accepted_->point_of_trail.begin(), accepted_->point_of_trail.end());
  std::vector<PoseObservation> observations;
  for (const Trail& t : trails_.trails()) {
    const auto it = point_of.find(t.id);
    if (it == point_of.end()) continue;
    const auto row = std::lower_bound(map.id.begin(), map.id.end(), it->second);
    if (row == map.id.end() || *row != it->second) continue;
    observations.push_back({map.position[static_cast<std::size_t>(row - map.id.begin())], t.current, 1.0});
  }
  // The world may have moved since the answer was given.
  const RigidTransform answered = map.world_from_first.rebase(accepted_->second_from_world);
  RigidTransform pose = answered;
  const PoseSummary summary = refine_pose(camera_, observations, PoseOptions{}, &pose);
  if (summary.ok && summary.inliers >= kMinPoseInliers) return pose;
  return answered;
}

Initialisation::Step Initialisation::step(
    const Frame& frame, const std::shared_ptr<const FrameImages>& images, bool key_press, const TrackingSnapshot& map,
    const std::function<void(const std::shared_ptr<const FrameImages>&)>& give_away) {
  Step out;
  if (!trails_.active()) {
    if (automatic_ || key_press) {
      start(frame, images);
      out.state = TrackingState::trailing;
      return out;
    }
    out.message = refusal_.empty() ? "press Space, then slide the camera sideways" : refusal_;
    return out;
  }
  follow(images);
  out.state = TrackingState::trailing;

  const bool accepted_before = accepted_.has_value();
  if (pending_ && schedule_->is_ready(*pending_)) {
    InitialisationReply reply = pending_->get();
    pending_.reset();
    if (reply.ok) {
      accepted_ = std::move(reply);
    } else {
      out.message = reply.reason;
    }
  }
  if (accepted_ && !map.empty()) {
    out.first_pose = pose_from_trails(map);
    out.state = TrackingState::tracking;
    reset();
    return out;
  }
  if (accepted_before) {
    // The map is published before the answer is given: it has been there, and was reset since.
    reset();
    out.state = TrackingState::waiting;
    return out;
  }
  if (pending_ || accepted_) {
    out.state = TrackingState::initialising;
    return out;
  }
  const int alive = static_cast<int>(trails_.trails().size());
  if (automatic_) {
    if (alive < std::max(kMinTrails, static_cast<int>(options_.auto_min_survivors * trails_.started())) ||
        frame.index - first_frame_ > options_.auto_max_frames) {
      start(frame, images);
    } else if (motion_is_worth_a_try(frame) && request(frame, images, give_away)) {
      out.state = TrackingState::initialising;
    }
  } else if (key_press) {
    if (request(frame, images, give_away)) out.state = TrackingState::initialising;
  } else if (alive < kMinTrails / 2) {
    reset();
    refusal_ = "too few patches could be followed: press Space to start again, and move more slowly";
    out.message = refusal_;
    out.state = TrackingState::waiting;
  }
  return out;
}

std::vector<std::array<Eigen::Vector2f, 2>> Initialisation::trails_for_drawing() const {
  std::vector<std::array<Eigen::Vector2f, 2>> out;
  for (const Trail& t : trails_.trails()) out.push_back({t.first.cast<float>(), t.current.cast<float>()});
  return out;
}

}  // namespace parallax
