#include "app/session_view_feed.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace parallax {
namespace {

constexpr int kThumbnailWidth = 300;
constexpr int kPointsAKeyframe = 40;
constexpr std::size_t kMostViewPoints = 60000;
constexpr double kFarthestPointM = 12;
constexpr std::chrono::milliseconds kAskEvery{300};
constexpr int kLiveSpreads = 6;  // of a session

cv::Mat3b thumbnail_with_tracks(const GreyImage& left, const std::vector<StereoTrackView>& tracks) {
  const double scale = std::min(1.0, static_cast<double>(kThumbnailWidth) / std::max(1, left.cols));
  cv::Mat1b small;
  cv::resize(left, small, {}, scale, scale, cv::INTER_AREA);
  cv::Mat3b picture;
  cv::cvtColor(small, picture, cv::COLOR_GRAY2BGR);
  for (const StereoTrackView& track : tracks) {
    const cv::Point2d at((track.left.x() + 0.5) * scale - 0.5, (track.left.y() + 0.5) * scale - 0.5);
    const bool near = std::isfinite(track.right_x);  // seen by both cameras
    cv::circle(picture, at, 2, near ? cv::Scalar(115, 200, 0) : cv::Scalar(0, 159, 230), cv::FILLED, cv::LINE_AA);
  }
  return picture;
}

}  // namespace

void ModuleLoad::add(double ms) {
  ++steps;
  mean_ms += (ms - mean_ms) / static_cast<double>(steps);
  last_ms = ms;
  worst_ms = std::max(worst_ms, ms);
}

SessionFeed::SessionFeed(std::size_t sessions)
    : images_(sessions), snapshot_(std::make_shared<const SessionViewSnapshot>()) {}

SessionFeed::~SessionFeed() = default;

void SessionFeed::frame(std::size_t k, const SlamFrame& frame, const StereoImages& images,
                        const StereoOdometry& odometry) {
  SessionImage image;
  const std::vector<StereoTrackView> tracks = odometry.tracks();
  image.picture = thumbnail_with_tracks(images.left, tracks);
  image.state = to_string(frame.result.state);
  image.frame = frame.result.frame;
  image.tracks = static_cast<int>(tracks.size());
  MutexLock lock(mutex_);
  images_.at(k) = std::move(image);
  loads_[static_cast<std::size_t>(SessionModule::feature_tracking)].add(frame.result.timing.feature_tracking_ms);
  loads_[static_cast<std::size_t>(SessionModule::stereo_odometry)].add(frame.result.timing.odometry_ms);
  ++version_;
  changed_.notify_all();
}

void SessionFeed::keyframe(const StereoKeyframe& keyframe, const StereoWindow& window, const SlamLinkPart& part) {
  const PoseKey key{part.state.id, part.keyframe_of(keyframe.index)};
  std::vector<Eigen::Vector3f> points;
  const std::size_t step = std::max<std::size_t>(1, keyframe.measurements.size() / kPointsAKeyframe);
  for (std::size_t i = 0; i < keyframe.measurements.size(); i += step) {
    const Eigen::Vector4d& p = keyframe.measurements[i].point;
    if (p.w() * kFarthestPointM > std::abs(p.z()) && p.z() > 0) points.push_back(p.hnormalized().cast<float>());
  }
  const RigidTransform pose = part.session_from_front_end * window.poses().back().world_from_camera;
  MutexLock lock(mutex_);
  points_[key] = std::move(points);
  poses_[key.session].push_back({key, pose});
  ++version_;
  changed_.notify_all();
}

void SessionFeed::back_end(BackEndWorker* worker) {
  poller_ = std::jthread();  // one before has ended
  if (worker != nullptr) poller_ = std::jthread([this, worker](const std::stop_token& stop) { poll(stop, worker); });
}

void SessionFeed::poll(const std::stop_token& stop, BackEndWorker* worker) {
  Mutex waiting;
  std::condition_variable_any never;
  while (!stop.stop_requested()) {
    try {
      worker->ask([this](BackEnd& back_end) { take(back_end); });
    } catch (...) {
      return;  // the run tells it
    }
    MutexLock lock(waiting);
    never.wait_for(waiting, stop, kAskEvery, [] { return false; });
  }
}

void SessionFeed::take(const BackEnd& back_end) {
  auto out = std::make_shared<SessionViewSnapshot>();
  const BackEndView view = back_end.view();
  out->scene = make_session_scene(view);
  add_spreads(back_end.graph(), kLiveSpreads, &out->scene);
  for (const Encounter& encounter : view.encounters) {
    out->waiting += encounter.state == EncounterState::waiting ? 1 : 0;
    out->refused += encounter.state == EncounterState::refused ? 1 : 0;
  }
  MutexLock lock(mutex_);
  const std::vector<SessionTiming>& timings = back_end.timings();
  for (; timings_seen_ < timings.size(); ++timings_seen_) {
    const SessionTiming& timing = timings[timings_seen_];
    const bool of_frame =
        timing.module == SessionModule::feature_tracking || timing.module == SessionModule::stereo_odometry;
    if (!of_frame) loads_[static_cast<std::size_t>(timing.module)].add(timing.ms);  // frames told theirs
  }
  out->loads = loads_;

  std::size_t all = 0;
  for (const auto& [key, points] : points_) all += points.size();
  const std::size_t step = all / kMostViewPoints + 1;
  for (SceneSession& session : out->scene.sessions) {
    // Keyframes that the graph does not hold follow the last one that it does.
    SceneTail tail;
    tail.session = session.id;
    RigidTransform global_from_front_end;
    for (const SessionState& state : view.sessions)
      if (state.id == session.id) global_from_front_end = state.global_from_session;
    for (const FrontEndPose& pose : poses_[session.id]) {
      if (const ScenePose* known = out->scene.pose(pose.key)) {
        global_from_front_end = known->global_from_camera * pose.session_from_camera.inverse();
        tail.places = {known->global_from_camera.t};
        tail.global_from_camera = known->global_from_camera;
      } else {
        tail.global_from_camera = global_from_front_end * pose.session_from_camera;
        tail.places.push_back(tail.global_from_camera.t);
      }
    }
    if (!tail.places.empty()) out->tails.push_back(std::move(tail));
    std::size_t n = 0;
    for (auto it = points_.lower_bound({session.id, 0}); it != points_.end() && it->first.session == session.id; ++it) {
      const ScenePose* pose = out->scene.pose(it->first);
      if (pose == nullptr) break;
      for (const Eigen::Vector3f& point : it->second)
        if (n++ % step == 0)
          session.points.push_back(
              {(pose->global_from_camera * point.cast<double>()).cast<float>(), {150, 150, 150}, 0});
    }
  }
  snapshot_ = std::move(out);
  ++version_;
  changed_.notify_all();
}

std::uint64_t SessionFeed::version() const {
  MutexLock lock(mutex_);
  return version_;
}

std::shared_ptr<const SessionViewSnapshot> SessionFeed::snapshot() const {
  MutexLock lock(mutex_);
  return snapshot_;
}

std::vector<SessionImage> SessionFeed::images() const {
  MutexLock lock(mutex_);
  return images_;  // pictures are shared, and never written to again
}

void SessionFeed::wait_newer(std::uint64_t version, std::chrono::milliseconds most) {
  MutexLock lock(mutex_);
  changed_.wait_for(mutex_, most, [&]() PARALLAX_REQUIRES(mutex_) { return version_ > version; });
}

void SessionFeed::wake() {
  MutexLock lock(mutex_);
  ++version_;
  changed_.notify_all();
}

}  // namespace parallax
