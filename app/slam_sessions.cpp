#include "app/slam_sessions.h"

#include <algorithm>
#include <cctype>
#include <exception>
#include <filesystem>
#include <optional>
#include <thread>
#include <utility>

#include "app/asset_folder.h"
#include "app/place_vocabulary.h"
#include "app/session_view_watcher.h"
#include "core/mutex.h"
#include "sessions/back_end_worker.h"

namespace parallax {
namespace {

// One session from its first frame to its last.
void run_one(const SlamSessionPlan& plan, const SlamSessionsOptions& options, const SlamLinkMaker& maker, std::size_t k,
             const SlamProgress& progress, SlamSessionOutcome* out) {
  StereoInput input = open_stereo_input(plan.source, plan.calibration, plan.source_options);
  SessionStart start;
  start.name = plan.name;
  start.source = plan.source;
  start.frames_per_second = input.source->frames_per_second();
  {
    const StereoRectifier rectifier(input.calibration, {}, input.source->description());
    start.camera = rectifier.camera();
    start.rectified_from_left = rectifier.rectified_from_left();
  }
  SlamLink link(maker, start, options.resume, options.link);
  if (link.last()) {
    // The last keyframe that is known is seen again, and is the first of this run.
    SourceOptions rest = plan.source_options;
    rest.start_frame = std::max(rest.start_frame, link.last()->frame);
    input = open_stereo_input(plan.source, plan.calibration, rest);
  }
  out->frames_per_second = start.frames_per_second;
  for (const StampedPose& pose : input.source->ground_truth())
    out->truth.push_back({pose.time, pose.world_from_camera});
  int done = 0;
  const int total = input.source->frame_count();
  out->result = run_slam(
      input.source.get(), input.calibration, options.slam,
      [&](const SlamFrame& frame, const StereoImages& images, const StereoOdometry& odometry) {
        if (options.watcher) options.watcher->frame(k, frame, images, odometry);
        if (progress) progress(k, ++done, total, to_string(frame.result.state));
      },
      [&](const StereoKeyframe& keyframe, const StereoWindow& window) {
        if (plan.maps) plan.maps->add(keyframe, window, window.camera());
        const bool loop = link.keyframe(keyframe, window);
        if (options.watcher) options.watcher->keyframe(keyframe, window, link.parts().back());
        return loop;
      });
  link.finish(out->result);
  out->before = out->result.keyframes;
  out->meetings = link.meetings();
  out->parts = link.parts();
  out->state = out->parts.front().state;
}

// The pose graph's last word on the keyframes. A part that has not met the first one stays where odometry guessed.
void take_poses(const BackEndView& view, SlamSessionOutcome* out) {
  for (SlamLinkPart& part : out->parts)
    for (const SessionState& state : view.sessions)
      if (state.id == part.state.id) part.state = state;
  out->state = out->parts.front().state;
  const RigidTransform session_from_global = out->state.global_from_session.inverse();
  for (std::size_t p = 0; p < out->parts.size(); ++p) {
    const SlamLinkPart& part = out->parts[p];
    const bool has_met = part.state.component == out->state.component;
    const RigidTransform session_from_part =
        has_met ? session_from_global * part.state.global_from_session : part.session_from_front_end.inverse();
    const int end =
        p + 1 < out->parts.size() ? out->parts[p + 1].first_local : static_cast<int>(out->result.keyframes.size());
    for (const SessionPose& pose : view.poses) {
      const int local = pose.key.keyframe - part.first_keyframe + part.first_local;
      if (pose.key.session != part.state.id || local < part.first_local || local >= end) continue;
      out->result.keyframes[static_cast<std::size_t>(local)].world_from_camera =
          session_from_part * pose.session_from_camera;
    }
  }
}

void gather_covariances(const SessionGraph& graph, const BackEndView& view, int count,
                        std::map<PoseKey, Matrix6d>* out) {
  if (count < 1) return;
  for (const SessionState& session : view.sessions) {
    const int poses = graph.poses(session.id), step = std::max(1, poses / count);
    for (int i = poses - 1; i > 0; i -= step) {
      Matrix6d covariance;
      if (graph.covariance({session.id, i}, &covariance)) (*out)[{session.id, i}] = covariance;
    }
  }
}

}  // namespace

Trajectory SlamSessionOutcome::global_trajectory() const {
  Trajectory out = result.final_trajectory();
  for (TrajectoryPose& pose : out) pose.world_from_camera = state.global_from_session * pose.world_from_camera;
  return out;
}

std::unique_ptr<BackEnd> make_back_end(SessionDatabase* database, const BackEndOptions& options) {
  const CrfModel crf = CrfModel::load(asset_folder("vocabulary") + "/matching.crf");
  return std::make_unique<BackEnd>(database, place_vocabulary(), crf, options);
}

std::string session_name_of(const std::string& source) {
  std::string name = source;
  while (name.size() > 1 && name.back() == '/') name.pop_back();
  if (!source.starts_with("synthetic:")) name = std::filesystem::path(name).filename().string();
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '_') c = '-';
  return name.empty() ? "session" : name;
}

SlamSessionsResult run_slam_sessions(const std::vector<SlamSessionPlan>& plans, const SlamSessionsOptions& options,
                                     const SlamLinkMaker& link, const SlamProgress& progress) {
  SlamSessionsResult out;
  out.sessions.resize(plans.size());
  std::unique_ptr<SessionDatabase> database;
  std::unique_ptr<BackEndWorker> worker;
  SlamLinkMaker make = link;
  if (!make) {
    if (!options.database.empty())
      database = std::make_unique<SessionDatabase>(options.database, SqliteMode::write, "parallax " PARALLAX_VERSION);
    worker = std::make_unique<BackEndWorker>(make_back_end(database.get(), options.back_end));
    make = [&] { return worker->make_link(); };
    if (options.watcher) options.watcher->back_end(worker.get());
  }
  // Before the back end goes, and whatever is thrown.
  const std::unique_ptr<SlamWatcher, void (*)(SlamWatcher*)> watched(worker ? options.watcher : nullptr,
                                                                     [](SlamWatcher* w) { w->back_end(nullptr); });
  if (options.at_once) {
    Mutex mutex;
    std::exception_ptr failure;
    {
      std::vector<std::jthread> threads;
      for (std::size_t k = 0; k < plans.size(); ++k)
        threads.emplace_back([&, k] {
          try {
            run_one(plans[k], options, make, k, {}, &out.sessions[k]);
          } catch (...) {
            MutexLock lock(mutex);
            if (!failure) failure = std::current_exception();
          }
        });
    }
    if (failure) std::rethrow_exception(failure);
  } else {
    for (std::size_t k = 0; k < plans.size(); ++k) run_one(plans[k], options, make, k, progress, &out.sessions[k]);
  }
  if (worker) {
    worker->ask([&](BackEnd& back_end) {
      back_end.finish();
      out.view = back_end.view();
      out.refused = back_end.refused_places();
      out.timings = back_end.timings();
      gather_covariances(back_end.graph(), out.view, options.covariances, &out.covariances);
    });
    for (SlamSessionOutcome& session : out.sessions) take_poses(out.view, &session);
  }
  return out;
}

}  // namespace parallax
